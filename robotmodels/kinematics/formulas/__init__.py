"""The Jacobian and its singular positions as formulas."""
