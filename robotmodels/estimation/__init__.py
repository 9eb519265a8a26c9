"""Estimation: numerics of linear models that know no robot."""

from .columns import ColumnBasis, column_basis
from .triangles import triangular_factor

__all__ = ["ColumnBasis", "column_basis", "triangular_factor"]
