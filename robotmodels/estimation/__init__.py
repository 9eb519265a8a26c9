"""Estimation: numerics of linear models that know no robot."""

from .columns import ColumnBasis, column_basis
from .triangles import factors_by_kind, triangular_factor

__all__ = ["ColumnBasis", "column_basis", "factors_by_kind", "triangular_factor"]
