"""A log of a Staubli TX40 at 5 kHz, and published parameters identified from it."""

from __future__ import annotations

import hashlib
import lzma
import re
from dataclasses import dataclass
from importlib.resources.abc import Traversable

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from ..logs import Log
from ..logs.log import LogSource
from ..model import RobotModel
from ..robots import load
from ._files import folder

_PERIOD = 2e-4
_POSITIONS, _TORQUES = "pos_read_data.csv", "curr_data.csv"
_SOURCE = (
    "examples/staubli_TX40 of github.com/thanhndv212/figaroh-plus, commit c3b5172849b7 "
    f"({_POSITIONS}, {_TORQUES}, TX40_bp_5.csv, TX40_ep_5.csv)"
)
_OURS = {
    "fv": "Fv", "fs": "Fc", "off": "offset", "Ia": "Ia", "Iam": "Iam", "fvm": "Fvm", "fsm": "Fcm",
}  # fmt: skip
"""Drive parameters: the source's words and ours."""


@dataclass(frozen=True, slots=True)
class PublishedParameter:
    """A parameter that somebody identified, with relative standard deviations.

    Parameters
    ----------
    name : str
        Of the standard parameter, as `parameter_names` writes it: "ZZ1", "Fc1".
    expression : str
        All that is grouped in it, in the source's words.
    ols, wls : float
        By ordinary and by weighted least squares, SI units.
    ols_percent, wls_percent : float
        Relative standard deviations of these, per cent.
    """

    name: str
    expression: str
    ols: float
    ols_percent: float
    wls: float
    wls_percent: float

    @property
    def ols_deviation(self) -> float:
        """Standard deviation of ``ols``."""
        return abs(self.ols) * self.ols_percent / 100.0

    @property
    def wls_deviation(self) -> float:
        """Standard deviation of ``wls``."""
        return abs(self.wls) * self.wls_percent / 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Tx40Log(Rebuilt):
    """A real log, the robot it is of, and published values of its parameters.

    Parameters
    ----------
    log : Log
        Joint positions and torques, joint side, rad and N m, 45000 samples at 5 kHz.
    model : RobotModel
        ``load("tx40")``: its drives are published ones, its inertia that of a CAD.
    motor_positions, motor_torques : ndarray, shape (45000, 6)
        As recorded: rad and N m of the motors. Read-only.
    published, essential : tuple of PublishedParameter
        The base parameters (the source leaves Ia6 out: 60 of the 61 of the model), and the ones
        that are left when those that are not seen are dropped.
    training, held_out : slice
        Rows of the published split: where it was fitted, and where it was tested.
    source, licence : str
        Where the data come from, and their terms.
    """

    log: Log
    model: RobotModel
    motor_positions: Array
    motor_torques: Array
    published: tuple[PublishedParameter, ...]
    essential: tuple[PublishedParameter, ...]
    training: slice
    held_out: slice
    source: str
    licence: str


def load_tx40() -> Tx40Log:
    """A Staubli TX40 that moved for nine seconds: 45000 positions and torques of six joints.

    Motor angles and motor torques, brought to the joints by the gear ratios and the coupled wrist
    of `RobotModel.transmission`. The source filters nothing; torques are of motor currents. Its
    joints 2 and 3 have zeros of their own (-90 and 90 degrees); those of the model here are the
    maker's, as the motors count.

    Returns
    -------
    Tx40Log
        Log, model, published parameters.

    References
    ----------
    T. Nguyen, figaroh-plus (Apache-2.0), examples/staubli_TX40: root mean square error of its fits
    on rows 29250 to 45000: 6.40 8.21 4.13 1.72 2.65 1.72 N m, the best of each joint. The same
    robot: A. Janot, P.-O. Vandanjon and M. Gautier, Control Engineering Practice 25, 2014.

    Examples
    --------
    >>> data = load_tx40()
    >>> data.log
    <Log: 45000 samples of 6 joints at 5000 Hz, 9 s>
    >>> len(data.published), data.published[0].name, data.published[0].wls
    (60, 'ZZ1', 1.242121)
    """
    data = folder("tx40_log")
    q, q_source = _motors(data / f"{_POSITIONS}.xz", _POSITIONS)
    tau, tau_source = _motors(data / f"{_TORQUES}.xz", _TORQUES)
    model = load("tx40")
    transmission = model.transmission
    assert transmission is not None  # of the catalogue, which this data set is made with
    log = Log(
        _PERIOD,
        q=transmission.to_joint(q),
        tau=np.asarray(np.linalg.solve(transmission.matrix.T, tau.T).T, np.float64),
        names=model.table.joint_names,
        sources=(q_source, tau_source),
    )
    return Tx40Log(
        log=log,
        model=model,
        motor_positions=q,
        motor_torques=tau,
        published=_parameters(data / "TX40_bp_5.csv"),
        essential=_parameters(data / "TX40_ep_5.csv"),
        training=slice(0, 24750),
        held_out=slice(29250, 45000),
        source=_SOURCE,
        licence="Apache-2.0",
    )


def _motors(file: Traversable, name: str) -> tuple[Array, LogSource]:
    """Columns of a packed file, and the name and fingerprint of the file that was packed."""
    text = lzma.decompress(file.read_bytes())
    values = read_only(np.loadtxt(text.decode("ascii").splitlines()[1:], delimiter=","))
    return values, LogSource(name, hashlib.sha256(text).hexdigest(), len(values))


def _parameters(file: Traversable) -> tuple[PublishedParameter, ...]:
    found = []
    for line in file.read_text(encoding="utf-8").splitlines():
        expression, *cells = line.split(",")
        found.append(PublishedParameter(_our_name(expression), expression, *map(float, cells)))
    return tuple(found)


def _our_name(expression: str) -> str:
    """Name of the first term, which the others are grouped with: "Izz1 + 1.0*Ia1" is "ZZ1"."""
    match = re.match(r"([A-Za-z]+)(\d+)", expression)
    assert match is not None  # of the file that is shipped
    word, number = match.groups()
    if word in _OURS:
        return f"{_OURS[word]}{number}"
    return f"{word.removeprefix('I').upper()}{number}"
