"""The geometric description: the Khalil-Kleinfinger table and the transforms it stands for.

Seed book section 1.2.1, eq. [1.2] and [1.3]; W. Khalil and J.-F. Kleinfinger, "A new geometric
notation for open and closed-loop robots", IEEE ICRA 1986, for trees (gamma, b); S. Hayati,
"Robot arm geometric link parameter estimation", IEEE CDC 1983, for beta.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import pi
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import se3
from ._arrays import (
    Array,
    as_exact,
    as_floats,
    as_reals,
    as_vector,
    read_only,
    same_value,
    value_hash,
)
from .errors import InvalidValueError, RobotModelsWarning, ShapeError, TableError, nearest_names
from .table_text import SMALLEST, angle_text, boxed, length_text, variable_text

REVOLUTE, PRISMATIC, FIXED = 0, 1, 2
"""Values of sigma, seed eq. [1.2]; 2 marks a frame that is fixed to its antecedent."""

NOT_XML = re.compile("[\x00-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that an XML attribute cannot hold or does not keep: names must do without them."""

_ANGLES = ("gamma", "beta", "alpha", "theta")
_LENGTHS = ("b", "d", "r")
_LIMITS = ("lower", "upper", "velocity", "effort")
_ROW_KEYS = ("antecedent", "sigma", "mu", *_ANGLES, *_LENGTHS, *_LIMITS, "name")
_STANDARD_KEYS = ("theta", "d", "a", "alpha", "sigma", "offset", *_LIMITS, "name")


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
    gamma, beta, alpha, theta : array_like, shape (f,), optional
        Radians, default 0.
    b, d, r : array_like, shape (f,), optional
        Metres, default 0.
    names : sequence of str, length f, optional
        Names of the frames; default ``joint_1``, ``joint_2``, ... (``frame_j`` for fixed frames).
    lower, upper : array_like, shape (n,), optional
        Limits of the joint variables in radians or metres, default minus and plus infinity.
    velocity, effort : array_like, shape (n,), optional
        Largest speed (rad/s, m/s) and torque or force (N m, N), default infinity.

    Raises
    ------
    TableError
        Antecedents that do not come before their successors (a loop), unknown joint types,
        limits the wrong way round, repeated names.
    ShapeError, InvalidValueError
        Columns of different lengths; NaN anywhere, infinity in a geometric column.

    References
    ----------
    Seed book section 1.2.1, eq. [1.2], [1.3] and Table 1.1.

    Examples
    --------
    >>> arm = DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3])
    >>> arm.n, arm.names
    (2, ('joint_1', 'joint_2'))
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
    ) -> None:
        ancestors = _integers(antecedent, "antecedent")
        f = ancestors.size
        if not f:
            raise TableError("a table needs at least one row, got none.")
        kinds = _integers(sigma, "sigma", f)
        _check_structure(ancestors, kinds)
        moving = kinds != FIXED
        n = int(moving.sum())
        actuated = moving.astype(np.int64) if mu is None else _integers(mu, "mu", f)
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
            values[column] = np.zeros(f) if given is None else as_exact(given, (f,), column)
        values |= _checked_limits(
            {"lower": lower, "upper": upper, "velocity": velocity, "effort": effort}, n
        )
        labels = _default_names(kinds) if names is None else _labels(names)
        _check_names(labels, f)
        object.__setattr__(self, "names", labels)
        for key, value in values.items():
            object.__setattr__(self, key, read_only(value, value.dtype.type))

    @classmethod
    def from_rows(cls, rows: Iterable[Mapping[str, Any]], degrees: bool = False) -> Self:
        """Build a table from one mapping per row.

        Parameters
        ----------
        rows : iterable of mappings
            Keys ``sigma, alpha, d, theta, r``; optionally ``antecedent`` (default: the row
            before), ``mu, gamma, b, beta, name, lower, upper, velocity, effort``. What is missing
            is 0, a missing limit is infinite.
        degrees : bool
            Whether the angles (and the limits and velocities of revolute joints) are in degrees.

        Returns
        -------
        DHTable
            The table, in radians.

        Raises
        ------
        TableError
            An unknown key (the nearest known ones are named), or as the constructor.

        Examples
        --------
        >>> t = DHTable.from_rows([{"sigma": 0}, {"sigma": 0, "alpha": 90, "d": 0.1}], degrees=True)
        >>> round(float(t.alpha[1]), 6)
        1.570796
        """
        rows = _checked_rows(rows, _ROW_KEYS)
        sigma = [row.get("sigma", 0) for row in rows]
        columns: dict[str, Any] = {
            "antecedent": [row.get("antecedent", j) for j, row in enumerate(rows)],
            "sigma": sigma,
            "mu": [row.get("mu", 1) for row in rows],
        }
        for key in (*_ANGLES, *_LENGTHS):
            column = as_floats([row.get(key, 0.0) for row in rows], key)
            columns[key] = np.deg2rad(column) if degrees and key in _ANGLES else column
            if (
                key in ("gamma", "beta", "alpha")
                and not degrees
                and (np.abs(column) > 2 * pi).any()
            ):
                warnings.warn(
                    f"{key} holds {column.tolist()}, more than a turn in radians: if these are "
                    "degrees, pass degrees=True.",
                    RobotModelsWarning,
                    stacklevel=2,
                )
        columns |= _limits_of_rows(rows, sigma, degrees)
        columns["names"] = _names_of_rows(rows, sigma)
        return cls(**columns)

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
            variable), ``name`` and limits. What is missing is 0.
        degrees : bool
            Whether angles, offsets of revolute joints and their limits are in degrees.

        Returns
        -------
        table : DHTable
            The equivalent Khalil-Kleinfinger table with the same joint variables.
        tool : ndarray, shape (4, 4)
            ``Trans(x, a_n) Rot(x, alpha_n)``, to be given to the model as its tool.

        Raises
        ------
        TableError, InvalidValueError
            As `from_rows`.

        References
        ----------
        P. I. Corke, *Robotics, Vision and Control*, section 7.1, for the classical convention.

        Examples
        --------
        >>> table, tool = DHTable.from_standard([{"a": 0.4}, {"a": 0.3}])
        >>> float(table.d[1]), float(tool[0, 3])
        (0.4, 0.3)
        """
        rows = _checked_rows(rows, _STANDARD_KEYS)
        ours: list[dict[str, Any]] = []
        d, alpha = 0.0, 0.0
        for row in rows:
            row = dict(row)
            offset = row.pop("offset", 0.0)
            own = "r" if row.get("sigma", 0) == PRISMATIC else "theta"
            next_d, next_alpha = row.pop("a", 0.0), row.pop("alpha", 0.0)
            row["r"] = row.pop("d", 0.0)
            row[own] = row.get(own, 0.0) + offset
            ours.append({**row, "d": d, "alpha": alpha})
            d, alpha = next_d, next_alpha
        angle = np.deg2rad(alpha) if degrees else alpha
        d, angle = as_floats([d, angle], "the last row's a and alpha")
        tool = se3.translation(d, 0.0, 0.0) @ se3.rotation("x", angle)
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
        """Numbers of the frames from the base to one frame, that frame included.

        Parameters
        ----------
        frame : int
            Frame number 1..f; 0, the base, has an empty path.

        Returns
        -------
        list of int
            Frame numbers, ascending.

        Examples
        --------
        >>> DHTable(antecedent=[0, 1, 1], sigma=[0, 0, 0]).path(3)
        [1, 3]
        """
        path = []
        while frame > 0:
            path.append(frame)
            frame = int(self.antecedent[frame - 1])
        return path[::-1]

    def replace(self, **columns: ArrayLike | Sequence[str]) -> Self:
        """The same table with some columns changed.

        Parameters
        ----------
        **columns : array_like
            Fields of the table by name, shapes as in the constructor.

        Returns
        -------
        DHTable
            A new table.

        Raises
        ------
        TableError
            An unknown column, or as the constructor.

        Examples
        --------
        >>> DHTable(antecedent=[0], sigma=[0]).replace(r=[0.2]).r
        array([0.2])
        """
        known = [field.name for field in fields(self)]
        for column in columns:
            if column not in known:
                raise TableError(_unknown("column", column, known))
        return replace(self, **columns)  # type: ignore[arg-type]

    def __str__(self) -> str:
        # columns that say nothing are left out, as in the book's tables of serial robots
        rows = range(self.f)
        columns = [("j", [str(j + 1) for j in rows])]
        if not self.is_serial:
            columns.append(("a(j)", [str(a) for a in self.antecedent]))
        columns.append(("σj", [str(s) for s in self.sigma]))
        if (self.mu != (self.sigma != FIXED)).any():
            columns.append(("μj", [str(m) for m in self.mu]))
        if _shows(self.gamma) or _shows(self.b):
            columns.append(("γj", [angle_text(v) for v in self.gamma]))
            columns.append(("bj", [length_text(v) for v in self.b]))
        if _shows(self.beta):
            columns.append(("βj", [angle_text(v) for v in self.beta]))
        columns.append(("αj", [angle_text(v) for v in self.alpha]))
        columns.append(("dj", [length_text(v) for v in self.d]))
        columns.append(("θj", [self._own_text(j, "θ") for j in rows]))
        columns.append(("rj", [self._own_text(j, "r") for j in rows]))
        return boxed(columns)

    def _own_text(self, row: int, symbol: str) -> str:
        """Cell of the theta or r column: a constant, or the variable with its offset."""
        offset = float(self.theta[row] if symbol == "θ" else self.r[row])
        text = angle_text if symbol == "θ" else length_text
        variable = "r" if self.sigma[row] == PRISMATIC else "θ"
        if self.sigma[row] == FIXED or symbol != variable:
            return text(offset)
        return variable_text(symbol, row + 1, text(abs(offset)), offset < 0)

    def __repr__(self) -> str:
        return f"<DHTable: {self.f} frames, {self.n} joints>\n{self}"

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DHTable):
            return NotImplemented
        return all(
            same_value(getattr(self, field.name), getattr(other, field.name))
            for field in fields(self)
        )

    def __hash__(self) -> int:
        return value_hash(*(getattr(self, field.name) for field in fields(self)))


def constant_factors(table: DHTable) -> Array:
    """The constant part ``C_j`` of each factor: ``T(a(j), j) = C_j Motion(q_j)``.

    The motion (rotation about or translation along z) commutes with ``Rot(z, theta)
    Trans(z, r)``, so everything that does not depend on ``q`` stands on its left.

    Parameters
    ----------
    table : DHTable
        The table.

    Returns
    -------
    ndarray, shape (f, 4, 4)
        ``T(a(j), j)`` at ``q = 0``.

    Examples
    --------
    >>> constant_factors(DHTable(antecedent=[0], sigma=[0], r=[0.2]))[0, 2, 3]
    np.float64(0.2)
    """
    C = np.empty((table.f, 4, 4))
    for j in range(table.f):
        C[j] = (
            se3.rotation("z", float(table.gamma[j]))
            @ se3.translation(0.0, 0.0, table.b[j])
            @ se3.rotation("y", float(table.beta[j]))
            @ se3.rotation("x", float(table.alpha[j]))
            @ se3.translation(table.d[j], 0.0, 0.0)
            @ se3.rotation("z", float(table.theta[j]))
            @ se3.translation(0.0, 0.0, table.r[j])
        )
    return C


def link_transforms(table: DHTable, q: ArrayLike) -> Array:
    """The factors ``T(a(j), j)`` of the direct geometric model, straight from the table.

    Plain NumPy, no Pinocchio and no compiled code: the oracle that the fast paths are held to.

    Parameters
    ----------
    table : DHTable
        The geometric parameters.
    q : array_like, shape (..., n)
        Joint variables in table order, radians or metres.

    Returns
    -------
    ndarray, shape (..., f, 4, 4)
        One factor per row; their product along a branch is the pose of its last frame in R_0.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` has the wrong length, or holds NaN or infinity.

    References
    ----------
    Seed book eq. [1.3].

    Examples
    --------
    >>> table = DHTable.from_rows([{"sigma": 0}, {"sigma": 1, "r": 0.1}])
    >>> link_transforms(table, [0.0, 0.2])[1, 2, 3].round(12)
    np.float64(0.3)
    """
    if not isinstance(table, DHTable):
        hint = "; pass model.table" if hasattr(table, "table") else ""
        raise InvalidValueError(f"table: expected a DHTable, got {type(table).__name__}{hint}.")
    q = as_vector(q, table.n, "q")
    theta = np.broadcast_to(table.theta, (*q.shape[:-1], table.f)).copy()
    r = np.broadcast_to(table.r, theta.shape).copy()
    for i, row in enumerate(table.joint_rows):
        own = r if table.sigma[row] == PRISMATIC else theta
        own[..., row] += q[..., i]
    # left factor: everything up to Trans(x, d); right factor: Rot(z, theta) Trans(z, r)
    left = constant_factors(table.replace(theta=np.zeros(table.f), r=np.zeros(table.f)))
    c, s = np.cos(theta), np.sin(theta)
    T = np.zeros((*theta.shape, 4, 4))
    T[..., :3, 0] = c[..., None] * left[:, :3, 0] + s[..., None] * left[:, :3, 1]
    T[..., :3, 1] = -s[..., None] * left[:, :3, 0] + c[..., None] * left[:, :3, 1]
    T[..., :3, 2] = left[:, :3, 2]
    T[..., :3, 3] = left[:, :3, 3] + r[..., None] * left[:, :3, 2]
    T[..., 3, 3] = 1.0
    return T


def _shows(column: Array) -> bool:
    return bool((np.abs(column) >= SMALLEST).any())


def _integers(value: ArrayLike, name: str, size: int | None = None) -> NDArray[np.int64]:
    array = as_floats(value, name)
    if array.ndim != 1 or (size is not None and array.size != size):
        wanted = "one number per row" if size is None else f"{size} numbers"
        raise ShapeError(f"{name}: expected {wanted}, got an array of shape {array.shape}.")
    if (array != np.round(array)).any():
        raise TableError(f"{name}: expected whole numbers, got {array.tolist()}.")
    return array.astype(np.int64)


def _check_structure(antecedent: NDArray[np.int64], sigma: NDArray[np.int64]) -> None:
    for j, (a, s) in enumerate(zip(antecedent.tolist(), sigma.tolist(), strict=True), start=1):
        if not 0 <= a < j:
            raise TableError(
                f"Row {j} stands on frame {a}: an antecedent must be 0 (the base) or the number "
                f"of an earlier row, at most {j - 1}. A loop of antecedents has no base; number "
                "the frames from the base outwards."
            )
        if s not in (REVOLUTE, PRISMATIC, FIXED):
            raise TableError(
                f"Row {j}: sigma is 0 (revolute), 1 (prismatic) or 2 (fixed frame), got {s}."
            )


def _checked_limits(given: Mapping[str, Any], n: int) -> dict[str, Array]:
    limits = {}
    for key, default in (("lower", -np.inf), ("upper", np.inf), ("velocity", np.inf),
                         ("effort", np.inf)):  # fmt: skip
        value = given[key]
        array = np.full(n, default) if value is None else as_reals(value, key)
        if array.shape != (n,):
            raise ShapeError(
                f"{key}: expected one value for each of the {n} moving joints, shape ({n},), "
                f"got {array.shape}."
            )
        if np.isnan(array).any():
            raise InvalidValueError(f"{key}: NaN; leave the limit out or use infinity.")
        limits[key] = array
    if (limits["lower"] == np.inf).any() or (limits["upper"] == -np.inf).any():
        raise TableError(
            "a lower limit of +infinity, or an upper one of -infinity, leaves no room."
        )
    wrong = np.flatnonzero(~(limits["lower"] <= limits["upper"]))
    if wrong.size:
        i = int(wrong[0])
        raise TableError(
            f"Joint {i + 1}: the lower limit {limits['lower'][i]} is above the upper limit "
            f"{limits['upper'][i]}; exchange them."
        )
    for key in ("velocity", "effort"):
        if (limits[key] < 0).any():
            raise TableError(f"{key}: limits are magnitudes, got {limits[key].tolist()}.")
    return limits


def _default_names(sigma: NDArray[np.int64]) -> tuple[str, ...]:
    return tuple(f"{'frame' if s == FIXED else 'joint'}_{j}" for j, s in enumerate(sigma, start=1))


def _labels(names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise TableError(f"names: expected a list of names, one for each row, got {names!r:.80}.")
    return tuple(map(str, names))


def _check_names(names: tuple[str, ...], f: int) -> None:
    if len(names) != f:
        raise ShapeError(f"names: expected one name for each of the {f} rows, got {len(names)}.")
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated or not all(names):
        raise TableError(
            f"names: each frame needs a name of its own, got {', '.join(map(repr, repeated))} "
            "more than once."
            if repeated
            else "names: a frame has an empty name."
        )
    for name in names:
        if NOT_XML.search(name):
            raise TableError(f"names: {name!r} holds a control character; a URDF cannot hold it.")


def _checked_rows(
    rows: Iterable[Mapping[str, Any]], known: Sequence[str]
) -> list[Mapping[str, Any]]:
    if not isinstance(rows, Iterable):
        raise TableError(f"rows: expected a list with a mapping per row, got {rows!r:.80}.")
    listed = list(rows)
    for j, row in enumerate(listed, start=1):
        if not isinstance(row, Mapping):
            raise TableError(f"Row {j}: expected a mapping such as {{'sigma': 0, 'd': 0.1}}, got "
                             f"{type(row).__name__}.")  # fmt: skip
        for key, value in row.items():
            if key not in known:
                raise TableError(f"Row {j}: " + _unknown("key", str(key), known))
            if key != "name" and as_reals(value, f"Row {j}: {key}").ndim:
                raise InvalidValueError(f"Row {j}: {key} must be one number, got {value!r:.80}.")
    return listed


def _unknown(kind: str, name: str, known: Sequence[str]) -> str:
    near = nearest_names(name, known)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return f"unknown {kind} {name!r}.{hint} Known: {', '.join(known)}."


def _names_of_rows(rows: Sequence[Mapping[str, Any]], sigma: Sequence[int]) -> tuple[str, ...]:
    defaults = _default_names(np.asarray(sigma))
    return tuple(str(row.get("name", d)) for row, d in zip(rows, defaults, strict=True))


def _limits_of_rows(
    rows: Sequence[Mapping[str, Any]], sigma: Sequence[int], degrees: bool
) -> dict[str, list[float]]:
    limits: dict[str, list[float]] = {key: [] for key in _LIMITS}
    for j, (row, s) in enumerate(zip(rows, sigma, strict=True), start=1):
        if s == FIXED:
            given = [key for key in _LIMITS if key in row]
            if given:
                raise TableError(f"Row {j}: a fixed frame has no limits, got {', '.join(given)}.")
            continue
        for key in _LIMITS:
            default = -np.inf if key == "lower" else np.inf
            value = row.get(key, default)
            scale = pi / 180 if degrees and s == REVOLUTE and key != "effort" else 1.0
            limits[key].append(float(value) * scale)
    return limits
