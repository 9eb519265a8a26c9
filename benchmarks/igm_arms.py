"""Arms of the inverse benchmarks that are not in the catalogue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm

Array = NDArray[np.float64]

# D. Manocha and J. F. Canny, IEEE Trans. Robotics and Automation 10(5):648-657, 1994, table I
# (classical a [m], d [m], alpha [deg]), the hand and table III [deg, two decimals]; problem 6 of
# C. Wampler and A. Morgan, Mechanism and Machine Theory 26(1):91-106, 1991.
MANOCHA_CANNY_TABLE = (
    (0.3, 0.0, 90.0),
    (1.0, 0.0, 1.0),
    (0.0, 0.2, 90.0),
    (1.5, 0.0, 1.0),
    (0.0, 0.0, 90.0),
    (0.0, 0.0, 1.0),
)
MANOCHA_CANNY_POSTURES = (
    (-96.28, -6.27, 179.96, 38.48, 52.55, -39.40),
    (-120.78, 172.33, -179.07, 31.33, -146.71, 142.82),
    (88.67, -176.72, -176.72, -63.24, 157.19, 140.43),
    (113.84, 5.30, -177.74, -55.92, -62.98, -43.37),
    (-178.12, 108.19, -147.73, -5.69, -164.67, 179.58),
    (168.32, -103.89, 146.60, -17.24, -171.87, 98.16),
    (-12.94, -105.09, -114.97, 3.02, 7.41, -79.42),
    (2.51, 108.07, 112.04, -10.52, 0.00, -0.10),
    (2.51, 108.07, -67.95, -169.47, 179.99, 179.89),
    (-12.94, -105.09, 65.02, 176.97, 172.58, 100.57),
    (168.32, -103.89, -33.39, -162.75, -8.12, -81.83),
    (-178.12, 108.19, 32.26, -174.30, -15.32, -0.41),
    (88.67, -176.72, 3.27, -116.75, 22.80, -39.56),
    (-96.28, -6.27, -0.03, 141.51, 127.44, 140.59),
    (-120.78, 172.33, 0.92, 148.66, -33.28, -37.17),
    (113.84, 5.30, 2.25, -124.07, -117.01, 136.62),
)


def from_classical(rows: list[tuple[float, float, float]]) -> rm.RobotModel:
    """An arm of turning joints from classical ``(a, d, alpha)``, metres and radians."""
    table, tool = rm.DHTable.from_standard(
        [{"theta": 0.0, "d": d, "a": a, "alpha": alpha} for a, d, alpha in rows]
    )
    return rm.RobotModel.from_table(table, tool=tool)


def manocha_canny() -> rm.RobotModel:
    """The arm with 16 printed postures."""
    return from_classical([(a, d, np.deg2rad(alpha)) for a, d, alpha in MANOCHA_CANNY_TABLE])


def manocha_canny_pose(model: rm.RobotModel) -> Array:
    """Its pose, better known by the mean over the postures than by the hand as printed."""
    T = np.mean(rm.dgm(model, np.deg2rad(MANOCHA_CANNY_POSTURES)), axis=0)
    V, _, W = np.linalg.svd(T[:3, :3])
    T[:3, :3] = V @ W
    return T


def random_arm(seed: int) -> rm.RobotModel:
    """Six turning joints with nothing special about them."""
    rng = np.random.default_rng(seed)
    a, d = rng.uniform(-0.5, 0.5, (2, 6))
    alpha = rng.uniform(-np.pi, np.pi, 6)
    return from_classical(list(zip(a.tolist(), d.tolist(), alpha.tolist(), strict=True)))


def calibrated(
    model: rm.RobotModel, metres: float, radians: float, rng: np.random.Generator
) -> rm.RobotModel:
    """The arm as calibration finds it: every parameter a little off."""
    table = model.table
    f = len(table.sigma)

    def off(size: float) -> Array:
        return rng.uniform(-size, size, f)

    return model.with_table(
        replace(
            table, alpha=table.alpha + off(radians), theta=table.theta + off(radians),
            beta=table.beta + off(radians), d=table.d + off(metres), r=table.r + off(metres),
        )
    )  # fmt: skip
