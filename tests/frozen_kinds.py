"""Simulated measurements of every kind on an RX-90 with known errors; UR10; Panda.

Noisy ones are frozen in `frozen_estimates`, exact ones determine the robot (test_calibration_fit).
"""

from __future__ import annotations

from functools import cache

import numpy as np

import robotmodels as rm
from robotmodels import calibration

CONTACT = {"known_lengths": ["r4"]}
"""Contacts have no length; this one of the nominal robot is right."""


def erroneous(model, rng):
    """A robot with errors everywhere in its table."""
    table = model.table
    parallel = np.abs(np.sin(table.alpha)) < 1e-6
    sizes = {"alpha": 2e-3, "d": 1e-3, "theta": 2e-3, "r": 1e-3, "beta": 2e-3 * parallel}
    columns = {x: getattr(table, x) + size * rng.normal(size=model.f) for x, size in sizes.items()}
    return model.with_table(table.replace(**columns))


class Scene:
    """The nominal robot, the real one with errors, 60 readings and the poses there with noise.

    The noise is a factor on 0.1 mm and 0.1 mrad.
    """

    def __init__(self, noise=1.0):
        self.rng = rng = np.random.default_rng(3)
        self.noise = 1e-4 * noise
        self.nominal = rm.load("rx90").with_tool(rm.se3.translation(0.05, -0.03, 0.11))
        r4, real = self.nominal.table.r[3], erroneous(self.nominal, rng)
        real = real.with_table(real.table.replace(r=[*real.table.r[:3], r4, *real.table.r[4:]]))
        self.real = real.with_tool(rm.se3.from_rpy([0.2, -0.1, 0.3], [0.05, -0.03, 0.12]))
        self.q = rng.uniform(-2.0, 2.0, (60, 6))
        self.T = noisy(rm.dgm(self.real, self.q), rng, self.noise)
        self.p = self.T[:, :3, 3]

    def met(self, rows, count: int):
        """Readings at which rows of a pose vanish, found by Newton steps, with noise.

        ``rows(k, T)`` gives residuals (m,) and the matrix (m, 6) that they have of the twist.
        """
        q = np.empty((count, 6))
        for k in range(count):
            while True:
                x = self.rng.uniform(-2.0, 2.0, 6)
                for _ in range(30):
                    e, A = rows(k, rm.dgm(self.real, x))
                    x = x - 0.7 * np.linalg.pinv(A @ rm.jacobian(self.real, x), rcond=1e-2) @ e
                for _ in range(4):
                    e, A = rows(k, rm.dgm(self.real, x))
                    x = x - np.linalg.pinv(A @ rm.jacobian(self.real, x), rcond=1e-6) @ e
                if np.abs(e).max() < 1e-10 and np.abs(x).max() < 4.0:
                    break
            q[k] = x
        return q + self.noise * self.rng.normal(size=q.shape)


def noisy(T, rng, noise=1e-4):
    """Poses moved (m) and turned (rad) by noise."""
    moved = np.array([rm.se3.from_rpy(*(noise * rng.normal(size=(2, 3)))) for _ in T])
    found = T @ moved
    found[:, :3, 3] = T[:, :3, 3] + moved[:, :3, 3]
    return found


def linear(B, at):
    """Rows ``B (p - at)`` of the position."""
    A = np.hstack((B, np.zeros((len(B), 3))))
    return lambda T: (B @ (T[:3, 3] - at), A)


def pose_rows(goal):
    """All six rows of a pose: position, and the rotation's sine about each axis."""

    def rows(T):
        turn = T[:3, :3] @ goal[:3, :3].T
        e = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0],
                            turn[1, 0] - turn[0, 1]])  # fmt: skip
        if np.trace(turn) < 1.0:  # the sine also vanishes half a turn away
            e = e + 1.0
        return np.concatenate((T[:3, 3] - goal[:3, 3], e)), np.eye(6)

    return rows


POINTS = np.array([[0.5, 0.1, 0.1], [0.1, -0.45, 0.3], [0.4, -0.3, 0.35]])
NORMALS = np.array([[0.0, 0.0, 1.0], [0.8, 0.0, 0.6], [0.0, 0.8, 0.6], [-0.6, -0.48, 0.64]])
OFFSETS = np.array([0.1, 0.2, 0.15, 0.1])
PIVOTS = np.array([[1.5, 0.2, -0.5], [-0.4, 1.6, 0.3], [0.1, -1.2, 1.4]])
ALONG = np.array([[0.0, 0.6, 0.8], [0.8, 0.0, 0.6], [0.0, 1.0, 0.0]])


@cache
def measured(kind: str, noise: float = 1.0):
    """Nominal robot, measurements of a kind, and options of the fit."""
    s, c = Scene(noise), calibration
    options: dict = {}
    if kind == "pose":
        found = [c.Pose(s.q, s.T)]
    elif kind == "height":
        found = [c.Pose(s.q, s.T, rows=[0, 0, 1, 0, 0, 0])]
    elif kind == "orientation":
        found = [c.Pose(s.q, s.T, rows=[0, 0, 0, 1, 1, 1])]
    elif kind == "position":
        found = [c.Position(s.q, s.p)]
    elif kind == "gains":
        found, options = [c.Position(s.q, s.p)], {"gains": True, "eccentricity": True}
    elif kind == "distance":
        length = np.linalg.norm(s.p - np.roll(s.p, 1, axis=0), axis=1)
        found = [c.Distance(s.q, length, q_other=np.roll(s.q, 1, axis=0))]
    elif kind == "pivot":
        label = np.arange(60) % 3
        found = [c.Distance(s.q, np.linalg.norm(s.p - PIVOTS[label], axis=1), pivot=label)]
    elif kind == "relative":
        found = [c.RelativePose.successive(s.q, np.linalg.inv(s.T[:-1]) @ s.T[1:])]
    elif kind == "camera":
        target = rm.se3.from_rpy([0.3, -0.4, 1.0], [0.8, 0.1, -0.2])
        found = [c.CameraPose(s.q, np.linalg.inv(s.T) @ target)]
    elif kind == "axis":
        found = [c.AxisPosition(s.q, s.p @ ALONG[0], ALONG[0])]
    elif kind == "point":
        label = np.arange(45) % 3
        rows = [linear(np.eye(3), at) for at in POINTS]
        found = [c.PointContact(s.met(lambda k, T: rows[label[k]](T), 45), label)]
        options = CONTACT
    elif kind == "plane":
        label = np.arange(120) % 4
        rows = [linear(n[None], o * n) for n, o in zip(NORMALS, OFFSETS, strict=True)]
        found = [c.PlaneContact(s.met(lambda k, T: rows[label[k]](T), 120), label)]
        options = CONTACT
    elif kind == "line":
        label = np.arange(60) % 3
        rows = [linear(np.linalg.svd(a[None])[2][1:], p)
                for a, p in zip(ALONG, POINTS, strict=True)]  # fmt: skip
        known = {k: [POINTS[k], ALONG[k]] for k in range(3)}
        found = [c.LaserLine(s.met(lambda k, T: rows[label[k]](T), 60), label, known=known)]
    else:
        assert kind == "frame"
        goals = rm.dgm(s.real, s.rng.uniform(-1.5, 1.5, (12, 6)))
        rows = [pose_rows(goal) for goal in goals]
        label = np.arange(48) % 12
        found = [c.FrameContact(s.met(lambda k, T: rows[label[k]](T), 48), label)]
        options = CONTACT
    return s.nominal, found, options


KINDS = (
    "pose", "height", "orientation", "position", "gains", "distance", "pivot", "relative", "camera",
    "axis", "point", "plane", "line", "frame",
)  # fmt: skip


def simulated_ur10():
    """Nominal UR10, readings and noisy poses of one that is off in all columns, base and tool."""
    rng = np.random.default_rng(1)
    nominal = rm.datasets.ur10_camera().model
    real = erroneous(nominal, rng)
    real = real.with_base(rm.se3.from_rpy([0.03, -0.02, 0.05], [0.05, -0.03, 0.02]) @ real.base)
    real = real.with_tool(real.tool @ rm.se3.from_rpy([0.2, -0.1, 0.3], [0.05, -0.03, 0.12]))
    q = rng.uniform(-2.5, 2.5, (200, nominal.n))
    return nominal, q, noisy(rm.dgm(real, q), rng)


def touched(data, place: str) -> list:
    """Readings in both sockets of a place, and their distance."""
    q = data.places[place]
    labels = [f"{place}{hole}" for hole, rows in enumerate(q) for _ in rows]
    contact = calibration.PointContact(np.concatenate(q), labels)
    ends = (f"point:{place}0", f"point:{place}1")
    return [contact, calibration.KnownDistance(*ends, data.distance)]
