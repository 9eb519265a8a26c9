"""Two robots as one tree, so that links between them are measured like everything else."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array
from ..drive import DriveParameters, Transmission
from ..errors import InvalidValueError
from ..geometry import FIXED, DHTable
from ..inertia import InertialParameters
from ..model import RobotModel, check_model
from ..urdf import NamedFrame
from .extended_table import base_parameters_of

_COLUMNS = ("gamma", "b", "beta", "alpha", "d", "theta", "r")
_SAME_GRAVITY = 1e-6


def combine_arms(
    model_a: RobotModel,
    model_b: RobotModel,
    base_b: Any = None,
    names: tuple[str, str] = ("a", "b"),
) -> RobotModel:
    """One robot with the arms of two: its joints are those of the first, then of the second.

    The base of the second is a fixed frame ``b_base`` of the common table, whose parameters give
    its pose. Ends are called ``a_tool`` and ``b_tool``, frames and joints keep their names behind
    ``a_`` and ``b_``. The tool of the whole is that of the first robot.

    Parameters
    ----------
    model_a, model_b : RobotModel
        The robots.
    base_b : pose, shape (4, 4), optional
        Z of the second, the place of its R_0 in the world of the first, metres; default its own.
        A robot read from a URDF that is moved by T stands at ``T @ model_b.base``.
    names : tuple of two str
        Prefixes, instead of ``a`` and ``b``.

    Returns
    -------
    RobotModel
        A tree with n_a + n_b joints. Configurations that both robots name are kept.

    Examples
    --------
    >>> import robotmodels as rm
    >>> pair = combine_arms(rm.load("rx90"), rm.load("rx90"), rm.se3.translation(1.2, 0.0, 0.0))
    >>> pair.n, [round(float(rm.dgm(pair, np.zeros(12), f)[0, 3]), 3) for f in ("a_tool", "b_tool")]
    (12, [0.45, 1.65])
    """
    check_model(model_a)
    check_model(model_b)
    a, b = (str(name) for name in names)
    if not a or not b or a == b:
        raise InvalidValueError(f"names: expected two different texts, got {names!r}.")
    if np.abs(model_a.gravity - model_b.gravity).max() > _SAME_GRAVITY:
        raise InvalidValueError(
            f"model_b: its gravity {model_b.gravity.tolist()} in the world is not that of model_a, "
            f"{model_a.gravity.tolist()}. Give both the same with with_gravity; base_b is the "
            "place of the second robot."
        )
    place = model_b.base if base_b is None else se3.as_single_pose(base_b, "base_b")
    stand = base_parameters_of(se3.inverse(model_a.base) @ place)
    rows = [stand.elements]
    if not np.array_equal(stand.turn, np.eye(4)):
        # z_0 nearly parallel to the other: the constant quarter turn is a separate frame
        rows.insert(0, base_parameters_of(se3.rotation("x", -np.pi / 2)).elements)
    table = _table(model_a.table, model_b.table, rows, (a, b))
    shift = model_a.f + len(rows)
    frames, taken = [], set(table.names)
    for prefix, robot, up in ((a, model_a, 0), (b, model_b, shift)):
        ends = [NamedFrame("tool", robot.tip, robot.tool), *robot.frames]
        ends += [NamedFrame("base", 0, np.eye(4))] if prefix == a else []
        for frame in ends:
            name = _free(f"{prefix}_{frame.name}", taken)
            # R_0 of the second robot is the frame that it stands on
            frames.append(replace(frame, name=name, parent=frame.parent + up))
    bodies = model_a.inertia.values, np.zeros((len(rows), 10)), model_b.inertia.values
    common = model_a.configurations.keys() & model_b.configurations.keys()
    whole = RobotModel.from_table(
        table,
        inertia=InertialParameters(np.vstack(bodies)),
        drive=DriveParameters(
            **_joined(model_a.drive, model_b.drive, [x.name for x in fields(DriveParameters)])
        ),
        base=model_a.base,
        tool=model_a.tool,
        tip=model_a.tip,
        gravity=model_a.gravity,
        transmission=_transmission(model_a, model_b),
        name=f"{model_a.name}_{model_b.name}",
        configurations={
            key: np.concatenate([q, model_b.configurations[key]])
            for key, q in model_a.configurations.items()
            if key in common
        },
    )
    moved = (replace(visual, frame=visual.frame + shift) for visual in model_b.visuals)
    return replace(
        whole,
        frames=tuple(frames),
        visuals=(*model_a.visuals, *moved),
        notes=(*(f"{a}: {n}" for n in model_a.notes), *(f"{b}: {n}" for n in model_b.notes)),
    )


def _joined(one: Any, other: Any, words: Any) -> dict[str, Any]:
    """Attributes of two objects, one behind the other."""
    return {word: np.concatenate([getattr(one, word), getattr(other, word)]) for word in words}


def _table(
    first: DHTable, second: DHTable, stand: list[Array], prefixes: tuple[str, str]
) -> DHTable:
    """Rows of the first table, of the stand of the second robot, and of the second table."""
    a, b = prefixes
    count = len(stand)
    shift = first.f + count
    names_a, names_b = [f"{a}_{x}" for x in first.names], [f"{b}_{x}" for x in second.names]
    taken = {*names_a, *names_b}
    standing = [_free(f"{b}_{name}", taken) for name in ("turn", "base")[-count:]]
    columns: dict[str, Any] = {
        word: np.concatenate(
            [getattr(first, word), [row[k] for row in stand], getattr(second, word)]
        )
        for k, word in enumerate(_COLUMNS)
    }
    chain = [0, *range(first.f + 1, shift)]
    return DHTable(
        antecedent=np.concatenate([first.antecedent, chain, second.antecedent + shift]),
        sigma=np.concatenate([first.sigma, [FIXED] * count, second.sigma]),
        mu=np.concatenate([first.mu, [0] * count, second.mu]),
        names=[*names_a, *standing, *names_b],
        **columns,
        **_joined(first, second, ("lower", "upper", "velocity", "effort")),
    )


def _transmission(model_a: RobotModel, model_b: RobotModel) -> Transmission | None:
    if model_a.transmission is None and model_b.transmission is None:
        return None
    one, other = (
        Transmission(np.eye(m.n)) if m.transmission is None else m.transmission
        for m in (model_a, model_b)
    )
    K = np.zeros((one.n + other.n, one.n + other.n))
    K[: one.n, : one.n], K[one.n :, one.n :] = one.matrix, other.matrix
    return Transmission(K, **_joined(one, other, ("offset", "Iam", "Fvm", "Fcm")))


def _free(name: str, taken: set[str]) -> str:
    """The name, made different from those taken, and taken."""
    while name in taken:
        name += "_link"
    taken.add(name)
    return name
