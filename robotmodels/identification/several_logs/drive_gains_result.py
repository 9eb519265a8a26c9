"""Drive gains that were found: the gains, the parameters beside them, what became of both."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ...errors import InvalidValueError
from ...logs import Log
from ...minimal_parameters import BaseParameters
from ...table_text import boxed


class GainMethod(Enum):
    """How gains are found.

    Examples
    --------
    >>> GainMethod.TLS.value
    'total least squares'
    """

    TLS = "total least squares"
    WLS = "weighted least squares, the known load on the right side"


class GainStatus(Outcome):
    """What became of drive gains.

    Examples
    --------
    >>> int(GainStatus.SOLVED)
    0
    """

    SOLVED = 0, "The gains are those that fit all logs best."
    NOT_IDENTIFIABLE = (
        1,
        "The last two singular values are alike: other ratios of the gains fit the logs as well; "
        "use a motion that excites the joints together.",
    )
    LOAD_NOT_SEEN = (
        2,
        "The logs do not show the known load, so that the scale of the gains is open; use a "
        "heavier load, a motion that lifts it, and a log without it.",
    )


@dataclass(frozen=True, slots=True, eq=False)
class DriveGains(Rebuilt):
    """Gains of the drives, with the parameters identified together with them. Read-only.

    Parameters
    ----------
    gains : ndarray, shape (n,)
        Torque on the joint side per unit of the log, of each motor; NaN where they are not found.
    covariance : ndarray, shape (n, n)
        Of the gains.
    base : BaseParameters
        Of the robot.
    names : tuple of str
        The parameters found: those of the robot without load, then those of the loads that were
        not known, such as ``"MX load 1"``.
    values, deviations : ndarray, shape (c,)
        Of these, SI units.
    dropped : tuple of str
        Parameters that the logs do not tell from those; they are regrouped into them.
    noise : ndarray, shape (n,)
        Deviation of the residuals of each motor, in units of the log.
    singular_values : ndarray, shape (n,)
        Descending; in units of the noise.
    side : ndarray, shape (n, n)
        What turns torques of the joints into those of the motors on the joint side.
    method : GainMethod
        How.
    status : GainStatus
        What became of it.
    """

    gains: Array
    covariance: Array
    base: BaseParameters
    names: tuple[str, ...]
    values: Array
    deviations: Array
    dropped: tuple[str, ...]
    noise: Array
    singular_values: Array
    side: Array
    method: GainMethod
    status: GainStatus

    def __post_init__(self) -> None:
        for name in (
            "gains", "covariance", "values", "deviations", "noise", "singular_values", "side"
        ):  # fmt: skip
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def gain_deviations(self) -> Array:
        """Standard deviations of the gains, shape (n,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def ratio(self) -> float:
        """Last but one singular value over the last, both at least that of noise."""
        s = np.maximum(self.singular_values, 1.0)
        return float(s[-2] / s[-1]) if len(s) > 1 else np.inf

    def value(self, name: str) -> float:
        """One of the parameters, by its name."""
        if name not in self.names:
            raise InvalidValueError(
                f"name: {name!r} was not identified; names lists what was, dropped what was not."
            )
        return float(self.values[self.names.index(name)])

    def applied(self, log: Log) -> Log:
        """The log with torques instead of currents.

        Parameters
        ----------
        log : Log
            Currents on the joint side, as the gains were found from.

        Returns
        -------
        Log
            Torques of the joints, N m or N.
        """
        currents = log.tau @ self.side.T
        tau = np.linalg.solve(self.side, (currents * self.gains).T).T
        return Log(
            log.dt, log.q, np.ascontiguousarray(tau), log.v, log.a, log.q_ref, log.v_ref,
            log.starts, log.names, log.delay, log.sources, log.refused, log.notes,
        )  # fmt: skip

    def __str__(self) -> str:
        if self.status is not GainStatus.SOLVED:
            return self.status.sentence  # numbers that mean nothing are not shown
        rows = zip(self.gains, self.gain_deviations, self.noise, strict=True)
        cells = [(str(m + 1), *(f"{x:.4g}" for x in row)) for m, row in enumerate(rows)]
        heads = ("motor", "gain", "deviation", "noise")
        table = boxed([(h, [c[k] for c in cells]) for k, h in enumerate(heads)])
        return f"{table}\n{self.status.sentence}"
