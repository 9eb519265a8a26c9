"""Whether a robot that was identified keeps its torques through a URDF."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from ...dynamics import idm
from ...errors import InvalidValueError, UrdfWarning
from ...model import RobotModel, check_model, to_urdf

_RATE = 2.0
"""Velocities and accelerations are drawn up to this, per second and per second squared."""
_STROKE = 0.5
"""Positions of prismatic joints are drawn up to this, metres."""


@dataclass(frozen=True, slots=True)
class UrdfParity:
    """How well torques agree after a URDF was written and read again.

    Parameters
    ----------
    links : float
        Largest difference of torques without drives, relative to the largest torque.
    drives : float
        The same with drives: what a URDF has no place for is put back from the model first.
    friction : float
        Largest difference of Fv and Fc as the URDF holds them, relative to the largest of each.
    lost : tuple of str
        What has no place in a URDF, and with what it was put back here.

    Examples
    --------
    >>> UrdfParity(0.0, 0.0, 0.0, ()).links
    0.0
    """

    links: float
    drives: float
    friction: float
    lost: tuple[str, ...]


def urdf_parity(
    model: RobotModel, samples: int = 100, rng: np.random.Generator | None = None
) -> UrdfParity:
    """Write a robot as a URDF, read it again, and compare torques on random motion.

    Parameters
    ----------
    model : RobotModel
        With real bodies, such as `ConsistentFit.of` gives it.
    samples : int
        Number of random positions, velocities and accelerations.
    rng : numpy.random.Generator, optional
        Default a fixed one.

    Returns
    -------
    UrdfParity
        Differences, and what a URDF does not hold.

    Raises
    ------
    InvalidValueError
        No samples.
    UrdfError
        A transmission that a URDF cannot say.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> urdf_parity(load("rx90")).links < 1e-9
    True
    """
    check_model(model)
    if samples < 1:
        raise InvalidValueError(f"samples: expected at least one, got {samples}.")
    rng = np.random.default_rng(0) if rng is None else rng
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        text = to_urdf(model)
    lost = tuple(str(one.message) for one in caught if issubclass(one.category, UrdfWarning))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UrdfWarning)
        again = RobotModel.from_urdf(text, dynamics=True)
    # joints may come in another order: the same names are the same joints
    names = [model.table.names[j] for j in model.table.joint_rows]
    read = [again.table.names[j] for j in again.table.joint_rows]
    order = [names.index(name) for name in read]
    again = again.with_gravity(model.gravity)
    sliding = model.table.sigma[model.table.joint_rows] == 1
    q = rng.uniform(-np.pi, np.pi, (samples, model.n)) * np.where(sliding, _STROKE / np.pi, 1.0)
    v, a = rng.uniform(-_RATE, _RATE, (2, samples, model.n))
    state = [x[:, order] for x in (q, v, a)]
    friction = max(
        _relative(getattr(again.drive, kind), getattr(model.drive, kind)[order])
        for kind in ("Fv", "Fc")
    )
    expected = idm(model, q, v, a, drive=False)[:, order]
    links = _relative(idm(again, *state, drive=False), expected)
    # rotors, offsets and coupled motors are added as they are in the model: what the URDF keeps
    # of the drives is its friction
    own = idm(model, q, v, a)[:, order] - expected
    kept = v * model.drive.Fv + np.sign(v) * model.drive.Fc
    read_drive = again.drive
    theirs = state[1] * read_drive.Fv + np.sign(state[1]) * read_drive.Fc
    added = own - kept[:, order]
    whole = idm(again, *state, drive=False) + theirs + added
    return UrdfParity(links, _relative(whole, expected + own), friction, lost)


def _relative(found: np.ndarray, expected: np.ndarray) -> float:
    largest = float(np.abs(expected).max(initial=0.0))
    return float(np.abs(found - expected).max(initial=0.0)) / (largest or 1.0)
