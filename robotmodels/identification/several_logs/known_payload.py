"""A load that was weighed, and the log of the robot that carries it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_exact, as_floats, read_only
from ...errors import InvalidValueError, ShapeError
from ...inertia import PARAMETERS, InertialParameters
from ...logs import Log


@dataclass(frozen=True, slots=True, init=False, eq=False)
class KnownPayload(Rebuilt):
    """What is known of a load: its mass at least.

    Parameters
    ----------
    mass : float
        Kilograms, positive.
    com : array_like, shape (3,), optional
        Centre of mass in the frame, metres; default not known.
    inertia : array_like, shape (3, 3), optional
        About the centre of mass, in the axes of the frame, kg m^2; default not known. It needs
        ``com``.
    frame : str or int, optional
        Frame that carries the load; default the tool.

    Raises
    ------
    InvalidValueError, ShapeError, InertiaError
        A mass that is not positive, an inertia without centre of mass, wrong shapes.

    Examples
    --------
    >>> disc = KnownPayload(2.0, com=[0.0, 0.0, 0.1])
    >>> [name for name, known in zip(PARAMETERS, disc.known) if known]
    ['MX', 'MY', 'MZ', 'M']
    """

    mass: float
    com: Array | None
    inertia: Array | None
    frame: str | int | None

    def __init__(
        self,
        mass: float,
        com: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
        frame: str | int | None = None,
    ) -> None:
        m = as_floats(mass, "mass")
        if m.ndim != 0:
            raise ShapeError(f"mass: expected one number, got shape {m.shape}.")
        if not m > 0.0:
            raise InvalidValueError(
                f"mass: expected a positive mass, got {float(m)} kg; what has no load is a log "
                "without payload."
            )
        if inertia is not None and com is None:
            raise InvalidValueError(
                "com: an inertia is about the centre of mass; give com= with it, or neither."
            )
        object.__setattr__(self, "mass", float(m))
        point = None if com is None else read_only(as_exact(com, (3,), "com"))
        object.__setattr__(self, "com", point)
        tensor = None if inertia is None else read_only(as_exact(inertia, (3, 3), "inertia"))
        object.__setattr__(self, "inertia", tensor)
        object.__setattr__(self, "frame", frame)
        if tensor is not None:
            _ = self.parameters  # a tensor that is not symmetric is refused here

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which of ``XX XY XZ YY YZ ZZ MX MY MZ M`` are known, shape (10,)."""
        tensor, point = self.inertia is not None, self.com is not None
        return np.array([tensor] * 6 + [point] * 3 + [True])

    @property
    def parameters(self) -> Array:
        """The ten parameters about the frame's origin, zero where they are not known."""
        point = np.zeros(3) if self.com is None else self.com
        tensor = np.zeros((3, 3)) if self.inertia is None else self.inertia
        row = InertialParameters.from_com([self.mass], point[None], tensor[None]).values[0]
        return np.where(self.known, row, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class LoadedLog:
    """A log of the robot with a load of known mass.

    Parameters
    ----------
    log : Log
        The log.
    payload : KnownPayload
        What is known of the load. Logs that share one object share its unknown parameters.
    """

    log: Log
    payload: KnownPayload

    @property
    def unknown(self) -> tuple[str, ...]:
        """Names of the payload's parameters that are not known."""
        pairs = zip(PARAMETERS, self.payload.known, strict=True)
        return tuple(name for name, known in pairs if not known)
