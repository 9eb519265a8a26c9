"""Robots by name: the catalogue's own, and ``erd:<name>`` for the arms of example-robot-data."""

from __future__ import annotations

from collections.abc import Callable
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

CATALOGUE: tuple[str, ...] = tuple(_MODULE_OF)
"""The robots that this package builds itself: simple ones first, then by maker."""


def robots() -> tuple[str, ...]:
    """Names that `load` knows.

    Returns
    -------
    tuple of str
        The catalogue's own, then ``erd:<name>`` for the arms of example-robot-data.

    Examples
    --------
    >>> "rx90" in robots(), "erd:ur5" in robots()
    (True, True)
    """
    return (*CATALOGUE, *(ERD_PREFIX + arm for arm in ERD_ARMS))


def title(name: str) -> str:
    """What a name stands for: the first line of what builds it.

    Parameters
    ----------
    name : str
        One of `robots`.

    Returns
    -------
    str
        A sentence.

    Raises
    ------
    RobotNotFoundError
        The name is unknown.

    Examples
    --------
    >>> title("rx90")
    'Staubli RX-90, the running example of the seed book.'
    """
    if isinstance(name, str) and name.removeprefix(ERD_PREFIX) in ERD_ARMS and ":" in name:
        arm = ERD_ARMS[name.removeprefix(ERD_PREFIX)]
        part = f", from {arm.base_link} to {arm.tip_link}" if arm.base_link else ""
        return f"example-robot-data: {arm.urdf}{part}."
    return str(_builder(name).__doc__).splitlines()[0].replace("`", "")


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
    return _builder(name)()


def _builder(name: str) -> Callable[[], RobotModel]:
    module = _MODULE_OF.get(name) if isinstance(name, str) else None
    if module is None:
        raise RobotNotFoundError(
            "robot",
            name,
            robots(),
            "All names: robots(). A URDF file is read with RobotModel.from_urdf(path).",
        )
    return getattr(import_module(f".{module}", __package__), name)
