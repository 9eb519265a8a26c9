"""Estimation: numerics of linear models that know no robot."""

from .columns import ColumnBasis, column_basis

__all__ = ["ColumnBasis", "column_basis"]
