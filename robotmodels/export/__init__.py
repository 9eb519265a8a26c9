"""Flat code of models in C, Python, NumPy, CasADi and MATLAB."""

__all__: list[str] = []
