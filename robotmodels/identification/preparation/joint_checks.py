"""Whether torques belong to the joints they are said to be of, by the dynamic model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._arrays import Array
from ...errors import ShapeError
from ...friction import Friction
from ...logs import FindingKind, Log, LogFinding, Severity
from ...logs.log import check_is_log
from ...minimal_parameters import base_parameters
from ...model import RobotModel, check_model
from .delay_rows import ThinRows, looked_at, thin_rows
from .synchronisation import SynchronisationStatus, synchronisation

_CUTOFF, _SHARE = 15.0, 0.1
_CLEARLY = 0.5
"""A wrong joint must leave less than this part of the variance that the own joint leaves."""
_EXPLAINED = 0.8
_SIGNIFICANT = 6.0
_RANK = 1e-6


def check_joints(
    log: Log, model: RobotModel, friction: Friction | None = None
) -> tuple[LogFinding, ...]:
    """What the dynamic model tells of a log: joints swapped, wrong signs, delay, what is excited.

    - Each torque is explained by the model of each joint, its parameters free. Where two torques
      are clearly better explained by each other's joints, they look swapped.
    - Friction takes energy. Where viscous and Coulomb friction that fit a torque give energy,
      significantly, the sign of its torque (or of its position) looks wrong.
    - The regressor's rank on this motion is compared with the number of base parameters.
    - The delay of the torques is estimated, see `synchronisation`.

    Of a log of more than 1e5 samples so many are looked at, in up to 20 stretches spread evenly
    over it; what is found then says so.

    Parameters
    ----------
    log : Log
        What was recorded.
    model : RobotModel
        The robot it is of; its inertia and friction are not used.
    friction : Friction, optional
        Gravity compensators of the robot, alone or in a sum: a compensator that is not given may
        look like a wrong sign.

    Returns
    -------
    tuple of LogFinding
        Empty if nothing was found.

    Raises
    ------
    ShapeError, InvalidValueError
        The model has other joints; the log is too short to be filtered.

    See Also
    --------
    robotmodels.logs.check_log : what can be told without the dynamic model.

    References
    ----------
    Seed book sections 1.6.2.1 to 1.6.2.4.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t = np.arange(0.0, 4.0, 0.001)[:, None]
    >>> q = np.sin(3.0 * t) + np.sin(7.0 * t)
    >>> v = 3.0 * np.cos(3.0 * t) + 7.0 * np.cos(7.0 * t)
    >>> a = -9.0 * np.sin(3.0 * t) - 49.0 * np.sin(7.0 * t)
    >>> [finding.kind.name for finding in check_joints(Log(0.001, q, -(2.0 * a + v)), one)]
    ['WRONG_SIGN']
    """
    check_is_log(log)
    check_model(model)
    if model.n != log.n:
        raise ShapeError(f"log: {log.n} joints, the model {model.name} has {model.n}.")
    cutoff = min(_CUTOFF, _SHARE / log.dt)
    part = looked_at(log, cutoff)
    found: list[LogFinding] = []
    _dynamic(part, model, thin_rows(part, model, cutoff, 2, friction=friction), found)
    _in_step(part, model, found)
    if part is not log:
        said = f" (Judged by {len(part)} of {len(log)} samples.)"
        found = [replace(finding, sentence=finding.sentence + said) for finding in found]
    return tuple(found)


def _dynamic(log: Log, model: RobotModel, rows: ThinRows, found: list[LogFinding]) -> None:
    if not _swapped(log, rows, found):
        _signs(log, rows, found)
    _excited(log, model, rows, found)


def _swapped(log: Log, rows: ThinRows, found: list[LogFinding]) -> bool:
    n = log.n
    rest = np.ones((n, n))  # of torque i, what the model of joint j leaves
    for j in range(n):
        basis, at = rows.bases[j], rows.places[j]
        if len(at) < 3 * basis.shape[1] or np.ptp(log.q[:, j]) < 1e-9:
            continue
        y = rows.tau[at]
        y = y - y.mean(axis=0)
        size = (y**2).sum(axis=0)
        left = ((y - basis @ (basis.T @ y)) ** 2).sum(axis=0)
        rest[:, j] = np.where(size > 0.0, left / np.where(size > 0.0, size, 1.0), 1.0)
    taken: set[int] = set()
    for i in range(n):
        for j in range(i + 1, n):
            if taken & {i, j}:
                continue
            if (
                rest[i, j] < _CLEARLY * rest[i, i] and rest[j, i] < _CLEARLY * rest[j, j]
                and max(rest[i, j], rest[j, i]) < 1.0 - _EXPLAINED
            ):  # fmt: skip
                taken |= {i, j}
                names = (log.names[i], log.names[j])
                found.append(
                    LogFinding(
                        FindingKind.SWAPPED_JOINTS, Severity.USELESS, names,
                        f"Joints {names[0]} and {names[1]} look swapped: the torque of each "
                        f"follows the motion of the other (unexplained {100 * rest[i, j]:.1f} and "
                        f"{100 * rest[j, i]:.1f} % instead of {100 * rest[i, i]:.1f} and "
                        f"{100 * rest[j, j]:.1f} %). See the order of the columns of positions and "
                        "of torques.",
                    )
                )  # fmt: skip
    return bool(taken)


def _signs(log: Log, rows: ThinRows, found: list[LogFinding]) -> None:
    """Report joints whose friction gives energy."""
    for j in range(log.n):
        W, at = rows.regressors[j], rows.places[j]
        if not len(at):
            continue
        # Coulomb friction of motors that it shares is lost in it too
        shared = np.flatnonzero(rows.shared[:, j]).tolist()
        own = {rows.viscous + j, rows.dry + j, *(rows.dry + log.n + k for k in shared)}
        power, deviation = _friction_power(W, rows.tau[at, j], rows.velocities[at, j], own)
        if power < -_SIGNIFICANT * deviation:
            name = log.names[j]
            found.append(
                LogFinding(
                    FindingKind.WRONG_SIGN, Severity.USELESS, (name,),
                    f"Joint {name}: its friction would give {-power:.3g} W on the average, where "
                    "friction takes energy. The sign of its torque or of its position looks wrong: "
                    "see signs= and drive_gains= of read_log.",
                )
            )  # fmt: skip


def _friction_power(W: Array, tau: Array, v: Array, own_columns: set[int]) -> tuple[float, float]:
    """Mean power that the friction of a joint takes, and its standard deviation."""
    size = np.sqrt((W**2).sum(axis=0))
    kept = np.flatnonzero(size > 1e-9 * size.max(initial=1.0))
    A = W[:, kept] / size[kept]
    own = [k for k, column in enumerate(kept.tolist()) if column in own_columns]
    if not own or len(A) < 3 * len(kept):
        return 0.0, 1.0
    others = np.delete(A, own, axis=1)
    U, s, _ = np.linalg.svd(others, full_matrices=False)
    U = U[:, s > _RANK * s.max(initial=0.0)]
    clean = A[:, own] - U @ (U.T @ A[:, own])
    y = tau - U @ (U.T @ tau)
    x, _, rank, _ = np.linalg.lstsq(clean, y, rcond=1e-6)
    rest = y - clean @ x
    if rank < len(own):
        return 0.0, 1.0
    freedom = max(1, len(y) - U.shape[1] - len(own))
    covariance = float(rest @ rest) / freedom * np.linalg.inv(clean.T @ clean)
    gain = (v[:, None] * A[:, own]).mean(axis=0)
    return float(gain @ x), float(np.sqrt(gain @ covariance @ gain)) + 1e-300


def _excited(log: Log, model: RobotModel, rows: ThinRows, found: list[LogFinding]) -> None:
    base = base_parameters(model, drive=True)
    kept = [rows.names.index(name) for name in base.names]
    possible, seen = len(base), _rank([W[:, kept] for W in rows.regressors])
    if seen < possible:
        found.append(
            LogFinding(
                FindingKind.NOT_EXCITING, Severity.DOUBTFUL, (),
                f"The motion shows {seen} of {possible} base parameters; the others cannot be told "
                "apart. Record a motion that excites them (exciting_trajectory), or identify the "
                "joints that move.",
            )
        )  # fmt: skip


def _rank(parts: Sequence[Array]) -> int:
    factors = [np.asarray(np.linalg.qr(W, mode="r")) for W in parts]
    R = np.asarray(np.linalg.qr(np.concatenate(factors), mode="r"))
    size = np.sqrt((R**2).sum(axis=0))  # of the columns of all parts
    kept = size > 1e-9 * size.max(initial=0.0)
    s = np.linalg.svd(R[:, kept] / size[kept], compute_uv=False)
    return int((s > _RANK * s.max(initial=0.0)).sum())


def _in_step(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    estimate = synchronisation(log, model)
    if estimate.status is SynchronisationStatus.AT_THE_END:
        found.append(
            LogFinding(
                FindingKind.OUT_OF_STEP, Severity.DOUBTFUL, (),
                f"The torques fit the positions best {1e3 * abs(estimate.delay):.0f} ms "
                f"{'late' if estimate.delay > 0.0 else 'early'}, the largest delay that was tried: "
                "either they are further out of step, or of another motion. Try more by "
                "synchronisation(log, model, within=...), and take it out with with_delay.",
            )
        )  # fmt: skip
    if not estimate.status.is_success:
        return
    if estimate.is_out_of_step:
        found.append(
            LogFinding(
                FindingKind.OUT_OF_STEP, Severity.DOUBTFUL, (),
                f"{estimate} Take it out with with_delay(log, {estimate.delay:.3g}).",
            )
        )  # fmt: skip
