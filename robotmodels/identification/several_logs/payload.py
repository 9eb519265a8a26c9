"""Inertial parameters of a payload, from torques with it and without it."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ...dynamics import with_payload
from ...errors import InvalidValueError
from ...friction import Friction
from ...inertia import PARAMETERS
from ...logs import Log
from ...minimal_parameters import base_parameters
from ...model import RobotModel, check_model
from ...table_text import boxed
from ..methods.estimate import check_values
from ..preparation.processing import Processing
from ..result import IdentificationResult
from .payload_equations import PayloadProblem, Solution, payload_problem, solve_payload

_SURE = 3.0
"""Deviations by which a parameter is told from zero."""


class PayloadStatus(Outcome):
    """What became of a payload.

    Examples
    --------
    >>> int(PayloadStatus.COMPLETE)
    0
    """

    COMPLETE = 0, "All ten parameters are identified."
    PARTIAL = (
        1,
        "The torques show some of the ten parameters only, or combinations; see regrouping.",
    )
    NOT_SEEN = 2, "No parameter differs from zero by three deviations: there is no load to see."
    NO_BODY = (
        3,
        "The solver found no real body; the parameters are those of least squares without it.",
    )


@dataclass(frozen=True, slots=True, eq=False)
class PayloadEstimate(Rebuilt):
    """A load that was identified. Read-only.

    Parameters
    ----------
    model : RobotModel
        The robot without it.
    frame : str, int or None
        Whose origin and axes the parameters are about and in; None is the tool.
    names : tuple of str
        Those of ``XX XY XZ YY YZ ZZ MX MY MZ M`` that are identified, k of them.
    values : ndarray, shape (k,)
        SI units.
    covariance : ndarray, shape (k, k)
        Corrected for correlated residuals, that of the robot's own parameters included.
    regrouping : mapping
        Of each of these, the coefficients of all the parameters that it stands for.
    no_effect : tuple of str
        Parameters that no torque of the logs shows.
    sigma : ndarray, shape (n,)
        Deviation of the residuals of each joint, N m or N.
    consistent : bool
        Whether the parameters were held to those of real bodies.
    cost : float
        Part by which that raised the sum of squared weighted residuals; 0 where it was not asked.
    status : PayloadStatus
        What became of it.
    """

    model: RobotModel
    frame: str | int | None
    names: tuple[str, ...]
    values: Array
    covariance: Array
    regrouping: Mapping[str, Mapping[str, float]]
    no_effect: tuple[str, ...]
    sigma: Array
    consistent: bool
    cost: float
    status: PayloadStatus

    def __post_init__(self) -> None:
        for name in ("values", "covariance", "sigma"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        groups = {k: MappingProxyType(dict(v)) for k, v in self.regrouping.items()}
        object.__setattr__(self, "regrouping", MappingProxyType(groups))

    @property
    def deviations(self) -> Array:
        """Standard deviations, shape (k,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Parameters that are identified by themselves, not in combination with others."""
        return tuple(name for name in self.names if len(self.regrouping[name]) == 1)

    @property
    def parameters(self) -> Array:
        """The ten parameters, NaN for those that are not identified by themselves, shape (10,)."""
        alone = set(self.identifiable)
        found = dict(zip(self.names, self.values.tolist(), strict=True))
        return np.array([found[name] if name in alone else np.nan for name in PARAMETERS])

    @property
    def mass(self) -> float:
        """Kilograms; NaN where it is not identified."""
        return float(self.parameters[9])

    @property
    def com(self) -> Array:
        """Centre of mass in the frame, metres, shape (3,); NaN where it is not identified."""
        ten = self.parameters
        with np.errstate(divide="ignore", invalid="ignore"):
            return ten[6:9] / ten[9]

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass in the frame's axes, kg m^2, shape (3, 3).

        NaN where a parameter that it needs is not identified.
        """
        XX, XY, XZ, YY, YZ, ZZ = self.parameters[:6]
        c, m = self.com, self.mass
        tensor = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
        return tensor - m * (c @ c * np.eye(3) - np.outer(c, c))

    @property
    def carried(self) -> RobotModel:
        """The robot with the load.

        Raises
        ------
        InvalidValueError
            Some of the ten parameters are not identified.
        InertiaError
            No body has these; ``consistent=True`` finds the one that fits best.
        """
        if np.isnan(self.parameters).any():
            missing = [p for p, x in zip(PARAMETERS, self.parameters, strict=True) if np.isnan(x)]
            raise InvalidValueError(
                f"payload: {', '.join(missing)} are not identified, so that the body is not known; "
                "give with_payload(...) what is known of it, or use a motion that shows them."
            )
        tensor = self.inertia
        return with_payload(self.model, self.mass, self.com, 0.5 * (tensor + tensor.T), self.frame)

    def __str__(self) -> str:
        rows = zip(self.names, self.values, self.deviations, strict=True)
        cells = [(name, f"{x:.4g}", f"{s:.2g}", _group(self.regrouping[name]))
                 for name, x, s in rows]  # fmt: skip
        heads = ("parameter", "value", "deviation", "stands for")
        table = boxed([(h, [c[k] for c in cells]) for k, h in enumerate(heads)])
        return f"{table}\n{self.status.sentence}"


def _group(terms: Mapping[str, float]) -> str:
    return " ".join(f"{value:+.4g} {name}" for name, value in terms.items())


def identify_payload(
    model: RobotModel,
    loaded: Log,
    reference: IdentificationResult | Log,
    frame: str | int | None = None,
    *,
    consistent: bool = False,
    own: tuple[str, ...] = (),
    friction: Friction | None = None,
    processing: Processing | None = None,
    executor: Executor | None = None,
) -> PayloadEstimate:
    """Inertial parameters of the load that a robot carries in a log.

    With a log without load, the parameters of the robot and of the load are found together from
    both. With an identified robot, its parameters and their covariance stand for that log: what
    the torques of the loaded log have beyond them is the load's. Where its log did not show all
    base parameters, or some were left out as not essential, its values hold for the motion of that
    log only: then the log itself is used, with all base parameters, those unseen unknown.

    Parameters
    ----------
    model : RobotModel
        The robot; its own inertia is not used.
    loaded : Log
        With the load.
    reference : IdentificationResult or Log
        The robot without it.
    frame : str or int, optional
        Whose origin and axes the parameters are about and in; default the tool.
    consistent : bool
        Hold the ten parameters to those of a real body; needs Clarabel, an optional extra.
    own : tuple of str
        Kinds of drive and friction parameters that differ with the load or the day, such as
        ``("offset", "Fc")``: the loaded log has its own.
    friction : Friction, optional
        Besides that of the drives, with a log as reference.
    processing : Processing, optional
        Of both logs; default that of the reference.
    executor : concurrent.futures.Executor, optional
        Who computes the pieces of the logs.

    Returns
    -------
    PayloadEstimate
        ``.mass``, ``.com``, ``.inertia``, ``.carried``.

    Raises
    ------
    InvalidValueError, ShapeError, FrameNotFoundError
        Logs or a result of another robot; a frame of the base; kinds that are not there.
    MissingExtraError
        ``consistent=True`` without Clarabel.

    References
    ----------
    W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
    industrial manipulators", IEEE ICRA 2007, sections III.A (difference) and III.C (together);
    P. Wensing, S. Kim and J.-J. Slotine, "Linear matrix inequalities for physically consistent
    inertial parameter identification", IEEE RA-L 3(1), 2018 (real bodies).

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.dynamics import with_payload
    >>> loaded = with_payload(arm, 2.0, [0.1, 0.0, 0.0])
    >>> more = Log(0.005, q, idm(loaded, q, v, a) + 2.0 * v)
    >>> found = identify_payload(arm, more, log)
    >>> found.identifiable, round(float(found.mass), 3)
    (('ZZ', 'MX', 'MY', 'M'), 2.0)
    """
    check_model(model)
    if isinstance(reference, IdentificationResult):
        check_values(reference.estimate)
        base = reference.base
        base.check(model)
        if reference.unseen or reference.not_essential:
            # its values hold for its own motion only: what they leave out may act in the loaded log
            if reference.unseen:
                base = base_parameters(model, drive=base.drive, friction=base.friction)
            processing = reference.system.processing if processing is None else processing
            reference = reference.system.log
    else:
        base = base_parameters(model, drive=True, friction=friction)
    problem = payload_problem(base, loaded, reference, frame, own, processing, executor)
    return _estimate(problem, solve_payload(problem, consistent), consistent)


def _estimate(problem: PayloadProblem, found: Solution, consistent: bool) -> PayloadEstimate:
    names, regrouping = [], {}
    first = len(problem.names) - 10
    kept = problem.basis.kept
    for row, k in enumerate(kept.tolist()):
        if k < first:
            continue
        names.append(PARAMETERS[k - first])
        terms = np.flatnonzero(problem.basis.coefficients[row])
        regrouping[names[-1]] = {
            problem.names[t] if t < first else PARAMETERS[t - first]:
            float(problem.basis.coefficients[row, t]) for t in terms
        }  # fmt: skip
    where = np.flatnonzero(kept >= first)
    shown = {name for terms in regrouping.values() for name in terms}
    rows = np.any(problem.basis.coefficients[:, first:], axis=0).tolist()
    unseen = tuple(name for name, seen in zip(PARAMETERS, rows, strict=True) if not seen)
    values = found.values[where]
    covariance = found.covariance[np.ix_(where, where)]
    alone = len(names) == 10 and all(len(terms) == 1 for terms in regrouping.values())
    status = PayloadStatus.COMPLETE if alone else PayloadStatus.PARTIAL
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not shown or (np.abs(values) < _SURE * deviations).all():
        status = PayloadStatus.NOT_SEEN
    if not found.solved:
        status = PayloadStatus.NO_BODY
    return PayloadEstimate(
        problem.base.model, problem.frame, tuple(names), values, covariance, regrouping, unseen,
        found.sigma, consistent and found.solved, found.cost, status,
    )  # fmt: skip
