"""Two robots combined into one tree, for measurements of links between them."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from .. import se3
from .._arrays import Array
from ..drive import DriveParameters, Transmission
from ..errors import InvalidValueError
from ..geometry import FIXED, DHTable
from ..inertia import InertialParameters
from ..model import RobotModel, check_model
from ..urdf import NamedFrame
from .extended_table import Element, six_parameters_of

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
    row, turn = six_parameters_of(se3.inverse(model_a.base) @ place, is_base=True)
    rows = [row]
    if not np.array_equal(turn, np.eye(4)):
        # z_0 nearly parallel to the other: the constant quarter turn is a separate frame
        rows.insert(0, six_parameters_of(turn, is_base=True)[0])
    table = _table(model_a.table, model_b.table, rows, (a, b))
    shift = model_a.f + len(rows)
    frames, taken = [], set(table.names)
    for prefix, robot, up in ((a, model_a, 0), (b, model_b, shift)):
        ends = [NamedFrame("tool", robot.tip, robot.tool), *robot.frames]
        ends += [NamedFrame("base", 0, np.eye(4))] if prefix == a else []
        for frame in ends:
            # R_0 of the second robot is the frame that it stands on
            name = _free(f"{prefix}_{frame.name}", taken)
            frames.append(replace(frame, name=name, parent=frame.parent + up))
    bodies = model_a.inertia.values, np.zeros((len(rows), 10)), model_b.inertia.values
    drives = _joined(model_a.drive, model_b.drive, [x.name for x in fields(DriveParameters)])
    postures = model_a.configurations, model_b.configurations
    whole = RobotModel.from_table(
        table,
        inertia=InertialParameters(np.vstack(bodies)),
        drive=DriveParameters(**drives),
        base=model_a.base,
        tool=model_a.tool,
        tip=model_a.tip,
        gravity=model_a.gravity,
        transmission=_transmission(model_a, model_b),
        name=f"{model_a.name}_{model_b.name}",
        configurations={
            key: np.concatenate([q, postures[1][key]])
            for key, q in postures[0].items()
            if key in postures[1]
        },
    )
    moved = (replace(visual, frame=visual.frame + shift) for visual in model_b.visuals)
    notes = (f"{x}: {note}" for x, m in ((a, model_a), (b, model_b)) for note in m.notes)
    return replace(
        whole, frames=tuple(frames), visuals=(*model_a.visuals, *moved), notes=tuple(notes)
    )


def _joined(one: Any, other: Any, words: Any) -> dict[str, Any]:
    """Attributes of two objects, one behind the other."""
    return {word: np.concatenate([getattr(one, word), getattr(other, word)]) for word in words}


def _table(
    first: DHTable, second: DHTable, stand: list[Array], prefixes: tuple[str, str]
) -> DHTable:
    """Rows of the first table, of the stand of the second robot, and of the second table."""
    count = len(stand)
    names = [[f"{x}_{name}" for name in t.names]
             for x, t in zip(prefixes, (first, second), strict=True)]  # fmt: skip
    taken = {*names[0], *names[1]}
    standing = [_free(f"{prefixes[1]}_{name}", taken) for name in ("turn", "base")[-count:]]
    between = {element.word: [row[element] for row in stand] for element in Element}
    between |= {"sigma": [FIXED] * count, "mu": [0] * count}
    between["antecedent"] = [0, *range(first.f + 1, first.f + count)]
    columns: dict[str, Any] = {
        word: np.concatenate([getattr(first, word), rows, getattr(second, word)])
        for word, rows in between.items()
    }
    columns["antecedent"][-second.f :] += first.f + count
    limits = _joined(first, second, ("lower", "upper", "velocity", "effort"))
    return DHTable(names=[*names[0], *standing, *names[1]], **columns, **limits)


def _transmission(*models: RobotModel) -> Transmission | None:
    if all(m.transmission is None for m in models):
        return None
    one, other = (m.transmission or Transmission(np.eye(m.n)) for m in models)
    K = block_diag(one.matrix, other.matrix)
    return Transmission(K, **_joined(one, other, ("offset", "Iam", "Fvm", "Fcm")))


def _free(name: str, taken: set[str]) -> str:
    """The name, made different from those taken, and taken."""
    while name in taken:
        name += "_link"
    taken.add(name)
    return name
