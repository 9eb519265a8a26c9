"""The table of geometric parameters of Khalil and Kleinfinger.

Book section 1.2.1, eq. [1.2] and [1.3]; W. Khalil and J.-F. Kleinfinger, "A new geometric
notation for open and closed-loop robots", IEEE ICRA 1986, for trees (gamma, b); S. Hayati,
"Robot arm geometric link parameter estimation", IEEE CDC 1983, for beta.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import LARGEST, Array, as_bounded, as_exact, read_only, same_value, value_hash
from ..errors import TableError
from ..table_text import SMALLEST, angle_text, boxed, length_text, variable_text
from .columns import check_structure, checked_limits, whole_numbers
from .joint_kinds import FIXED, PRISMATIC
from .names import checked_names, checked_symbols, default_names
from .rows import columns_of_rows, rows_of_standard, unknown_name


@dataclass(frozen=True, slots=True, init=False, eq=False, repr=False)
class DHTable:
    """Geometric parameters of a serial or tree structure in Khalil-Kleinfinger form.

    Also called modified or proximal Denavit-Hartenberg parameters. Row ``j`` places frame
    ``R_j`` in the frame of its antecedent ``a(j)``::

        T(a(j), j) = Rot(z, gamma_j) Trans(z, b_j) Rot(y, beta_j) Rot(x, alpha_j)
                     Trans(x, d_j) Rot(z, theta_j) Trans(z, r_j)

    The column of the joint's own variable (``theta`` if revolute, ``r`` if prismatic) holds an
    offset to which ``q_j`` is added, so ``q = 0`` is the table as printed. `from_rows` is the
    usual way to write one down.

    Parameters
    ----------
    antecedent : array_like of int, shape (f,)
        Number of the frame that row j stands on: 0 is the base, always less than j.
    sigma : array_like of int, shape (f,)
        0 revolute, 1 prismatic, 2 fixed frame.
    mu : array_like of int, shape (f,), optional
        1 actuated, 0 passive; all 1 by default. Fixed frames are not actuated: always 0.
    gamma, beta, alpha, theta, b, d, r : array_like, shape (f,), optional
        Radians and metres, default 0.
    names : sequence of str, length f, optional
        Names of the frames; default ``joint_1``, ``joint_2``, ... (``frame_j`` for fixed frames).
    lower, upper : array_like, shape (n,), optional
        Limits of the joint variables in radians or metres, default minus and plus infinity.
    velocity, effort : array_like, shape (n,), optional
        Largest speed (rad/s, m/s) and torque or force (N m, N), default infinity.
    symbols : mapping of (str, int) to str, optional
        Names of geometric constants by column and row number, such as ``{("d", 3): "L1"}``: the
        table prints them beside their numbers, and formulas use them.

    Raises
    ------
    TableError
        Antecedents that do not come before their successors (a loop), unknown joint types,
        limits the wrong way round, repeated names.
    ShapeError, InvalidValueError
        Columns of different lengths; NaN anywhere, infinity in a geometric column.
    """

    antecedent: NDArray[np.int64]
    sigma: NDArray[np.int64]
    mu: NDArray[np.int64]
    gamma: Array
    b: Array
    beta: Array
    alpha: Array
    d: Array
    theta: Array
    r: Array
    names: tuple[str, ...]
    lower: Array
    upper: Array
    velocity: Array
    effort: Array
    symbols: Mapping[tuple[str, int], str]

    def __init__(
        self,
        antecedent: ArrayLike,
        sigma: ArrayLike,
        mu: ArrayLike | None = None,
        gamma: ArrayLike | None = None,
        b: ArrayLike | None = None,
        beta: ArrayLike | None = None,
        alpha: ArrayLike | None = None,
        d: ArrayLike | None = None,
        theta: ArrayLike | None = None,
        r: ArrayLike | None = None,
        names: Sequence[str] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        effort: ArrayLike | None = None,
        symbols: Mapping[tuple[str, int], str] | None = None,
    ) -> None:
        ancestors = whole_numbers(antecedent, "antecedent")
        f = ancestors.size
        if not f:
            raise TableError("a table needs at least one row, got none.")
        kinds = whole_numbers(sigma, "sigma", f)
        check_structure(ancestors, kinds)
        moving = kinds != FIXED
        n = int(moving.sum())
        actuated = moving.astype(np.int64) if mu is None else whole_numbers(mu, "mu", f)
        if not np.isin(actuated, (0, 1)).all():
            raise TableError(f"mu: expected 1 (actuated) or 0 (passive), got {actuated.tolist()}.")
        values: dict[str, NDArray[Any]] = {
            "antecedent": ancestors,
            "sigma": kinds,
            "mu": np.where(moving, actuated, 0),
        }
        geometric = {
            "gamma": gamma, "b": b, "beta": beta, "alpha": alpha, "d": d, "theta": theta, "r": r,
        }  # fmt: skip
        for column, given in geometric.items():
            exact = np.zeros(f) if given is None else as_exact(given, (f,), column)
            values[column] = as_bounded(exact, column, LARGEST)
        values |= checked_limits(
            {"lower": lower, "upper": upper, "velocity": velocity, "effort": effort}, n
        )
        labels = default_names(kinds) if names is None else checked_names(names, f)
        object.__setattr__(self, "names", labels)
        object.__setattr__(self, "symbols", checked_symbols(symbols, f))
        for key, value in values.items():
            object.__setattr__(self, key, read_only(value, value.dtype.type))

    @classmethod
    def from_rows(cls, rows: Iterable[Mapping[str, Any]], degrees: bool = False) -> Self:
        """Build a table from one mapping per row.

        Parameters
        ----------
        rows : iterable of mappings
            Keys ``sigma, alpha, d, theta, r``; optionally ``antecedent`` (default: the row
            before), ``mu, gamma, b, beta, name, lower, upper, velocity, effort``. Missing keys
            are 0, missing limits infinite.
        degrees : bool
            Whether the angles (and the limits and velocities of revolute joints) are in degrees.

        Examples
        --------
        >>> t = DHTable.from_rows([{"sigma": 0}, {"sigma": 0, "alpha": 90, "d": 0.1}], degrees=True)
        >>> round(float(t.alpha[1]), 6)
        1.570796
        """
        return cls(**columns_of_rows(rows, degrees))

    @classmethod
    def from_standard(
        cls, rows: Iterable[Mapping[str, Any]], degrees: bool = False
    ) -> tuple[Self, Array]:
        """Build a table from classical (standard, distal) Denavit-Hartenberg rows.

        A classical row is ``Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha)``; its last two
        factors belong to the next row here, and those of the last row to the tool.

        Parameters
        ----------
        rows : iterable of mappings
            Keys ``theta, d, a, alpha``, optionally ``sigma``, ``offset`` (added to the joint
            variable), ``name`` and limits. Missing keys are 0.
        degrees : bool
            Whether angles, offsets of revolute joints and their limits are in degrees.

        Returns
        -------
        table : DHTable
            The equivalent Khalil-Kleinfinger table with the same joint variables.
        tool : ndarray, shape (4, 4)
            ``Trans(x, a_n) Rot(x, alpha_n)``, to be given to the model as its tool.

        Examples
        --------
        >>> table, tool = DHTable.from_standard([{"a": 0.4}, {"a": 0.3}])
        >>> float(table.d[1]), float(tool[0, 3])
        (0.4, 0.3)
        """
        ours, tool = rows_of_standard(rows, degrees)
        return cls.from_rows(ours, degrees=degrees), tool

    @property
    def f(self) -> int:
        """Number of frames (rows)."""
        return self.antecedent.size

    @property
    def n(self) -> int:
        """Number of moving joints."""
        return self.lower.size

    @property
    def joint_rows(self) -> NDArray[np.int64]:
        """Index (from 0) of the row of each moving joint, shape (n,)."""
        return np.flatnonzero(self.sigma != FIXED)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the moving joints, length n."""
        return tuple(self.names[i] for i in self.joint_rows)

    @property
    def is_serial(self) -> bool:
        """Whether every row stands on the row before it."""
        return bool((self.antecedent == np.arange(self.f)).all())

    def path(self, frame: int) -> list[int]:
        """Numbers of the frames from the base to one frame, 1..f (0: none), ascending."""
        path = []
        while frame > 0:
            path.append(frame)
            frame = int(self.antecedent[frame - 1])
        return path[::-1]

    def replace(self, **columns: ArrayLike | Sequence[str]) -> Self:
        """The same table with some columns changed, named and shaped as in the constructor."""
        known = [field.name for field in fields(self)]
        for column in columns:
            if column not in known:
                raise TableError(unknown_name("column", column, known))
        if "symbols" not in columns:  # a new number is no longer the one that had the name
            kept = {key: name for key, name in self.symbols.items() if key[0] not in columns}
            columns["symbols"] = kept  # type: ignore[assignment]
        return replace(self, **columns)  # type: ignore[arg-type]

    def __str__(self) -> str:
        # columns that hold only zeros are left out, as in the book's tables of serial robots
        rows = range(self.f)
        columns = [("j", [str(j + 1) for j in rows])]
        if not self.is_serial:
            columns.append(("a(j)", [str(a) for a in self.antecedent]))
        columns.append(("σj", [str(s) for s in self.sigma]))
        if (self.mu != (self.sigma != FIXED)).any():
            columns.append(("μj", [str(m) for m in self.mu]))
        if _shows(self.gamma) or _shows(self.b):
            columns.append(("γj", [self._text("gamma", j) for j in rows]))
            columns.append(("bj", [self._text("b", j) for j in rows]))
        if _shows(self.beta):
            columns.append(("βj", [self._text("beta", j) for j in rows]))
        columns.append(("αj", [self._text("alpha", j) for j in rows]))
        columns.append(("dj", [self._text("d", j) for j in rows]))
        columns.append(("θj", [self._own_text(j, "θ") for j in rows]))
        columns.append(("rj", [self._own_text(j, "r") for j in rows]))
        return boxed(columns)

    def _text(self, column: str, row: int, size: bool = False) -> str:
        """A constant, or its absolute value, with its symbol in brackets."""
        value = float(getattr(self, column)[row])
        text = length_text if column in ("b", "d", "r") else angle_text
        symbol = self.symbols.get((column, row + 1))
        return text(abs(value) if size else value) + (f" ({symbol})" if symbol else "")

    def _own_text(self, row: int, symbol: str) -> str:
        """Cell of the theta or r column: a constant, or the variable with its offset."""
        column = "theta" if symbol == "θ" else "r"
        variable = "r" if self.sigma[row] == PRISMATIC else "θ"
        if self.sigma[row] == FIXED or symbol != variable:
            return self._text(column, row)
        offset = self._text(column, row, size=True)
        return variable_text(symbol, row + 1, offset, getattr(self, column)[row] < 0)

    def __repr__(self) -> str:
        return f"<DHTable: {self.f} frames, {self.n} joints>\n{self}"

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), (*self._values, dict(self.symbols))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DHTable):
            return NotImplemented
        return all(same_value(a, b) for a, b in zip(self._values, other._values, strict=True))

    def __hash__(self) -> int:
        return value_hash(*self._values)

    @property
    def _values(self) -> tuple[Any, ...]:
        """All fields but the symbols: tables of the same numbers are equal."""
        return tuple(getattr(self, field.name) for field in fields(self)[:-1])


def _shows(column: Array) -> bool:
    return bool((np.abs(column) >= SMALLEST).any())
