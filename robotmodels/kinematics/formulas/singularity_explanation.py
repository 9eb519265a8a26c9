"""What `explain_singularities` returns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_vector
from ...errors import InvalidValueError
from ...latex_text import markdown
from ..singularity_kind import SingularityKind
from ._numbers import FormulaNumbers


class FormulaStatus(Enum):
    """How far the formulas go; the value is a sentence.

    Examples
    --------
    >>> FormulaStatus.FACTORED.value
    'The determinant is the product of the factors.'
    """

    FACTORED = "The determinant is the product of the factors."
    NOT_FACTORED = "The determinant does not factor: it is given as the polynomial it is."
    NOT_SOLVED = (
        "The determinant is the product of the factors, but one of them cannot be solved for a "
        "joint in closed form."
    )
    MINORS = (
        "The matrix is not square: it loses rank where all its minors vanish, that is where every "
        "factor of one of the conditions does."
    )
    TOO_LONG = (
        "A determinant has too many terms to be written out; the factor that stands for it is "
        "computed from its matrix."
    )
    TOO_MANY_FAMILIES = (
        "The matrix is not square, and the ways in which all its minors vanish are too many to be "
        "followed."
    )
    NEVER_FULL_RANK = (
        "The matrix has less than full rank in every position: some joints move the frame alike "
        "wherever they stand."
    )
    TOO_MANY_JOINTS = "The robot has so many joints that its minors are too many to be written out."
    NO_JOINTS = "No joint moves the frame."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularityFactor:
    """A factor of the determinant: the robot is singular where it is zero.

    Parameters
    ----------
    kind : SingularityKind
        Where in the arm.
    text, latex : str
        The formula, in the notation of `explain_dgm`; the text is Python as well.
    expression : sympy.Expr or None
        The formula; None where it is too long to be written out.
    joints : tuple of int
        Columns of q, from 0, that it depends on.
    power : int
        How often the determinant has it (1 for minors).
    unit : str
        ``"1"``, ``"m"``, ``"m^2"``, ...
    meaning : str
        What happens in the arm, in a sentence.
    solved_joint : int or None
        Column of the joint whose value `zeros` gives; None where no joint can be solved for.
    solution, solution_latex : str
        Where it vanishes, as formulas for that joint.
    never_zero : bool
        Whether the constants of this robot keep it from vanishing.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics.formulas.explain_singularities import explain_singularities
    >>> elbow = explain_singularities(load("rx90")).factor(SingularityKind.ELBOW)
    >>> elbow.text, elbow.solution, elbow.meaning
    ('C3', 'θ3 = -π/2 or π/2',
     'the wrist centre is in the plane of axes 2 and 3: the arm is stretched or folded')
    """

    kind: SingularityKind
    text: str
    latex: str
    expression: Any
    joints: tuple[int, ...]
    power: int
    unit: str
    meaning: str
    solved_joint: int | None
    solution: str
    solution_latex: str
    never_zero: bool
    numbers: FormulaNumbers
    matrix: Any = None
    coefficients: tuple[Any, Any, Any] | None = None
    offset: float = 0.0
    prismatic: bool = False

    def values(self, q: ArrayLike) -> Array:
        """The factor in numbers.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray, shape (...)
            Values, in ``unit``.

        Raises
        ------
        ShapeError, InvalidValueError
            ``q`` of the wrong length, or with NaN or infinity.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.kinematics.formulas.explain_singularities import (
        ...     explain_singularities)
        >>> wrist = explain_singularities(load("rx90")).factor(SingularityKind.WRIST)
        >>> float(wrist.values([0, 0, 0, 0, 0.5, 0]) - np.sin(0.5))
        0.0
        """
        q = as_vector(q, len(self.numbers.variables), "q")
        if self.expression is None:
            return np.asarray(np.linalg.det(self.numbers.matrix(self.matrix, q)))
        return self.numbers.values(self.expression, q)

    def zeros(self, q: ArrayLike) -> Array:
        """Values of the solved joint that make the factor zero, the others as they are in q.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables, rad or m; that of ``solved_joint`` does not count.

        Returns
        -------
        ndarray, shape (..., 2)
            Angles in (-pi, pi], or a stroke and NaN; NaN where there is none.

        Raises
        ------
        ShapeError, InvalidValueError
            ``q`` does not fit, or no joint could be solved for (``solved_joint`` is None).

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.kinematics.formulas.explain_singularities import (
        ...     explain_singularities)
        >>> elbow = explain_singularities(load("rx90")).factor(SingularityKind.ELBOW)
        >>> elbow.zeros(np.zeros(6)).round(3)
        array([-1.571,  1.571])
        """
        q = as_vector(q, len(self.numbers.variables), "q")
        if self.coefficients is None:
            raise InvalidValueError(
                f"{self.text:.60}: no joint of this factor can be solved for in closed form; look "
                "for its zeros in numbers, in the data of singularity_map for instance."
            )
        A, B, C = (self.numbers.values(c, q) for c in self.coefficients)
        out = np.full((*q.shape[:-1], 2), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.prismatic:
                out[..., 0] = np.where(A != 0.0, -C / A, np.nan)
                return out
            size = np.hypot(A, B)
            ratio = -C / size
            # rounding must not take a double root away
            ratio = np.where(np.abs(np.abs(ratio) - 1.0) < 1e-14, np.sign(ratio), ratio)
            half = np.arccos(np.where(np.abs(ratio) <= 1.0, ratio, np.nan))
        middle = np.arctan2(B, A)
        both = np.stack([middle - half, middle + half], axis=-1) - self.offset
        return np.sort(np.pi - np.mod(np.pi - both, 2.0 * np.pi), axis=-1)

    def __repr__(self) -> str:
        return f"<SingularityFactor {self.kind.value}: {self.text:.60}>"


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

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics.formulas.explain_singularities import explain_singularities
    >>> [c.text for c in explain_singularities(load("iiwa14")).conditions]
    ['S4 = 0', 'S2 = 0 and C3 = 0', 'S2 = 0 and S6 = 0', 'C5 = 0 and S6 = 0']
    """

    factors: tuple[SingularityFactor, ...]
    kind: SingularityKind
    text: str

    def holds(self, q: ArrayLike, tolerance: float = 1e-9) -> Any:
        """Whether every factor is smaller than a tolerance, boolean of shape (...).

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables, rad or m.
        tolerance : float
            In the units of the factors.

        Returns
        -------
        ndarray of bool, shape (...)
            Where it holds.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.kinematics.formulas.explain_singularities import (
        ...     explain_singularities)
        >>> explain_singularities(load("iiwa14")).conditions[0].holds(np.zeros(7))
        np.True_
        """
        return np.all([np.abs(f.values(q)) <= tolerance for f in self.factors], axis=0)

    def __repr__(self) -> str:
        return f"<SingularityCondition {self.kind.value}: {self.text:.60}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularityExplanation:
    """The singular positions of a robot as formulas, made by `explain_singularities`.

    Parameters
    ----------
    robot, frame : str
        Names of the robot and of the frame whose motion it is.
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
    matrix : sympy.ImmutableDenseMatrix, shape (rows, columns), or None
        The rows that count of the third matrix.
    rows : tuple of int
        Which those are, 0 to 5 for ``[v; w]``; empty where each minor has its own.
    text, latex : str
        All of it for people.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics.formulas.explain_singularities import explain_singularities
    >>> rx90 = explain_singularities(load("rx90"))
    >>> [(f.kind.value, f.text) for f in rx90.factors]
    [('shoulder', 'S23*RL4 - C2*D3'), ('elbow', 'C3'), ('wrist', 'S5')]
    """

    robot: str
    frame: str
    status: FormulaStatus
    task: str
    factors: tuple[SingularityFactor, ...]
    conditions: tuple[SingularityCondition, ...]
    constant: float
    unit: str
    projection: str
    intermediate: str
    matrix: Any
    rows: tuple[int, ...]
    numbers: FormulaNumbers
    text: str
    latex: str

    def values(self, q: ArrayLike) -> Array:
        """All factors in numbers.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray, shape (..., number of factors)
            In the order of ``factors``, each in its unit.

        Raises
        ------
        ShapeError, InvalidValueError
            ``q`` of the wrong length, or with NaN or infinity.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.kinematics.formulas.explain_singularities import (
        ...     explain_singularities)
        >>> explain_singularities(load("rx90")).values(np.zeros((4, 6))).shape
        (4, 3)
        """
        q = as_vector(q, len(self.numbers.variables), "q")
        if not self.factors:
            return np.zeros((*q.shape[:-1], 0))
        return np.stack([factor.values(q) for factor in self.factors], axis=-1)

    def determinant(self, q: ArrayLike) -> Array:
        """Determinant of the square matrix that decides, from the formulas.

        For six joints it is the determinant of the Jacobian, sign included, whatever the frames,
        for the first two of the three matrices have the determinant 1. For fewer it is that of
        the rows that ``task`` names, in the axes of R_i.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray, shape (...)
            Values, in ``unit``; zero where the matrix has never full rank.

        Raises
        ------
        ShapeError, InvalidValueError
            ``q`` does not fit, or the matrix is not square.

        Examples
        --------
        >>> from robotmodels.kinematics import jacobian
        >>> from robotmodels.robots import load
        >>> from robotmodels.kinematics.formulas.explain_singularities import (
        ...     explain_singularities)
        >>> rx90, q = load("rx90"), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
        >>> D = explain_singularities(rx90).determinant(q)
        >>> np.isclose(D, np.linalg.det(jacobian(rx90, q)), rtol=1e-12)
        np.True_
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
        """The factor of a kind.

        Parameters
        ----------
        kind : SingularityKind
            Such as ``SingularityKind.ELBOW``.

        Returns
        -------
        SingularityFactor
            The only one.

        Raises
        ------
        InvalidValueError
            There is none, or there are several.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.kinematics.formulas.explain_singularities import (
        ...     explain_singularities)
        >>> explain_singularities(load("ur5e")).factor(SingularityKind.WRIST).text
        'S5'
        """
        if not isinstance(kind, SingularityKind):
            raise InvalidValueError(
                f"kind: expected a SingularityKind such as SingularityKind.ELBOW, got {kind!r}."
            )
        found = [factor for factor in self.factors if factor.kind is kind]
        if len(found) == 1:
            return found[0]
        known = ", ".join(f"{f.kind.value} ({f.text:.60})" for f in self.factors) or "none"
        raise InvalidValueError(
            f"{self.robot} has {len(found)} factors of the kind {kind.value!r}; take one of "
            f".factors instead: {known}."
        )

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<SingularityExplanation of {self.robot}: {len(self.factors)} factors>"

    def _repr_markdown_(self) -> str:
        """What a notebook shows."""
        return markdown(self.latex)

    def _repr_latex_(self) -> str:
        """What a notebook that becomes a LaTeX document shows."""
        return self.latex
