"""The end reaches the same pose in several configurations: a key in a lock, a plug in a socket."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array
from ..extended_table import Frame
from .contact import Contact
from .labelled import Labels
from .labelled_poses import SIX, as_known_pose, guessed_poses, labelled_poses, pose_fixtures
from .measurement import POSE_AXES, POSE_UNITS, Evaluation, Fixture, Linearised
from .moving_poses import difference, widened


@dataclass(frozen=True, slots=True, init=False, eq=False)
class FrameContact(Contact):
    """The same pose in several postures of the arm (frame coupling, "same pose").

    The poses are unknown and estimated along as position and rotation vector, unless they are
    given. Two postures of a pose give six rows more than unknowns.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints each time, rad or m.
    pose : array_like of int or str, shape (N,), optional
        Which pose each row reaches; default: all the same.
    known : mapping of label to pose, shape (4, 4), optional
        Poses that are known in the world, metres.
    sigma : array_like, shape (), (6,) or (N, 6), optional
        Standard deviations, m and rad; default: estimated from the data.
    covariance : array_like, shape (6, 6) or (N, 6, 6), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports, and in front of the labels: the same name and label in two measurements is the
        same pose.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Shapes that do not fit, NaN, a known pose that is not reached.

    References
    ----------
    Seed book section 1.4.5.

    Examples
    --------
    >>> FrameContact(np.zeros((3, 6)), [0, 0, 1]).fixtures[9].name
    'frame:1.rx'
    """

    _met: ClassVar[str] = "pose"

    q: Array
    pose: tuple[str, ...]
    known: Mapping[str, Array]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        pose: Labels | None = None,
        known: Mapping[int | str, Any] | None = None,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "frame",
    ) -> None:
        self._settle(q, pose, known, as_known_pose, sigma, covariance, frame, name)

    @property
    def axes(self) -> tuple[str, ...]:
        """World axes."""
        return POSE_AXES

    @property
    def units(self) -> tuple[str, ...]:
        """Metres, then radians."""
        return POSE_UNITS

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Position and rotation vector of each unknown pose."""
        return pose_fixtures(self, SIX)

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """The origins of the known poses."""
        places = [T[:3, 3] for T in self.known.values()]
        return np.tile(np.eye(3), (len(places), 1)), np.array(places).reshape(-1)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Mean of the poses that the nominal robot thinks it reaches."""
        return guessed_poses(self, SIX, evaluations[0].T)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, world axes."""
        P = evaluations[0].psi.shape[-1]
        end = widened(evaluations[0], len(fixtures))
        residual, J = difference(end, labelled_poses(self, SIX, fixtures, P))
        return Linearised(residual, J[..., :P], J[..., P:])
