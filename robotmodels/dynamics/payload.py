"""Payload of a robot: an additional body on a link.

Parameters
----------
mass : float
    Kilograms, not negative.
com : array_like, shape (3,)
    Centre of mass in the frame, metres.
inertia : array_like, shape (3, 3), optional
    Symmetric tensor about the centre of mass, in the axes of the frame, kg m^2; default a point
    mass.
frame : str or int, optional
    Name or number of the frame that ``com`` and ``inertia`` are given in and that carries the
    body; default the tool.

Returns
-------
RobotModel
    A new model; its tool and its named postures are those of the old one.

Raises
------
InertiaError, InvalidValueError, FrameNotFoundError, ShapeError
    The payload is not physical; the frame is the base's, whose bodies load no joint, or there
    is no such frame; NaN or infinity; arguments of the wrong shape.

References
----------
Book section 1.5.1; W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload
inertial parameters of industrial manipulators", IEEE ICRA 2007.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import as_exact
from ..errors import InertiaError, InvalidValueError
from ..inertia import InertialParameters, InertiaWarning
from ..inertia.consistency import pseudo_inertia
from ..model import RobotModel, check_model


def with_payload(
    model: RobotModel,
    mass: float,
    com: ArrayLike,
    inertia: ArrayLike | None = None,
    frame: str | int | None = None,
) -> RobotModel:
    """Robot with an additional body rigidly fixed to one of its frames.

    Shapes: com (3,), inertia (3, 3).
    """
    return _with_body(model, _body(mass, com, inertia), frame, 1.0)


def without_payload(
    model: RobotModel,
    mass: float,
    com: ArrayLike,
    inertia: ArrayLike | None = None,
    frame: str | int | None = None,
) -> RobotModel:
    """The robot without a body: undoes `with_payload` with the same arguments.

    The body is subtracted from the link that carries it; parameters below the rounding of the
    subtraction become zero. An `InertiaWarning` names a link that is not physical without it.
    Shapes: com (3,), inertia (3, 3).

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r")
    >>> payload = 2.0, [0.1, 0.0, 0.0]
    >>> loaded = with_payload(arm, *payload)
    >>> float(loaded.inertia.mass[1]), without_payload(loaded, *payload).inertia == arm.inertia
    (2.0, True)
    """
    return _with_body(model, _body(mass, com, inertia), frame, -1.0)


def _with_body(
    model: RobotModel, body: InertialParameters, frame: str | int | None, sign: float
) -> RobotModel:
    check_model(model)
    place = model.twin.frame(frame)
    if place.parent == 0:
        raise InvalidValueError(
            f"frame: {frame!r} is fixed to the base, where a body loads no joint; give a frame of "
            "a link."
        )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = place.rotation, place.position
    row = body.moved(pose[None]).values[0]
    values = model.inertia.values.copy()
    old = values[place.parent - 1]
    new = old + sign * row
    if sign < 0.0:
        rounding = 4.0 * np.finfo(np.float64).eps * (np.abs(old) + np.abs(row))
        new[np.abs(new) <= rounding] = 0.0
        before, after = (np.linalg.eigvalsh(pseudo_inertia(link))[0] for link in (old, new))
        if after < -16.0 * rounding.max() <= before:
            problems = InertialParameters(new[None]).consistency().links[0].problems
            warnings.warn(
                f"link {place.parent} ({model.table.names[place.parent - 1]}) of {model.name!r} is "
                f"not physical without this payload: {'; '.join(problems)}. Was the payload part "
                "of the link, with this mass, centre of mass and frame?",
                InertiaWarning,
                stacklevel=3,
            )
    values[place.parent - 1] = new
    return model.with_inertia(InertialParameters(values))


def _body(mass: float, com: ArrayLike, inertia: ArrayLike | None) -> InertialParameters:
    m, point = as_exact(mass, (), "mass"), as_exact(com, (3,), "com")
    tensor = np.zeros((3, 3)) if inertia is None else as_exact(inertia, (3, 3), "inertia")
    if m < 0.0:
        raise InertiaError(
            f"mass: a payload's mass cannot be negative, got {float(m)} kg; without_payload(...) "
            "removes a body."
        )
    # about the centre of mass, where a distant mass does not hide errors of the tensor
    central = InertialParameters.from_com(m[None], np.zeros((1, 3)), tensor[None]).consistency()
    if not central.is_physical and (m or tensor.any()):
        raise InertiaError(f"This payload is not physical: {'; '.join(central.links[0].problems)}.")
    return InertialParameters.from_com(m[None], point[None], tensor[None])
