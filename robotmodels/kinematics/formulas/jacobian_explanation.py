"""What `explain_jacobian` returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import se3
from ..._arrays import as_vector, read_only
from ...latex_text import markdown
from ..factors import JacobianFactors
from ._numbers import FormulaNumbers


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JacobianExplanation:
    """The three matrices of the Jacobian as formulas, made by `explain_jacobian`.

    Printing it shows them; the expressions are SymPy's.

    Parameters
    ----------
    robot, frame : str
        Names of the robot and of the frame whose Jacobian it is.
    projection, intermediate : str
        Names of the frames i and j, such as ``"R_3"`` and ``"R_4"``.
    rotation : sympy.ImmutableDenseMatrix, shape (3, 3)
        Axes of R_i in the world.
    lever : sympy.ImmutableDenseMatrix, shape (3, 1)
        From the origin of R_j to that of the frame, in the axes of R_i, metres.
    reduced : sympy.ImmutableDenseMatrix, shape (6, n)
        The third matrix, rows ``[v; w]``.
    numbers : FormulaNumbers
        Variables, abbreviations and the constants of this robot.
    text, latex : str
        All of it for people.

    Examples
    --------
    >>> from robotmodels.kinematics.formulas.explain_jacobian import explain_jacobian
    >>> from robotmodels.robots import load
    >>> J = explain_jacobian(load("rx90"), 3, 4)
    >>> J.reduced[2, 0], J.reduced[3:, 4].T
    (-C2*D3 + RL4*S23, Matrix([[S4, 0, C4]]))
    """

    robot: str
    frame: str
    projection: str
    intermediate: str
    rotation: Any
    lever: Any
    reduced: Any
    numbers: FormulaNumbers
    text: str
    latex: str

    @property
    def first(self) -> Any:
        """The first matrix, ``diag(R_i, R_i)``, 6 by 6 expressions."""
        import sympy

        return sympy.ImmutableDenseMatrix(sympy.diag(self.rotation, self.rotation))

    @property
    def second(self) -> Any:
        """The second matrix, ``[1, -[L]x; 0, 1]``, 6 by 6 expressions."""
        import sympy

        x, y, z = self.lever
        out = sympy.eye(6)
        out[:3, 3:] = sympy.Matrix([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        return sympy.ImmutableDenseMatrix(out)

    def evaluate(self, q: ArrayLike) -> JacobianFactors:
        """The formulas in numbers, with the constants of this robot: equal to `jacobian_factors`.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables in table order, rad or m.

        Returns
        -------
        JacobianFactors
            The three matrices; ``.jacobian`` is their product.

        Raises
        ------
        ShapeError, InvalidValueError
            ``q`` of the wrong length, or with NaN or infinity.

        Examples
        --------
        >>> from robotmodels.kinematics import jacobian
        >>> from robotmodels.kinematics.formulas.explain_jacobian import explain_jacobian
        >>> from robotmodels.robots import load
        >>> rx90, q = load("rx90"), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
        >>> J = explain_jacobian(rx90).evaluate(q).jacobian
        >>> np.allclose(J, jacobian(rx90, q), atol=1e-14)
        True
        """
        q = as_vector(q, len(self.numbers.variables), "q")
        R = self.numbers.matrix(self.rotation, q)
        rotation = np.zeros((*q.shape[:-1], 6, 6))
        rotation[..., :3, :3] = rotation[..., 3:, 3:] = R
        transport = np.zeros((*q.shape[:-1], 6, 6))
        transport[..., range(6), range(6)] = 1.0
        transport[..., :3, 3:] = -se3.skew(self.numbers.matrix(self.lever, q)[..., 0])
        return JacobianFactors(
            rotation=read_only(rotation),
            transport=read_only(transport),
            reduced=read_only(self.numbers.matrix(self.reduced, q)),
            projection=self.projection,
            intermediate=self.intermediate,
        )

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return (
            f"<JacobianExplanation of {self.robot}: projection {self.projection}, intermediate "
            f"frame {self.intermediate}>"
        )

    def _repr_markdown_(self) -> str:
        """What a notebook shows."""
        return markdown(self.latex)

    def _repr_latex_(self) -> str:
        """What a notebook that becomes a LaTeX document shows."""
        return self.latex
