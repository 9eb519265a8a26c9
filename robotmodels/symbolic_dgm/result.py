"""What `explain_dgm` returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..latex_text import markdown
from ._numbers import number_of


@dataclass(frozen=True, slots=True)
class SymbolicTransform:
    """One transformation matrix of the derivation.

    Parameters
    ----------
    name : str
        Such as ``"2T3"``, the pose of R_3 in R_2; ``"Z"`` and ``"E"`` are base and tool.
    motion : str
        What it is the product of, such as ``"Trans(x, D3) Rot(z, θ3)"`` or ``"2T3 3T6"``.
    matrix : sympy.ImmutableDenseMatrix, shape (4, 4)
        Its entries, lengths in metres.

    Examples
    --------
    >>> from robotmodels import DHTable, RobotModel
    >>> from robotmodels.symbolic_dgm import explain_dgm
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> step = explain_dgm(arm).factors[1]
    >>> step.name, step.motion, step.matrix[0, 3]
    ('1T2', 'Trans(x, D2) Rot(z, θ2)', D2)
    """

    name: str
    motion: str
    matrix: Any


@dataclass(frozen=True, slots=True, repr=False)
class DirectModelExplanation:
    """The symbolic direct geometric model of a robot, made by `explain_dgm`.

    Printing it shows the derivation; the expressions are SymPy's.

    Parameters
    ----------
    robot, frame : str
        Names of the robot and of the frame whose pose it is.
    variables : tuple of sympy.Symbol, length n
        Joint variables in table order: ``theta_j`` if revolute, ``r_j`` if prismatic, numbered
        by frame.
    factors : tuple of SymbolicTransform
        ``T(a(j), j)`` of each row from the base to the frame.
    products : tuple of SymbolicTransform
        Products of the last two, three, ... factors; the last one is that of all of them.
    product : SymbolicTransform
        ``0Tn``, the pose of the last frame of the chain in R_0.
    base, tool : SymbolicTransform or None
        ``Z`` and ``E`` of eq. [1.10]; None where they are the identity.
    pose : sympy.ImmutableDenseMatrix, shape (4, 4)
        The world pose, ``Z 0Tn E``.
    abbreviations : tuple of (sympy.Symbol, sympy.Expr)
        ``C23`` and its meaning ``cos(theta2 + theta3)``, and so on; each uses only symbols that
        come before it.
    constants : tuple of (sympy.Symbol, float)
        The values of lengths (metres) and angles (radians) of this robot.
    text, latex : str
        The derivation for people; the LaTeX says the same, as paragraphs and amsmath
        environments.

    Examples
    --------
    >>> from robotmodels import DHTable, RobotModel
    >>> from robotmodels.symbolic_dgm import explain_dgm
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> model = explain_dgm(arm)
    >>> model.P.T
    Matrix([[C1*D2, D2*S1, 0]])
    """

    robot: str
    frame: str
    variables: tuple[Any, ...]
    factors: tuple[SymbolicTransform, ...]
    products: tuple[SymbolicTransform, ...]
    product: SymbolicTransform
    base: SymbolicTransform | None
    tool: SymbolicTransform | None
    pose: Any
    abbreviations: tuple[tuple[Any, Any], ...]
    constants: tuple[tuple[Any, float], ...]
    text: str
    latex: str

    @property
    def s(self) -> Any:
        """First axis of the frame in the world, a column of three expressions."""
        return self.pose[:3, 0]

    @property
    def n(self) -> Any:
        """Second axis of the frame in the world."""
        return self.pose[:3, 1]

    @property
    def a(self) -> Any:
        """Third axis of the frame in the world."""
        return self.pose[:3, 2]

    @property
    def P(self) -> Any:
        """Origin of the frame in the world, metres."""
        return self.pose[:3, 3]

    def written_out(self) -> Any:
        """The pose with every abbreviation replaced: in joint variables and constants only.

        Returns
        -------
        sympy.ImmutableDenseMatrix, shape (4, 4)
            For differentiation and the like. Long for an arm with many oblique axes.

        Examples
        --------
        >>> from robotmodels import DHTable, RobotModel
        >>> from robotmodels.symbolic_dgm import explain_dgm
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0]))
        >>> explain_dgm(arm).written_out()[0, 0]
        cos(theta1 + theta2)
        """
        pose = self.pose
        for symbol, meaning in reversed(self.abbreviations):
            pose = pose.xreplace({symbol: meaning})
        return pose

    def evaluate(self, q: ArrayLike) -> Array:
        """The formulas in numbers, with the constants of this robot: equal to `dgm`.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables in table order, rad or m.

        Returns
        -------
        ndarray, shape (..., 4, 4)
            World poses, positions in metres.

        Raises
        ------
        ShapeError, InvalidValueError
            ``q`` of the wrong length, or with NaN or infinity.

        Examples
        --------
        >>> from robotmodels import DHTable, RobotModel
        >>> from robotmodels.symbolic_dgm import explain_dgm
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
        >>> explain_dgm(arm).evaluate([np.pi / 2, 0.0])[:3, 3].round(12)
        array([0. , 0.3, 0. ])
        """
        q = as_vector(q, len(self.variables), "q")
        known: dict[Any, Any] = dict(self.constants)
        known |= {symbol: q[..., i] for i, symbol in enumerate(self.variables)}
        for symbol, meaning in self.abbreviations:
            known[symbol] = number_of(meaning, known)
        T = np.empty((*q.shape[:-1], 4, 4))
        for i in range(4):
            for j in range(4):
                T[..., i, j] = number_of(self.pose[i, j], known)
        return T

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<DirectModelExplanation of {self.robot}: pose of {self.frame} in the world>"

    def _repr_markdown_(self) -> str:
        """What a notebook shows."""
        return markdown(self.latex)

    def _repr_latex_(self) -> str:
        """What a notebook that becomes a LaTeX document shows."""
        return self.latex
