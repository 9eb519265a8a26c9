"""The candidate parameters of a calibration, by the book's rules (1.4.2)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from .._choices import chosen
from ..errors import InvalidValueError
from ..geometry import FIXED, PRISMATIC
from ..model import RobotModel
from .extended_table import JOINT_VARIABLE, Element, ExtendedTable, Frame, extend_table
from .parameters import Compliance, ErrorLaw, GeometricParameter, GeometricParameters

NEARLY_PARALLEL = 0.05
"""Sine of the angle between consecutive axes below which beta_j replaces r_j (Hayati)."""
_TURNS = (Element.GAMMA, Element.BETA, Element.ALPHA)
"""Turns about the axes z, y, x of the antecedent frame."""


def candidate_parameters(
    model: RobotModel,
    frames: Sequence[Frame] = (None,),
    *,
    base: bool = True,
    tool: bool = True,
    gains: bool = False,
    couplings: Iterable[tuple[int, int]] = (),
    compliance: Compliance | str = Compliance.NONE,
    eccentricity: bool = False,
) -> GeometricParameters:
    """All parameters that a calibration of this robot may estimate, by the book's rules.

    Each frame of the table has alpha, d, theta and r; where its axis is nearly parallel to the one
    before, beta replaces r (Hayati). The first row has theta and r alone. Branches have gamma and b
    as well. Base and tools have the book's six.

    Parameters
    ----------
    model, frames
        See `robotmodels.calibration`; all measured ends.
    base, tool : bool
        Whether the base, and the ends, have errors.
    gains : bool
        Whether ``q = K q_c + q_0`` has errors in the diagonal of K.
    couplings : iterable of (int, int)
        Pairs (j, i) of frames: the reading of joint i moves joint j.
    compliance : Compliance or str
        Elements that deflect under gravity: ``"none"``, ``"joints"``, ``"links"``,
        ``"isotropic"`` or ``"uniform"`` (see `Compliance`).
    eccentricity : bool
        Whether readings have errors in the sine and cosine of the joint and of twice its value.

    Returns
    -------
    GeometricParameters
        Candidates in the order of preference.

    References
    ----------
    Book section 1.4.2; S. Hayati, IEEE CDC 1983.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> candidate_parameters(load("rx90"), base=False, tool=False).names[5:9]
    ('theta6', 'r1', 'alpha2', 'd2')
    """
    table = extend_table(model, frames)
    on_path = sorted({int(r) for frame in table.frames for r in table.path(frame)})
    of_robot = [r for r in on_path if 1 <= r <= model.f]
    moving = {r: JOINT_VARIABLE[table.sigma[r]] for r in of_robot if table.sigma[r] != FIXED}
    # lengths first: three of them place a point whatever the angles, also near the last axis
    six = [Element.B, Element.D, Element.R, Element.GAMMA, Element.ALPHA, Element.THETA]
    constant = [(r, e) for r in on_path if r > model.f for e in six] if tool else []
    constant += [(0, e) for e in six] if base else []
    constant += moving.items()
    constant += [(r, element) for r in of_robot for element in _elements_of(table, r, on_path)]
    entries = [GeometricParameter(r, e, source=r) for r, e in dict.fromkeys(constant)]
    laws: list[ErrorLaw] = []
    if eccentricity:
        laws += [ErrorLaw.SINE, ErrorLaw.COSINE, ErrorLaw.SINE_2, ErrorLaw.COSINE_2]
    if gains:
        laws.append(ErrorLaw.GAIN)
    compliance = chosen(Compliance, compliance, "compliance")
    if compliance is not Compliance.NONE and not model.inertia.values.any():
        raise InvalidValueError(
            "compliance: it acts on the gravity loads, but this robot has no masses. "
            "Give it inertial parameters (with_inertia), or leave compliance out."
        )
    if compliance in (Compliance.JOINTS, Compliance.LINKS):
        laws.append(ErrorLaw.COMPLIANCE)
    entries += [
        GeometricParameter(r, variable, law, r)
        for law in laws
        for r, variable in moving.items()
        # a linear scale has no axis that its reading could be eccentric to
        if variable is Element.THETA or law in (ErrorLaw.GAIN, ErrorLaw.COMPLIANCE)
    ]
    successors = [[s for s in on_path if table.antecedent[s] == r] for r in range(table.rows)]
    entries += _bending(compliance, successors, list(moving))
    for j, i in couplings:
        if j not in moving or i not in moving or i == j:
            raise InvalidValueError(
                f"couplings: expected pairs of two different moving frames among {list(moving)}, "
                f"got ({j}, {i})."
            )
        entries.append(GeometricParameter(j, moving[j], ErrorLaw.GAIN, i))
    return GeometricParameters(table, tuple(entries))


def chosen_candidates(
    parameters: GeometricParameters | Iterable[str] | None,
    model: RobotModel,
    frames: Sequence[Frame],
    **options: Any,
) -> GeometricParameters:
    """Given candidates, or those of a robot, all or the named ones."""
    if isinstance(parameters, GeometricParameters):
        if parameters.model is not model and parameters.model != model:
            raise InvalidValueError("parameters: they were made for another robot.")
        return parameters
    candidates = candidate_parameters(model, frames, **options)
    return candidates if parameters is None else candidates.subset(parameters)


def _bending(
    compliance: Compliance, successors: list[list[int]], moving: list[int]
) -> list[GeometricParameter]:
    """Compliances of the mount, and of what follows each moving row, about several axes."""
    law = ErrorLaw.COMPLIANCE
    mount = [(0, turn, 0) for turn in _TURNS]
    if compliance is Compliance.LINKS:
        links = [(s, turn, r) for r in moving for s in successors[r] for turn in _TURNS[1:]]
        return [GeometricParameter(s, turn, law, r) for s, turn, r in [*mount, *links]]
    if compliance not in (Compliance.ISOTROPIC, Compliance.UNIFORM):
        return []
    joints = [[(s, turn, r) for s in successors[r] for turn in _TURNS] for r in moving]
    if compliance is Compliance.UNIFORM:
        joints = [[action for actions in joints for action in actions]]
    return [
        GeometricParameter(row, element, law, source, tuple(also))
        for (row, element, source), *also in [mount, *joints]
    ]


def _elements_of(table: ExtendedTable, row: int, on_path: list[int]) -> list[Element]:
    """Elements of a row of the robot that may have errors."""
    antecedent = int(table.antecedent[row])
    branch = row != next(r for r in on_path if table.antecedent[r] == antecedent)
    if antecedent == 0 and not branch:
        return [Element.THETA, Element.R]
    elements = [Element.ALPHA, Element.D, Element.THETA, Element.R]
    beta, alpha = table.nominal[row, [Element.BETA, Element.ALPHA]]
    if abs(np.cos(beta) * np.cos(alpha)) > np.sqrt(1.0 - NEARLY_PARALLEL**2):
        elements.insert(2, Element.BETA)
        if table.sigma[row] != PRISMATIC:
            elements.remove(Element.R)
    return [*elements, Element.GAMMA, Element.B] if branch else elements
