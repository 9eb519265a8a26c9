"""Robots with kinematic loops: closures, reduced models, dynamics, base parameters."""

__all__: list[str] = []
