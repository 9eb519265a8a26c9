"""Robots by name: the catalogue's own, and ``erd:<name>`` for the arms of example-robot-data."""

from __future__ import annotations

from importlib import import_module

from ..errors import RobotNotFoundError
from ..model import RobotModel
from .erd import ERD_ARMS, load_erd

ERD_PREFIX = "erd:"
"""Names that start with it are looked up in the installed example-robot-data."""

MODULES: dict[str, tuple[str, ...]] = {
    "exercise": ("lab_rr", "lab_rrt", "lab_trr"),
    "generic": ("planar_2r", "planar_3r", "gantry"),
    "staubli": ("rx90", "tx40"),
    "unimation": ("puma560",),
    "stanford": ("stanford_arm",),
    "adept": ("cobra_s600",),
    "universal_robots": ("ur5", "ur3e", "ur5e", "ur10e", "ur16e"),
    "kuka": ("kr6_r900", "lwr4_plus", "iiwa14"),
    "abb": ("irb120", "irb140", "irb6640"),
    "fanuc": ("crx10ia", "crx10ia_l"),
    "franka": ("panda",),
    "ufactory": ("xarm5", "xarm6"),
}
"""Module of this package, and the robots it builds: one function of that name each."""

_MODULE_OF = {name: module for module, names in MODULES.items() for name in names}


def robots() -> tuple[str, ...]:
    """Names that `load` knows, without those of example-robot-data.

    Returns
    -------
    tuple of str
        Simple ones first, then by maker.

    Examples
    --------
    >>> "rx90" in robots(), len(robots()) >= 24
    (True, True)
    """
    return tuple(_MODULE_OF)


def load(name: str) -> RobotModel:
    """Load a robot of the catalogue; also called model or robot factory elsewhere.

    Parameters
    ----------
    name : str
        One of `robots`, for example ``"rx90"``; or ``"erd:<name>"`` for an arm of the package
        example-robot-data by its name there, for example ``"erd:ur5"``, or one of its arms on a
        mobile base, for example ``"erd:pr2_left_arm"``.

    Returns
    -------
    RobotModel
        The robot. Where its numbers come from is in the docstring of the function that builds
        it: ``help(robotmodels.robots.staubli.rx90)``.

    Raises
    ------
    RobotNotFoundError
        The name is unknown; the nearest names are listed.
    MissingExtraError
        An ``erd:`` name, and the data of example-robot-data are not installed.

    Examples
    --------
    >>> load("rx90").n
    6
    """
    if isinstance(name, str) and name.startswith(ERD_PREFIX):
        return load_erd(name.removeprefix(ERD_PREFIX))
    module = _MODULE_OF.get(name) if isinstance(name, str) else None
    if module is None:
        known = (*robots(), *(ERD_PREFIX + arm for arm in ERD_ARMS))
        raise RobotNotFoundError(
            "robot", name, known, "A URDF file is read with RobotModel.from_urdf(path)."
        )
    return getattr(import_module(f".{module}", __package__), name)()
