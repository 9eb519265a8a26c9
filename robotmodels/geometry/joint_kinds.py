"""Kinds of joints: revolute, prismatic, fixed."""

REVOLUTE, PRISMATIC, FIXED = 0, 1, 2
"""Values of sigma, book eq. [1.2]; 2 marks a frame that is fixed to its antecedent."""
