"""Flexible robots: a rigid model with some of its links and joints made elastic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Value, as_count, as_each, read_only
from .._choices import as_instance
from ..errors import InvalidValueError
from ..kernels import Chain
from ..model import RobotModel, check_model
from .link import FlexibleLink


class Arm(NamedTuple):
    """An elastic chain in arrays; body k has the modes ``start[k]`` to ``start[k + 1]``.

    pi (f, 10), first (m, 18): J_k, a, b, tip's Phi, Psi; second (m, 18 most), 18 for each other
    mode of its body: J_kl, A, B, Gamma of the tip, m_kl, K_kl, D_kl.
    """

    chain: Chain  # positions from the undeformed tips of the antecedents
    pi: Array
    start: NDArray[np.int64]
    tip: Array
    first: Array
    second: Array
    drive: Array  # (n, 6): Ia, Fv, Fc, offset, stiffness and damping of the joint if flexible
    deflection: NDArray[np.int64]  # (n,), index of the deflection of the joint; -1 if rigid
    tool: Array  # (3,), from the undeformed tip of row `end`
    gravity: Array
    end: int


class Parts(NamedTuple):
    """Arrays of an arm; K, D (n + m, n + m) are elastic stiffness and all viscous damping."""

    chain: Arm
    bare: Arm
    """The chain without gravity and elasticity."""
    K: Array
    D: Array
    free: NDArray[np.int64]
    """Rows of flags (n + 3,) for loads, the inverse and the direct model."""


@dataclass(frozen=True, slots=True, eq=False)
class FlexibleRobot(Value):
    """A robot with flexible links and joints. Immutable, picklable.

    Its coordinates are q (n,), the angles of the motors, and e (m,): the modes of the flexible
    links by row, then the deflections of the flexible joints. The tip section of a flexible link
    carries the next bodies; where the last link is flexible and the model has no tool, the tool is
    the end of the beam. Trees are supported; prismatic flexible links and coupled motors are
    refused.

    Parameters
    ----------
    model : RobotModel
        The rigid robot, n joints, with its drives; independent motors.
    links : mapping of int to FlexibleLink
        By row of the table, from 1. A flexible link's inertia replaces that of the row.
    joint_stiffness, joint_damping : array_like, shape (n,) or (), optional
        N m/rad, infinite (default) for rigid joints, and N m s/rad of the deflections of flexible
        ones. The motor side has the rotor inertia Ia.
    modal_damping : array_like, shape () or that of all modes, optional
        Damping ratios of the modes of the clamped links.

    Examples
    --------
    >>> from robotmodels.flexible import beam
    >>> from robotmodels.geometry import DHTable
    >>> model = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]))
    >>> FlexibleRobot(model, {1: beam(0.5, EI=(np.inf, 1.0)), 2: beam(0.5, EI=1.0)}).m
    6
    """

    model: RobotModel
    links: Mapping[int, FlexibleLink]
    joint_stiffness: Array | None = None
    joint_damping: Array | None = None
    modal_damping: Array | None = None
    joints: NDArray[np.int64] = field(init=False)
    """Columns of the flexible joints."""
    modes: int = field(init=False)
    """Number of modes of the links: the first entries of e."""
    _parts: Any = field(default=None, init=False)

    def __post_init__(self) -> None:
        check_model(self.model)
        model = self.model
        links = _checked_links(model, self.links)
        n, modes = model.n, sum(link.m for link in links.values())
        stiffness = as_each(self.joint_stiffness, n, "joint_stiffness", above=0.0, default=np.inf)
        joints = np.flatnonzero(np.isfinite(stiffness))
        damping, modal = (
            as_each(getattr(self, name), count, name, least=0.0, finite=True, default=0.0)
            for name, count in (("joint_damping", n), ("modal_damping", modes))
        )
        drives = model.drive_matrices
        coupled = drives is not None and (
            drives.coupling.size or (drives.rotor != np.diag(np.diag(drives.rotor))).any()
        )
        if coupled or (model.transmission is not None and not model.transmission.is_invertible):
            raise InvalidValueError(
                "model: its transmission couples motors; take model.with_transmission(None)."
            )
        for name, value in {
            "links": MappingProxyType(links),
            "modes": modes,
            "joint_stiffness": read_only(stiffness),
            "joint_damping": read_only(damping),
            "modal_damping": read_only(modal),
            "joints": read_only(joints, np.int64),
        }.items():
            object.__setattr__(self, name, value)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.model.n

    @property
    def m(self) -> int:
        """Number of elastic coordinates: modes and deflections of joints."""
        return self.modes + len(self.joints)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the elastic coordinates."""
        modes = [
            f"link {row} mode {k + 1}" for row, link in self.links.items() for k in range(link.m)
        ]
        return (*modes, *(f"joint {column + 1}" for column in self.joints))

    @property
    def parts(self) -> Parts:
        """Arrays for the compiled recursion and the linear models."""
        if self._parts is None:
            object.__setattr__(self, "_parts", _parts_of(self))
        return self._parts  # type: ignore[return-value]

    @property
    def _values(self) -> tuple[Any, ...]:
        damping = self.joint_stiffness, self.joint_damping, self.modal_damping
        return (self.model, tuple(self.links.items()), *damping)

    def __reduce__(self) -> tuple[Any, ...]:
        model, links, *rest = self._values
        return type(self), (model, dict(links), *rest)

    def __repr__(self) -> str:
        rows = ", ".join(map(str, self.links)) or "none"
        return (
            f"<FlexibleRobot {self.model.name!r}: n = {self.n}, m = {self.m}, flexible rows {rows}>"
        )


def check_arm(arm: Any) -> FlexibleRobot:
    """The argument, if it is a flexible robot."""
    return as_instance(arm, FlexibleRobot, "arm")


def _checked_links(model: RobotModel, links: Any) -> dict[int, FlexibleLink]:
    """Links by row in the order of rows."""
    for row, link in as_instance(links, Mapping, "links", " such as {2: beam(...)}").items():
        as_instance(link, FlexibleLink, f"links[{row!r:.20}]")
        as_count(row, "links", 1, model.f)
        if model.table.sigma[row - 1] == 1:
            raise InvalidValueError(
                f"links: row {row} is a sliding joint; put the link on a fixed row behind it."
            )
    return {int(row): links[row] for row in sorted(links)}


def _parts_of(arm: FlexibleRobot) -> Parts:
    """Chain from tip to root, inertia and elasticity of all bodies in packed arrays."""
    model, f, n = arm.model, arm.model.f, arm.n
    counts = [arm.links[row].m if row in arm.links else 0 for row in range(1, f + 1)]
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    m, most = int(start[-1]), max([1, *counts])
    pi, tip = model.inertia.values.copy(), np.zeros((f + 1, 3))
    first, second = np.zeros((m, 18)), np.zeros((m, most, 18))
    K, D = np.zeros((2, n + arm.m, n + arm.m))
    drive, six = np.zeros((n, 6)), np.triu_indices(3)
    if (drives := model.drive_matrices) is not None:
        drive[:, :4], D[:n, :n] = drives.rows, drives.viscous
    for row, link in arm.links.items():
        inv, end, k = link.invariants, link.tip, link.m
        pi[row - 1] = (*inv.inertia[six], *inv.first_moment, inv.mass)
        tip[row] = end.position
        here, at = slice(start[row - 1], start[row]), slice(n + start[row - 1], n + start[row])
        K[at, at] = inv.modal_stiffness
        D[at, at] = modal_damping_matrix(inv, arm.modal_damping[here])  # type: ignore[index]
        moments = inv.inertia_first[:, *six], inv.inertia_second[:, :, *six]
        first[here] = np.hstack([moments[0], inv.translation, inv.rotation, end.Phi, end.Psi])
        matrices = np.stack([inv.modal_mass, K[at, at], D[at, at]], -1)
        terms = (moments[1], inv.foreshortening, inv.gyroscopic, end.Gamma, matrices)
        second[here, :k] = np.concatenate(terms, axis=-1)
    joints, deflections = arm.joints, np.arange(n + m, n + arm.m)
    K[deflections, deflections] = arm.joint_stiffness[joints]  # type: ignore[index]
    D[deflections, deflections] = arm.joint_damping[joints]  # type: ignore[index]
    deflection = np.full(n, -1)
    drive[joints, 4], drive[joints, 5] = np.diag(K)[deflections], np.diag(D)[deflections]
    deflection[joints] = deflections
    at_end = model.tip in arm.links and np.array_equal(model.tool, np.eye(4))
    position = read_only(model.chain.position - tip[model.chain.antecedent])
    chain = Arm(
        chain=model.chain._replace(position=position),
        pi=read_only(pi),
        start=read_only(start, np.int64),
        tip=read_only(tip[1:]),
        first=read_only(first),
        second=read_only(second.reshape(m, 18 * most)),
        drive=read_only(drive),
        deflection=read_only(deflection, np.int64),
        tool=read_only(np.zeros(3) if at_end else model.tool[:3, 3] - tip[model.tip]),
        gravity=model.gravity,
        end=int(model.tip),
    )
    second[..., 16:] = drive[:, 4:] = 0.0
    none = read_only(np.zeros(3))
    bare = chain._replace(
        second=read_only(second.reshape(m, 18 * most)), drive=read_only(drive), gravity=none
    )
    free = np.zeros((3, n + 3), np.int64)
    free[1:, joints], free[1:, n], free[2, :n], free[2, n + 2] = 1, 1, 1, 1
    return Parts(chain, bare, *map(read_only, (K, D)), read_only(free, np.int64))  # type: ignore[reportCallIssue]


def modal_damping_matrix(invariants: Any, ratios: Array) -> Array:
    """Damping of clamped modes by their ratios. Shapes: ratios (m,) -> (m, m)."""
    from scipy.linalg import eigh

    M, K = invariants.modal_mass, invariants.modal_stiffness
    if not ratios.any():
        return np.zeros_like(M)
    values, V = eigh(K, M)
    return M @ (V * (2.0 * ratios * np.sqrt(np.maximum(values, 0.0)))) @ V.T @ M
