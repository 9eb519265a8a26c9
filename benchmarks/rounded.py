"""Numbers as tables show them."""


def figure(x: float) -> str:
    """Two or three digits, no exponents."""
    if x >= 100.0:
        return f"{x:.0f}"
    digits = 1 if x >= 10.0 else 2 if x >= 0.1 else 3 if x >= 0.01 else 4
    return f"{x:.{digits}f}"
