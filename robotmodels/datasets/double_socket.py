"""Two arms of the Panda kind that put a ball into two sockets: calibration without a device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from .._arrays import Array, Rebuilt, as_exact, read_only
from ..dynamics import with_payload
from ..errors import InvalidValueError, nearest_names
from ..model import RobotModel
from ..robots import load
from ._files import folder, numbers

_ROBOTS = ("panda_1", "panda_2")
_DISTANCE = 0.05
_HAND = 0.73, (-0.01, 0.0, 0.03), np.diag((0.001, 0.0025, 0.0017))
"""Mass, kg, centre of mass and inertia of the Panda's hand."""
_SOURCE = (
    "Franzese and others, arXiv:2503.12584 (2025); data of "
    "github.com/platonics-delft/kinematics_calibration, commit 05a05ab4cbbe"
)


@dataclass(frozen=True, slots=True, eq=False)
class DoubleSocket(Rebuilt):
    """Readings of an arm whose ball sits in one of two sockets, at several places.

    Parameters
    ----------
    robot, urdf : str
        Which arm; the nominal robot as URDF, meshes and inertia left out by its authors.
    places : mapping of str to (ndarray, ndarray)
        For each place of the pair of sockets in the room: readings of the joints with the ball in
        socket 0 and in socket 1, shapes ``(N, 7)``, rad. Read-only.
    distance : float
        Of the two sockets, m.
    source, licence : str
        Where the data come from, and their terms.
    """

    robot: str
    urdf: str
    places: Mapping[str, tuple[Array, Array]]
    distance: float
    source: str
    licence: str

    def __post_init__(self) -> None:
        places = {
            name: tuple(read_only(as_exact(q, (len(q), 7), name)) for q in sockets)
            for name, sockets in self.places.items()
        }
        object.__setattr__(self, "places", MappingProxyType(places))

    def __reduce__(self) -> tuple[object, ...]:  # a mapping proxy does not pickle
        values = (self.robot, self.urdf, dict(self.places), self.distance)
        return type(self), (*values, self.source, self.licence)

    @property
    def model(self) -> RobotModel:
        """The nominal robot with masses, its tool the centre of the ball.

        The URDF has no masses: the catalogue's and those of the hand (C. Gaz and others, IEEE RA-L
        4(4), 2019) are added, for compliance under gravity. Ball and holder have none.
        """
        bare = RobotModel.from_urdf(self.urdf, tip_link="ball_link")
        bare = bare.with_inertia(load("panda").inertia)
        return with_payload(bare, *_HAND, frame="panda_hand")

    @property
    def blocks(self) -> int:
        """Number of readings of all places."""
        return sum(len(q) for sockets in self.places.values() for q in sockets)


def panda_double_socket(robot: str = "panda_1") -> DoubleSocket:
    """The double socket with a Panda: 182 readings at 3 places, or 559 at 9.

    A ball on the flange sits in one of two sockets that are 50 mm apart, printed as one part; the
    hand is turned about it, and only the joints are read. No device measures anything. The two
    arms may be the same one on two days: their identified parameters agree within standard errors.
    At the place ``high`` of panda_2 the socket was moved during the recording.

    Parameters
    ----------
    robot : str
        ``"panda_1"`` (places front, right, back-high) or ``"panda_2"``.

    Returns
    -------
    DoubleSocket
        URDF, readings by place, distance of the sockets.

    References
    ----------
    Franzese and others, arXiv:2503.12584, 2025: mean distance from the sockets 8.28 mm with the
    nominal robot, 0.168 mm after calibration where it was fitted and 0.347 mm elsewhere.

    Examples
    --------
    >>> data = panda_double_socket()
    >>> {name: (len(a), len(b)) for name, (a, b) in data.places.items()}
    {'back-high': (30, 30), 'front': (30, 32), 'right': (30, 30)}
    >>> data.model.n, data.distance, data.licence
    (7, 0.05, 'MIT')
    """
    if robot not in _ROBOTS:
        near = ", ".join(nearest_names(str(robot), _ROBOTS)) or ", ".join(_ROBOTS)
        raise InvalidValueError(f"robot: expected one of {_ROBOTS}, got {robot!r}; near it: {near}")
    data = folder("panda_double_socket")
    places = {}
    found = [entry for entry in (data / robot).iterdir() if entry.is_dir()]
    for place in sorted(found, key=lambda entry: entry.name):
        sockets = [numbers(place / f"hole_{hole}.csv")[:, :7] for hole in (0, 1)]
        places[place.name] = (sockets[0], sockets[1])
    urdf = (data / "panda.urdf").read_text(encoding="utf-8")
    return DoubleSocket(robot, urdf, places, _DISTANCE, _SOURCE, "MIT")
