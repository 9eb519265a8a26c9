"""Kinds of measurement in which one end meets labelled things of the world, unknown or known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from ..extended_table import Frame
from .dilations import have_common_place
from .labelled import Labelled, Labels, as_known, as_labels
from .measurement import View, remade
from .noise import as_noise, part_of_noise
from .readings import as_readings


class Contact(Labelled):
    """Base of kinds whose end meets points, planes, lines or poses, one in each configuration."""

    __slots__ = ()

    _met: ClassVar[str]
    """Name of the field that says what is met in each configuration."""

    q: Array
    frame: Frame

    def _settle(
        self,
        q: ArrayLike,
        met: Labels | None,
        known: Mapping[int | str, Any] | None,
        checked: Callable[[Any, str], Array],
        sigma: ArrayLike | None,
        covariance: ArrayLike | None,
        frame: Frame,
        name: str,
    ) -> None:
        """Set all fields once they are checked, those of what is known by ``checked``."""
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        labels = as_labels(met, len(self.q), self._met)
        set_(self, self._met, labels)
        set_(self, "known", as_known(known, labels, self._met, checked))
        noise = as_noise(sigma, covariance, len(self.q), len(self.axes))
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @property
    def label(self) -> tuple[str, ...]:
        """What is met in each configuration."""
        return getattr(self, self._met)

    @property
    def blocks(self) -> int:
        """Number of configurations."""
        return len(self.q)

    @property
    def views(self) -> tuple[View, ...]:
        """The end in every configuration."""
        return (View(self.frame, self.q),)

    @property
    def is_constraint(self) -> bool:
        """It is."""
        return True

    @property
    def knows_length(self) -> bool:
        """Known things without a common place are a known length: else the robot can shrink."""
        return not have_common_place(*self.dilation_centres)

    @property
    def sees_base(self) -> bool:
        """Only through what is known in the world."""
        return bool(self.known)

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same contacts at other readings."""
        (q,) = configurations
        return remade(self, q=q)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the configurations."""
        sigma, covariance = part_of_noise(self, blocks)
        label = tuple(self.label[b] for b in blocks)
        changed: dict[str, Any] = {
            "q": self.q[blocks], self._met: label, "known": self.known_of(label), "sigma": sigma,
            "covariance": covariance,
        }  # fmt: skip
        return remade(self, blocks, **changed)
