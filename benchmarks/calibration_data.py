"""Real calibration data as `bench_calibration.py` fits them: what is trained on, what is tested."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm
from robotmodels.calibration import KnownDistance, ParameterPrior, PointContact, Pose, fit
from robotmodels.calibration.measurements import CameraPose
from robotmodels.calibration.robot import calibrated_pose
from robotmodels.datasets import DoubleSocket, panda_double_socket, ur10_camera

Array = NDArray[np.float64]
ALONE = {"folds": 0, "held_out": 0}

# --- UR10 and its camera --------------------------------------------------------------------------

BOARD = 0.45
"""Distance of the board in front of the camera, m: found on these data, not by the source."""
CAMERA_PRIOR = ParameterPrior(length=1e-4, angle=3e-3)
CAMERA_WAYS: dict[str, tuple[str, dict]] = {
    "poses, no prior": ("pose", {"prior": None}),
    "poses, default prior": ("pose", {}),
    "poses, prior 0.1 mm and 3 mrad": ("pose", {"prior": CAMERA_PRIOR}),
    "poses, default prior, strength by cross-validation": (
        "pose", {"prior": ParameterPrior(strength=None)},
    ),
    "board seen by the camera, no prior": ("board", {"prior": None}),
    "board, default prior": ("board", {}),
    "board, prior 0.1 mm and 3 mrad": ("board", {"prior": CAMERA_PRIOR}),
    "board, the same prior, strength by cross-validation": (
        "board", {"prior": replace(CAMERA_PRIOR, strength=None)},
    ),
}  # fmt: skip
"""The strength is chosen on the rows of training alone, so the folds are nested."""


def camera_splits(count: int) -> dict[str, list[NDArray[np.int64]]]:
    """Rows kept aside: five folds dealt three times, and each row by itself."""
    dealt = {
        f"5 folds, {seed}": [
            np.sort(f) for f in np.array_split(np.random.default_rng(seed).permutation(count), 5)
        ]
        for seed in range(3)
    }
    return {**dealt, "leave one out": [np.array([k]) for k in range(count)]}


def camera_errors(way: str, parts: Sequence[NDArray[np.int64]]) -> tuple[float, float, list[int]]:
    """Root mean square of position (m) and angle (rad) of rows kept aside, parameters of each fit.

    No part: of all rows, fitted to themselves.
    """
    kind, options = CAMERA_WAYS[way]
    q, T = ur10_camera().measured
    rows = np.arange(len(q))
    errors, counts = np.zeros((len(q), 2)), []
    for part in parts or [rows]:
        kept = np.setdiff1d(rows, part) if parts else rows
        predict, count = (_by_poses if kind == "pose" else _by_board)(q[kept], T[kept], options)
        P = predict(q[part])
        turn = np.trace(P[:, :3, :3].swapaxes(1, 2) @ T[part, :3, :3], axis1=1, axis2=2)
        errors[part, 0] = np.linalg.norm(P[:, :3, 3] - T[part, :3, 3], axis=1)
        errors[part, 1] = np.arccos(np.clip((turn - 1.0) / 2.0, -1.0, 1.0))
        counts.append(count)
    position, angle = np.sqrt(np.mean(errors**2, axis=0)).tolist()
    return position, angle, counts


def _by_poses(q: Array, T: Array, options: dict) -> tuple[Callable[[Array], Array], int]:
    found = fit(ur10_camera().model, Pose(q, T), **options, **ALONE)
    return lambda other: calibrated_pose(found.robot, other), len(found.names)


def _by_board(q: Array, T: Array, options: dict) -> tuple[Callable[[Array], Array], int]:
    """The camera sees a point of the room where its axis meets the board: that is its noise."""
    board = np.eye(4)
    board[:3, 3] = (T[:, :3, 3] + BOARD * T[:, :3, 2]).mean(axis=0)
    found = fit(ur10_camera().model, CameraPose(q, np.linalg.inv(T) @ board), **options, **ALONE)
    values = np.array([found.fixtures[f"board:0.{a}"] for a in ("x", "y", "z", "rx", "ry", "rz")])
    place = board @ np.linalg.inv(_pose_of(values))
    return lambda other: place @ calibrated_pose(found.robot, other), len(found.names)


def _pose_of(values: Array) -> Array:
    angle = float(np.linalg.norm(values[3:]))
    T = np.eye(4)
    T[:3, 3] = values[:3]
    if angle > 0.0:
        K = rm.se3.skew(values[3:] / angle)
        T[:3, :3] += np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    return T


# --- Panda in the double socket -------------------------------------------------------------------

SOCKETS = 1e-4
"""Standard deviation of the sockets' distance, m: they were printed."""
PANDA_PRIOR = ParameterPrior(length=3e-4, angle=6e-3, compliance=6e-5, eccentricity=1e-4)
PANDA_WAYS: dict[str, dict] = {
    "table, no prior": {"prior": None},
    "table, default": {},
    "table, default prior, Cauchy": {"loss": "cauchy"},
    "uniform compliance, default prior": {"compliance": "uniform"},
    "isotropic compliance, prior": {"compliance": "isotropic", "prior": PANDA_PRIOR},
    "isotropic compliance, prior, Cauchy": {
        "compliance": "isotropic", "prior": PANDA_PRIOR, "loss": "cauchy",
    },
    "links' compliance, prior, Cauchy": {
        "compliance": "links", "prior": PANDA_PRIOR, "loss": "cauchy",
    },
    "uniform compliance, prior, Cauchy": {
        "compliance": "uniform", "prior": PANDA_PRIOR, "loss": "cauchy",
    },
    "isotropic compliance, eccentricity, prior, Cauchy": {
        "compliance": "isotropic", "eccentricity": True, "prior": PANDA_PRIOR, "loss": "cauchy",
    },
}  # fmt: skip


def panda(robot: str) -> tuple[DoubleSocket, rm.RobotModel]:
    """Data, and the nominal arm with the masses of links and hand of `erd:panda`."""
    data = panda_double_socket(robot)
    heavy = rm.load("erd:panda")
    q = np.zeros(heavy.n)
    there = rm.link_poses(heavy, q)[:7]
    here = rm.link_poses(data.model, q[:7])
    masses = rm.InertialParameters(heavy.inertia.values[:7]).moved(np.linalg.inv(here) @ there)
    return data, data.model.with_inertia(masses)


def touches(data: DoubleSocket, place: str) -> PointContact:
    """Readings at one place, without the distance of the sockets."""
    sockets = data.places[place]
    labels = [f"{place}{hole}" for hole, q in enumerate(sockets) for _ in q]
    return PointContact(np.concatenate(sockets), labels)


def panda_errors(
    robot: str, way: str, train: Sequence[str], test: Sequence[str]
) -> tuple[float, float, dict[str, float]]:
    """Mean distances from the sockets, m: before and after where it was trained, and elsewhere."""
    data, model = panda(robot)
    measured = []
    for place in train:
        ends = (f"point:{place}0", f"point:{place}1")
        measured += [touches(data, place), KnownDistance(*ends, data.distance, sigma=SOCKETS)]
    others = [touches(data, place) for place in test]
    found = fit(model, measured, folds=0, held_out=others, **PANDA_WAYS[way])
    assert found.held_out is not None
    errors, elsewhere, first = found.held_out.after.position, {}, 0
    for place, contact in zip(test, others, strict=True):
        elsewhere[place] = float(errors[first : first + contact.blocks].mean())
        first += contact.blocks
    before, after = found.before.summary("m").mean, found.after.summary("m").mean
    return before, after, elsewhere
