"""Chosen configurations, what they show, and how many of them are enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ..extended_table.parameters import GeometricParameters
from ..measurements.kinds import Kind
from .observability import Criterion, Observability


@dataclass(frozen=True, slots=True, eq=False)
class SelectedConfigurations(Rebuilt):
    """Configurations chosen for a calibration, the most useful ones first.

    The first c of them are a good set of c for every c: the order is that in which they would be
    missed, the last one least.

    Parameters
    ----------
    kind : class
        What shall be measured there.
    groups : ndarray, shape (count, m, n)
        Postures of each chosen configuration: one for measurements from outside, several for
        contacts (rad, m).
    candidates : ndarray of int, shape (count,)
        Number of each among the candidates; -1 for those that were moved afterwards.
    parameters : GeometricParameters
        p parameters that the candidates tell.
    criterion : Criterion
        What was made as large as possible.
    observability : Observability
        Of the chosen set. Columns are scaled by the root mean square of their lengths over all
        candidates, rows are in standard deviations of the measurement.
    counts : ndarray of int, shape (C,)
        Sizes of first parts that show all parameters.
    values : ndarray, shape (C,)
        The criterion of each.
    deviations : ndarray, shape (C, p)
        Expected standard deviations of the parameters (their units) for each.
    errors : ndarray, shape (C,)
        Root mean square of the deviations, each multiplied by the effect of its parameter: in
        standard deviations of the measurement.
    pool : int
        Number of candidates that were looked at.
    left_out : tuple of str
        What was not looked at and why, in sentences.
    """

    kind: Kind
    groups: Array
    candidates: NDArray[np.int64]
    parameters: GeometricParameters
    criterion: Criterion
    observability: Observability
    counts: NDArray[np.int64]
    values: Array
    deviations: Array
    errors: Array
    pool: int
    left_out: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("candidates", "counts"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))
        for name in ("groups", "values", "deviations", "errors"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def count(self) -> int:
        """Number of chosen configurations or contacts."""
        return len(self.groups)

    @property
    def q(self) -> Array:
        """All postures as rows, shape (count * m, n)."""
        return read_only(self.groups.reshape(-1, self.groups.shape[-1]))

    @property
    def labels(self) -> NDArray[np.int64]:
        """Number of the contact that each row of ``q`` belongs to."""
        return np.repeat(np.arange(self.count), self.groups.shape[1])

    @property
    def gains(self) -> Array:
        """Part by which the expected error falls with each added one, shape (C - 1,)."""
        return 1.0 - self.errors[1:] / self.errors[:-1]

    def enough(self, gain: float = 0.02) -> int | None:
        """From how many on each further one lowers the expected error by less than a part.

        The error falls at least as 1 / sqrt(count) when similar configurations are added, so
        parts below 1 / (2 count) are not reached.

        Parameters
        ----------
        gain : float
            Such as 0.02 for 2 %.

        Returns
        -------
        int or None
            The count; None if the chosen ones are not that many.

        Raises
        ------
        InvalidValueError
            Not between 0 and 1.
        """
        if not 0.0 < gain < 1.0:
            raise InvalidValueError(f"gain: expected a part between 0 and 1, got {gain!r}.")
        large = np.flatnonzero(self.gains >= gain)
        first = int(large[-1]) + 1 if len(large) else 0
        return int(self.counts[first]) if first < len(self.counts) - 1 else None

    def enough_sentence(self, gain: float = 0.02) -> str:
        """The same in words.

        Parameters
        ----------
        gain : float
            As for `enough`.

        Returns
        -------
        str
            A sentence.
        """
        found = self.enough(gain)
        if found is None:
            last = f"{100.0 * self.gains[-1]:.2g} %" if len(self.gains) else "an unknown part"
            return (
                f"{self.count} are not yet enough for a gain below {100.0 * gain:g} %: the last "
                f"one still lowers the expected error by {last}."
            )
        return (
            f"From {found} on each further one lowers the expected error of the parameters by "
            f"less than {100.0 * gain:g} %."
        )

    def __str__(self) -> str:
        size = self.groups.shape[1]
        each = "" if size == 1 else f", {size} postures each"
        lines = [
            f"{self.count} chosen of {self.pool} candidates for {self.kind.word}{each}: "
            f"{self.criterion.name} {self.observability.value(self.criterion):.4g} for "
            f"{len(self.parameters)} parameters.",
            str(self.observability) + ".",
            *self.left_out,
            self.enough_sentence(),
        ]
        return "\n".join(lines)
