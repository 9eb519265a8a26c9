"""The parameters that a calibration of a robot may look at, by the book's rules."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .._choices import chosen
from ..errors import InvalidValueError
from ..geometry import FIXED, PRISMATIC, REVOLUTE
from ..model import RobotModel
from .extended_table import Element, Frame, Skeleton, skeleton_of
from .parameters import Compliance, ErrorLaw, GeometricParameter, GeometricParameters

NEARLY_PARALLEL = 0.05
"""Sine of the angle between consecutive axes below which r_j gives way to beta_j (Hayati)."""
_TURNS = (Element.GAMMA, Element.BETA, Element.ALPHA)
"""Turns about the axes z, y, x of the frame that a row stands on."""


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
    """All parameters that a calibration of this robot may look at, by the book's rules.

    Each frame of the table has alpha, d, theta and r; where its axis is parallel to the one
    before, or nearly so, beta takes the place of r (Hayati), because the common perpendicular is
    then anywhere. The first row has theta and r alone, as the place of the robot says the rest.
    Branches have gamma and b as well. Base and tools have the book's six.

    Parameters
    ----------
    model : RobotModel
        The robot.
    frames : sequence of str, int or None
        The measured ends; None is the tool.
    base, tool : bool
        Whether the place of the robot, and those of the ends, may be off.
    gains : bool
        Whether ``q = K q_c + q_0`` has errors in the diagonal of K.
    couplings : iterable of (int, int)
        Pairs (j, i) of frames: the reading of joint i moves joint j.
    compliance : Compliance or str
        What gives way under gravity: ``"none"``, ``"joints"``, ``"links"``,
        ``"isotropic"`` or ``"uniform"`` (see `Compliance`).
    eccentricity : bool
        Whether readings have errors in the sine and cosine of the joint and of twice its value.

    Returns
    -------
    GeometricParameters
        Candidates in the order of preference.

    Raises
    ------
    InvalidValueError, FrameNotFoundError
        Not a model; unknown frames; a coupling of a frame that does not move; compliance asked of
        a robot without masses.

    References
    ----------
    Seed book section 1.4.2; S. Hayati, IEEE CDC 1983.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> candidate_parameters(load("rx90"), base=False, tool=False).names[5:9]
    ('theta6', 'r1', 'alpha2', 'd2')
    """
    skeleton = skeleton_of(model, frames)
    on_path = sorted({int(r) for frame in skeleton.frames for r in skeleton.path(frame)})
    table_rows = [r for r in on_path if 1 <= r <= model.f]
    moving = [r for r in table_rows if skeleton.sigma[r] != FIXED]
    own = {REVOLUTE: Element.THETA, PRISMATIC: Element.R}
    # lengths first: three of them place a point whatever the angles, also near the last axis
    six = [Element.B, Element.D, Element.R, Element.GAMMA, Element.ALPHA, Element.THETA]
    places = [(r, e) for r in on_path if r > model.f for e in six] if tool else []
    places += [(0, e) for e in six] if base else []
    rest = [(r, own[int(skeleton.sigma[r])]) for r in moving]
    for row in table_rows:
        rest += [(row, element) for element in _elements_of(skeleton, row, on_path)]
    entries = [GeometricParameter(r, e, source=r) for r, e in dict.fromkeys([*places, *rest])]
    laws: list[ErrorLaw] = []
    if eccentricity:
        laws += [ErrorLaw.SINE, ErrorLaw.COSINE, ErrorLaw.SINE_2, ErrorLaw.COSINE_2]
    if gains:
        laws.append(ErrorLaw.GAIN)
    compliance = chosen(Compliance, compliance, "compliance")
    if compliance is not Compliance.NONE and not model.inertia.values.any():
        raise InvalidValueError(
            "compliance: the robot gives way under gravity, but this one has no masses. "
            "Give it inertial parameters (with_inertia), or leave compliance out."
        )
    if compliance in (Compliance.JOINTS, Compliance.LINKS):
        laws.append(ErrorLaw.COMPLIANCE)
    for law in laws:
        for r in moving:
            kind = int(skeleton.sigma[r])
            if kind == PRISMATIC and law not in (ErrorLaw.GAIN, ErrorLaw.COMPLIANCE):
                continue  # a linear scale has no turn to be off its axis
            entries.append(GeometricParameter(r, own[kind], law, r))
    if compliance is Compliance.LINKS:
        bent = [(0, e, 0) for e in _TURNS]
        bent += [
            (s, e, r) for r in moving for s in _successors(skeleton, on_path, r) for e in _TURNS[1:]
        ]
        entries += [GeometricParameter(s, e, ErrorLaw.COMPLIANCE, r) for s, e, r in bent]
    if compliance in (Compliance.ISOTROPIC, Compliance.UNIFORM):
        at_mount = [(0, e, 0) for e in _TURNS]
        at_joints = [
            [(s, e, r) for s in _successors(skeleton, on_path, r) for e in _TURNS] for r in moving
        ]
        if compliance is Compliance.UNIFORM:
            at_joints = [[action for actions in at_joints for action in actions]]
        for (row, element, source), *also in [at_mount, *at_joints]:
            law = ErrorLaw.COMPLIANCE
            entries.append(GeometricParameter(row, element, law, source, tuple(also)))
    for j, i in couplings:
        if j not in moving or i not in moving or i == j:
            raise InvalidValueError(
                f"couplings: expected pairs of two different moving frames among {moving}, got "
                f"({j}, {i})."
            )
        entries.append(GeometricParameter(j, own[int(skeleton.sigma[j])], ErrorLaw.GAIN, i))
    return GeometricParameters(skeleton, tuple(entries))


def _successors(skeleton: Skeleton, on_path: list[int], row: int) -> list[int]:
    return [s for s in on_path if skeleton.antecedent[s] == row]


def _elements_of(skeleton: Skeleton, row: int, on_path: list[int]) -> list[Element]:
    """Elements of a row of the table that may be off, besides its joint's own."""
    antecedent = int(skeleton.antecedent[row])
    siblings = [r for r in on_path if skeleton.antecedent[r] == antecedent]
    branch = row != siblings[0]
    if antecedent == 0 and not branch:
        return [Element.THETA, Element.R]
    elements = [Element.ALPHA, Element.D, Element.THETA, Element.R]
    beta, alpha = skeleton.nominal[row, [Element.BETA, Element.ALPHA]]
    along = abs(np.cos(beta) * np.cos(alpha))
    if along > np.sqrt(1.0 - NEARLY_PARALLEL**2):
        elements.insert(2, Element.BETA)
        if skeleton.sigma[row] != PRISMATIC:
            elements.remove(Element.R)
    if branch:
        elements += [Element.GAMMA, Element.B]
    return elements
