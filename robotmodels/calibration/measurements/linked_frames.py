"""Two ends of one robot hold the same thing: two arms and a bar, two robots and a socket."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ..extended_table import Frame
from .labelled import Labelled, Labels, as_known, as_labels
from .labelled_poses import (
    POSITION,
    SIX,
    as_known_pose,
    guessed_poses,
    labelled_poses,
    pose_fixtures,
)
from .measurement import POSE_AXES, POSE_UNITS, Evaluation, Fixture, Linearised, View, remade
from .moving_poses import difference, product, relative, widened
from .noise import as_noise, part_of_noise
from .readings import as_readings


@dataclass(frozen=True, slots=True, init=False, eq=False)
class LinkedFrames(Labelled):
    """Two ends of a tree hold the same object: ``T(q) X = T_other(q)`` with a constant X.

    X, the pose of the other end in this one, is unknown and estimated along, unless it is given.
    With ``orientation=False`` they share a point only (a ball in a socket): the origin of the
    other end is fixed in this one.

    Two robots are one tree by `side_by_side`. A robot linked with itself in several postures is
    `FrameContact` or `PointContact`.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of all joints, rad or m.
    frame, frame_other : str, int or None
        The two ends; None is the tool.
    link : array_like of int or str, shape (N,), optional
        Which object they hold each time; default: always the same.
    known : mapping of label to pose, shape (4, 4), optional
        Objects whose X is known, metres.
    orientation : bool
        Whether the object holds the orientation as well.
    sigma : array_like, shape (), (k,) or (N, k), optional
        Standard deviations, m and rad, k = 6 or 3; default: estimated from the data.
    covariance : array_like, shape (k, k) or (N, k, k), optional
        Instead of sigma.
    name : str
        In reports, and in front of the labels: the same name and label in two measurements is the
        same object.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Shapes that do not fit, NaN, the same end twice, a known object that is not held.

    References
    ----------
    Seed book section 1.4.5.

    Examples
    --------
    >>> held = LinkedFrames(np.zeros((9, 12)), "left_tool", "right_tool", orientation=False)
    >>> [fixture.name for fixture in held.fixtures]
    ['link:0.x', 'link:0.y', 'link:0.z']
    """

    q: Array
    frame: Frame
    frame_other: Frame
    link: tuple[str, ...]
    known: Mapping[str, Array]
    orientation: bool
    sigma: Array | None
    covariance: Array | None
    name: str

    def __init__(
        self,
        q: ArrayLike,
        frame: Frame,
        frame_other: Frame,
        link: Labels | None = None,
        known: Mapping[int | str, Any] | None = None,
        orientation: bool = True,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        name: str = "link",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        if frame == frame_other:
            raise InvalidValueError(f"frame_other: expected another end than {frame!r}.")
        set_(self, "frame", frame)
        set_(self, "frame_other", frame_other)
        labels = as_labels(link, len(self.q), "link")
        set_(self, "link", labels)
        set_(self, "known", as_known(known, labels, "link", as_known_pose))
        set_(self, "orientation", bool(orientation))
        noise = as_noise(sigma, covariance, len(self.q), len(self._numbers))
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "name", name)

    @property
    def _numbers(self) -> tuple[int, ...]:
        """Which of the six numbers of X matter."""
        return SIX if self.orientation else POSITION

    @property
    def label(self) -> tuple[str, ...]:
        """Object that is held each time."""
        return self.link

    @property
    def blocks(self) -> int:
        """Number of configurations."""
        return len(self.q)

    @property
    def axes(self) -> tuple[str, ...]:
        """World axes."""
        return POSE_AXES[: len(self._numbers)]

    @property
    def units(self) -> tuple[str, ...]:
        """Metres, then radians."""
        return POSE_UNITS[: len(self._numbers)]

    @property
    def views(self) -> tuple[View, ...]:
        """Both ends at the same configurations."""
        return (View(self.frame, self.q), View(self.frame_other, self.q))

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Position and rotation vector of each unknown X."""
        return pose_fixtures(self, self._numbers)

    @property
    def is_constraint(self) -> bool:
        """It is."""
        return True

    @property
    def knows_length(self) -> bool:
        """A known X whose origin is not that of the end is a length."""
        return any(bool(X[:3, 3].any()) for X in self.known.values())

    @property
    def sees_base(self) -> bool:
        """Both ends stand on the same base."""
        return False

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Mean pose of the other end in this one."""
        return guessed_poses(self, self._numbers, relative(*evaluations).T)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector of the other end, world axes."""
        P = evaluations[0].psi.shape[-1]
        end, other = (widened(e, len(fixtures)) for e in evaluations)
        held = product(end, labelled_poses(self, self._numbers, fixtures, P))
        residual, J = difference(other, held)
        k = len(self._numbers)
        return Linearised(residual[:, :k], J[:, :k, :P], J[:, :k, P:])

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same object held at other readings.

        Where the readings for the two ends differ, each joint takes those of the end that moved
        it; joints moved for both take the mean.
        """
        q, other = configurations
        if np.array_equal(q, other):
            return remade(self, q=q)
        moved, moved_other = q != self.q, other != self.q
        both = 0.5 * (q + other)
        return remade(self, q=np.where(moved & moved_other, both, np.where(moved, q, other)))

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the configurations."""
        sigma, covariance = part_of_noise(self, blocks)
        link = tuple(self.link[b] for b in blocks)
        return remade(
            self, blocks, q=self.q[blocks], link=link, known=self.known_of(link), sigma=sigma,
            covariance=covariance,
        )  # fmt: skip
