"""The end lies on a straight line: a reflector in a laser beam, a tip on a stretched wire."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact, read_only
from ...errors import InvalidValueError
from ..extended_table import Frame
from .contact import Contact
from .labelled import Labels
from .measurement import Evaluation, Fixture, Linearised
from .rotation_vectors import tilt_of, tilted_axes, unit_vector


@dataclass(frozen=True, slots=True, init=False, eq=False)
class LaserLine(Contact):
    """Configurations in which the end's origin lies on a line, known or not.

    A line is the axis z of the world turned about x and y (rx, ry, rad) and moved along the turned
    x and y axes (x, y, m): four unknowns for a line that is not known.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints, rad or m.
    line : array_like of int or str, shape (N,), optional
        Which line the end is on; default: always the same.
    known : mapping of label to array_like, shape (2, 3), optional
        Lines that are known in the world: a point of them in metres, and a direction.
    sigma : array_like, shape (), (2,) or (N, 2), optional
        Standard deviations across the line, m; default: estimated from the data.
    covariance : array_like, shape (2, 2) or (N, 2, 2), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports, and in front of the labels: the same name and label in two measurements is the
        same line.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, NaN, a direction of length 0, a known line that nothing is on.

    References
    ----------
    Seed book section 1.4.4; W. S. Newman, C. E. Birkhimer, R. J. Horning, A. T. Wilkey,
    "Calibration of a Motoman P8 robot based on laser tracking", IEEE ICRA 2000.

    Examples
    --------
    >>> [fixture.name for fixture in LaserLine(np.zeros((5, 6))).fixtures]
    ['line:0.rx', 'line:0.ry', 'line:0.x', 'line:0.y']
    """

    _met: ClassVar[str] = "line"

    q: Array
    line: tuple[str, ...]
    known: Mapping[str, Array]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        line: Labels | None = None,
        known: Mapping[int | str, ArrayLike] | None = None,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "line",
    ) -> None:
        self._settle(q, line, known, _as_line, sigma, covariance, frame, name)

    @property
    def axes(self) -> tuple[str, ...]:
        """Across the line, along the turned axes x and y."""
        return ("x", "y")

    @property
    def units(self) -> tuple[str, ...]:
        """Both metres."""
        return ("m", "m")

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Two turns and two coordinates of each unknown line."""
        return tuple(
            Fixture(f"{self.name}:{label}.{what}", unit)
            for label in self.unknown
            for what, unit in (("rx", "rad"), ("ry", "rad"), ("x", "m"), ("y", "m"))
        )

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """The known lines."""
        four = np.array([_four(line) for line in self.known.values()]).reshape(-1, 4)
        across = tilted_axes(four[:, :2])[0][:, :, :2]
        return across.swapaxes(1, 2).reshape(-1, 3), four[:, 2:].reshape(-1)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Mean line of the positions on each: direction where they spread most."""
        p = evaluations[0].T[:, :3, 3]
        group = self.unknown_groups
        found = [np.zeros(0)]
        for g in range(len(self.unknown)):
            mean = p[group == g].mean(axis=0)
            direction = np.linalg.svd(p[group == g] - mean, full_matrices=True)[2][0]
            found.append(_four(np.array([mean, direction])))
        return np.concatenate(found)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Distance of the end from the line, in two directions across it."""
        T, psi = evaluations[0]
        lines = dict(zip(self.unknown, fixtures.reshape(-1, 4), strict=True))
        lines |= {label: _four(line) for label, line in self.known.items()}
        four = np.array([lines[label] for label in self.labels])[self.groups]
        R, by_tilt = tilted_axes(four[:, :2])
        across = R[:, :, :2].swapaxes(1, 2)
        p = T[:, :3, 3]
        by_four = np.zeros((len(T), 2, 4))
        by_four[:, :, :2] = np.einsum("ni,nikt->nkt", p, by_tilt[:, :, :2])
        by_four[:, :, 2:] = -np.eye(2)
        by_fixtures = np.zeros((len(T), 2, len(fixtures)))
        group = self.unknown_groups
        for g in range(len(self.unknown)):
            by_fixtures[group == g, :, 4 * g : 4 * g + 4] = by_four[group == g]
        residual = (across @ p[..., None])[..., 0] - four[:, 2:]
        return Linearised(residual, across @ psi[:, :3], by_fixtures)


def _as_line(value: Any, name: str) -> Array:
    line = as_exact(value, (2, 3), name)
    if not line[1].any():
        raise InvalidValueError(f"{name}: expected a direction in the second row, got zeros.")
    return read_only(np.array([line[0], unit_vector(line[1])]))


def _four(line: Array) -> Array:
    """Turns and coordinates of a line through a point; of its two directions the upper one."""
    direction = line[1] if line[1, 2] >= 0.0 else -line[1]
    tilt = tilt_of(direction)
    return np.concatenate([tilt, line[0] @ tilted_axes(tilt[None])[0][0, :, :2]])
