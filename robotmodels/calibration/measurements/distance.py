"""Lengths: between two positions of the end, or from a fixed point (ball-bar, cable, tracker)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ..extended_table import Frame
from .labelled import Labelled, Labels, as_known, as_labels
from .labelled_points import as_point, known_points, labelled_points, point_fixtures
from .measurement import Evaluation, Fixture, Linearised, View, remade
from .noise import as_noise, part_of_noise
from .pivots import pivot_of
from .readings import as_readings, as_values, same_number_of_readings


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Distance(Labelled):
    """Measured lengths between the end and a pivot, or between two positions of the end.

    With ``q_other`` each length is that from the end at ``q`` to the end at ``q_other``. Without,
    it is that from a pivot: the fixed ball of a ball-bar, the drum of a cable, the head of an
    interferometer. Pivots are unknown and estimated along, unless they are given. If all positions
    about an unknown pivot lie in a plane, it may be on either side, and the lower side is taken.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints, rad or m.
    length : array_like, shape (N,) or ()
        Measured lengths, metres; one number for a bar that stays the same.
    q_other : array_like, shape (N, n), optional
        Readings at the other position.
    pivot : array_like of int or str, shape (N,), optional
        Which pivot each length is from; default: all from the same. Not with ``q_other``.
    known : mapping of label to array_like, shape (3,), optional
        Places of pivots that are known in the world, metres.
    offset : bool
        Whether a constant, unknown and estimated along, is to be taken from the lengths (one for
        each pivot): the dead path of an interferometer that counts from where it was set to zero.
    sigma : array_like, shape (), (1,) or (N, 1), optional
        Standard deviations, m; default: estimated from the data.
    covariance : array_like, shape (1, 1) or (N, 1, 1), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports, and in front of the labels: the same name and label in two measurements is the
        same pivot.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, NaN, lengths that are not positive, a known pivot without lengths,
        pivots together with ``q_other``.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> bar = Distance(np.zeros((4, 6)), 0.3)
    >>> [fixture.name for fixture in bar.fixtures]
    ['pivot:0.x', 'pivot:0.y', 'pivot:0.z']
    """

    q: Array
    length: Array
    q_other: Array | None
    pivot: tuple[str, ...] | None
    known: Mapping[str, Array]
    offset: bool
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        length: ArrayLike,
        q_other: ArrayLike | None = None,
        pivot: Labels | None = None,
        known: Mapping[int | str, ArrayLike] | None = None,
        offset: bool = False,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "pivot",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        lengths = as_values(length, len(self.q), "length")
        if not offset and not (lengths > 0.0).all():
            raise InvalidValueError(
                f"length: expected positive lengths in metres, got {lengths.min():.6g}. Lengths "
                "that count from somewhere need offset=True."
            )
        set_(self, "length", lengths)
        if q_other is not None and (pivot is not None or known):
            raise InvalidValueError(
                "Give q_other (lengths between two positions) or pivots (lengths from fixed "
                "points), not both."
            )
        other = None if q_other is None else same_number_of_readings(self.q, q_other)
        set_(self, "q_other", other)
        labels = as_labels(pivot, len(self.q), "pivot")
        set_(self, "pivot", labels if other is None else None)
        set_(self, "known", as_known(known, labels, "pivot", as_point))
        set_(self, "offset", bool(offset))
        noise = as_noise(sigma, covariance, len(self.q), 1)
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @property
    def label(self) -> tuple[str, ...]:
        """Pivot of each length; all 0 between two positions."""
        return ("0",) * len(self.q) if self.pivot is None else self.pivot

    @property
    def unknown(self) -> tuple[str, ...]:
        """Labels of the pivots that are estimated along."""
        if self.pivot is None:
            return ()
        return tuple(label for label in self.labels if label not in self.known)

    @property
    def blocks(self) -> int:
        """Number of lengths."""
        return len(self.q)

    @property
    def axes(self) -> tuple[str, ...]:
        """The length."""
        return ("length",)

    @property
    def units(self) -> tuple[str, ...]:
        """Metres."""
        return ("m",)

    @property
    def views(self) -> tuple[View, ...]:
        """The end at every configuration, and at the other ones."""
        one = View(self.frame, self.q)
        return (one,) if self.q_other is None else (one, View(self.frame, self.q_other))

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Coordinates of the unknown pivots, then offsets."""
        offsets = self.labels if self.offset else ()
        return (
            *point_fixtures(self),
            *(Fixture(f"{self.name}:{label}.offset", "m") for label in offsets),
        )

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """The known pivots."""
        return known_points(self)

    @property
    def knows_length(self) -> bool:
        """It is one; with unknown offsets, if the lengths of a pivot differ."""
        if not self.offset:
            return True
        group = self.groups
        return any(np.ptp(self.length[group == g]) > 0.0 for g in range(len(self.labels)))

    @property
    def sees_base(self) -> bool:
        """Only through pivots that are known in the world."""
        return bool(self.known)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Centres of the spheres on which the nominal positions lie, and mean offsets."""
        p = evaluations[0].T[:, :3, 3]
        group = self.unknown_groups
        centres = [
            pivot_of(p[group == g], self.length[group == g], self.offset)
            for g in range(len(self.unknown))
        ]
        points = np.concatenate([np.zeros(0), *centres])
        if not self.offset:
            return points
        missing = self.length - np.linalg.norm(self._apart(evaluations, points)[0], axis=1)
        means = [missing[self.groups == g].mean() for g in range(len(self.labels))]
        return np.concatenate([points, means])

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Predicted length less the measured one."""
        F = 3 * len(self.unknown)
        apart, by_points = self._apart(evaluations, fixtures[:F])
        length = np.linalg.norm(apart, axis=1)
        # where both coincide the length has no direction: it is told by the other blocks
        along = (apart / np.where(length > 0.0, length, 1.0)[:, None])[:, None]
        psi = evaluations[0].psi[:, :3]
        if self.q_other is not None:
            psi = psi - evaluations[1].psi[:, :3]
        by_fixtures = np.zeros((self.blocks, 1, len(fixtures)))
        by_fixtures[..., :F] = -along @ by_points
        residual = length - self.length
        if self.offset:
            residual = residual + fixtures[F + self.groups]
            by_fixtures[np.arange(self.blocks), 0, F + self.groups] = 1.0
        return Linearised(residual[:, None], along @ psi, by_fixtures)

    def _apart(self, evaluations: Sequence[Evaluation], points: Array) -> tuple[Array, Array]:
        """Vectors from the other position or the pivots to the end; derivative of the latter."""
        p = evaluations[0].T[:, :3, 3]
        if self.q_other is not None:
            return p - evaluations[1].T[:, :3, 3], np.zeros((self.blocks, 3, 0))
        centre, by_points = labelled_points(self, points)
        return p - centre, by_points

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same lengths at other readings."""
        if self.q_other is None:
            (q,) = configurations
            return remade(self, q=q)
        q, q_other = configurations
        return remade(self, q=q, q_other=q_other)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the lengths."""
        sigma, covariance = part_of_noise(self, blocks)
        pivot = None if self.pivot is None else tuple(self.pivot[b] for b in blocks)
        return remade(
            self,
            blocks,
            q=self.q[blocks],
            length=self.length[blocks],
            q_other=None if self.q_other is None else self.q_other[blocks],
            pivot=pivot,
            known=self.known_of(pivot or ()),
            sigma=sigma,
            covariance=covariance,
        )
