"""The results of `explain_singularities`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from .._choices import chosen
from ..errors import InvalidValueError
from ..kinematics import SingularityKind
from ..latex_text import Explanation
from .explanation import FormulaNumbers
from .factor import SingularityFactor


class FormulaStatus(Enum):
    """Completeness of the formulas; the value is a sentence."""

    FACTORED = "The determinant is the product of the factors."
    NOT_FACTORED = "The determinant does not factor: it is given as one polynomial."
    NOT_SOLVED = (
        "The determinant is the product of the factors, but one of them cannot be solved for a "
        "joint in closed form."
    )
    MINORS = (
        "The matrix is not square: its rank is lower where all its minors vanish, that is, where "
        "all factors of any one condition vanish."
    )
    TOO_LONG = (
        "A determinant has too many terms to be written out; the factor in its place is "
        "computed from its matrix."
    )
    TOO_MANY_FAMILIES = (
        "The matrix is not square, and the ways in which all its minors vanish are too many to be "
        "followed."
    )
    NEVER_FULL_RANK = (
        "The matrix has less than full rank in every position: the velocities that the joints "
        "give the frame are dependent everywhere."
    )
    TOO_MANY_JOINTS = "The robot has so many joints that its minors are too many to be written out."
    NO_JOINTS = "No joint moves the frame."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularityCondition:
    """Factors that are zero together in a family of singular positions.

    Parameters
    ----------
    factors : tuple of SingularityFactor
        One for a square matrix; for others every minor must have a factor that vanishes.
    kind : SingularityKind
        That of all its factors, else OTHER.
    text : str
        Such as ``"S2 = 0 and C3 = 0"``.
    """

    factors: tuple[SingularityFactor, ...]
    kind: SingularityKind
    text: str

    def holds(self, q: ArrayLike, tolerance: float = 1e-9) -> Any:
        """Whether every factor is smaller than a tolerance (in its unit) at q (..., n)."""
        return np.all([np.abs(f.values(q)) <= tolerance for f in self.factors], axis=0)

    def __repr__(self) -> str:
        return f"<SingularityCondition {self.kind.value}: {self.text:.60}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularityExplanation(Explanation):
    """The singular positions of a robot as formulas, made by `explain_singularities`.

    Parameters
    ----------
    status : FormulaStatus
        How far the formulas go.
    task : str
        Which rows of the third matrix count, in words.
    factors : tuple of SingularityFactor
        Each once; for a matrix that is not square, those of the conditions.
    conditions : tuple of SingularityCondition
        The families of singular positions.
    constant : float
        ``determinant = constant * product of factor**power``; NaN for a matrix that is not square.
    unit : str
        Of the determinant.
    projection, intermediate : str
        Names of the frames i and j of the third matrix; empty where each minor has its own.
    matrix, rows : sympy.ImmutableDenseMatrix or None, and tuple of int
        The rows that count of the third matrix, and which of ``[v; w]`` (0 to 5) they are.
    """

    robot: str
    frame: str
    status: FormulaStatus
    task: str
    numbers: FormulaNumbers
    factors: tuple[SingularityFactor, ...] = ()
    conditions: tuple[SingularityCondition, ...] = ()
    constant: float = float("nan")
    unit: str = "1"
    projection: str = ""
    intermediate: str = ""
    matrix: Any = None
    rows: tuple[int, ...] = ()
    text: str = ""
    latex: str = ""

    def values(self, q: ArrayLike) -> Array:
        """All factors (..., number of factors) at q (..., n), each in its unit."""
        q = as_vector(q, len(self.numbers.variables), "q")
        if not self.factors:
            return np.zeros((*q.shape[:-1], 0))
        return np.stack([factor.values(q) for factor in self.factors], axis=-1)

    def determinant(self, q: ArrayLike) -> Array:
        """Determinant (...) of the square matrix that decides, at q (..., n), from the formulas.

        For six joints that of the Jacobian, sign included; for fewer that of the rows that ``task``
        names, in the axes of R_i; zero where the matrix has never full rank. An error if the
        matrix is not square.
        """
        q = as_vector(q, len(self.numbers.variables), "q")
        if np.isnan(self.constant):
            raise InvalidValueError(
                f"{self.robot}: there is no determinant ({self.status.value}) Use values(q), or a "
                "factor."
            )
        out = np.full(q.shape[:-1], self.constant)
        for factor in self.factors:
            out = out * factor.values(q) ** factor.power
        return out

    def factor(self, kind: SingularityKind) -> SingularityFactor:
        """The only factor of a kind; an error if there is none or several."""
        kind = chosen(SingularityKind, kind, "kind")
        found = [factor for factor in self.factors if factor.kind is kind]
        if len(found) == 1:
            return found[0]
        known = ", ".join(f"{f.kind.value} ({f.text:.60})" for f in self.factors) or "none"
        raise InvalidValueError(
            f"{self.robot} has {len(found)} factors of the kind {kind.value!r}; take one of "
            f".factors instead: {known}."
        )

    def __repr__(self) -> str:
        return f"<SingularityExplanation of {self.robot}: {len(self.factors)} factors>"
