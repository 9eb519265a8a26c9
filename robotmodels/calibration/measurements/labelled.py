"""Kinds of measurement whose blocks are of labelled things: points, planes, lines, poses."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError, ShapeError
from .measurement import Measurement

Labels = Sequence[int | str] | NDArray[np.int64]
"""A label for each block."""


class Labelled(Measurement):
    """Base of kinds whose blocks share a fixture if they have the same label."""

    __slots__ = ()

    known: Mapping[str, Array]

    @property
    def _arguments(self) -> tuple[Any, ...]:  # a mapping proxy does not pickle
        return tuple(dict(v) if isinstance(v, MappingProxyType) else v for v in super()._arguments)

    @property
    @abstractmethod
    def label(self) -> tuple[str, ...]:
        """Label of each block."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Each label once, in the order in which they come."""
        return tuple(dict.fromkeys(self.label))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Labels of what is estimated along."""
        return tuple(label for label in self.labels if label not in self.known)

    @property
    def groups(self) -> NDArray[np.int64]:
        """Number of the label of each block."""
        number = {label: k for k, label in enumerate(self.labels)}
        return np.array([number[label] for label in self.label], dtype=np.int64)

    @property
    def unknown_groups(self) -> NDArray[np.int64]:
        """Number of the label of each block among the unknown ones; -1 where it is known."""
        number = {label: k for k, label in enumerate(self.unknown)}
        return np.array([number.get(label, -1) for label in self.label], dtype=np.int64)

    def known_of(self, label: Sequence[str]) -> dict[str, Array]:
        """What is known of some labels.

        Parameters
        ----------
        label : sequence of str
            Which.

        Returns
        -------
        dict of str to ndarray
            Only those among them.
        """
        return {key: value for key, value in self.known.items() if key in label}


def as_labels(given: Labels | None, blocks: int, name: str) -> tuple[str, ...]:
    """Check the labels of a measurement."""
    if given is None:
        return ("0",) * blocks
    if isinstance(given, str) or np.ndim(given) != 1 or len(given) != blocks:
        got = repr(given) if isinstance(given, str) else f"shape {np.shape(given)}"
        raise ShapeError(f"{name}: expected a label for each of the {blocks} rows of q, got {got}.")
    return tuple(str(label) for label in given)


def as_known(
    given: Mapping[Any, Any] | None,
    labels: Sequence[str],
    thing: str,
    checked: Callable[[Any, str], Array],
) -> Mapping[str, Array]:
    """Check the known values of labelled objects."""
    if given is not None and not isinstance(given, Mapping):
        raise InvalidValueError(
            f"known: expected a mapping of labels to values, such as {{0: ...}}, got "
            f"{type(given).__name__}."
        )
    values = {str(k): checked(v, f"known[{k!r}]") for k, v in (given or {}).items()}
    for label in values:
        if label not in labels:
            raise InvalidValueError(
                f"known: no row of q has the {thing} {label!r}; there are "
                f"{', '.join(dict.fromkeys(labels))}."
            )
    return MappingProxyType(values)
