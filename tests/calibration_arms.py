"""Simulated arms whose real ones have geometric errors, errors of the joints, and noise."""

import numpy as np
from frozen_kinds import erroneous
from identities.random_robots import random_bodies

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    PointContact,
    Position,
    calibrated_model,
    candidate_parameters,
)

ALONE = {"folds": 0, "held_out": 0}
"""A fit without its fits on part of the data."""
NOISE = 1e-4
"""Standard deviation of positions, m."""


def slope(function, x, k, h=1e-3):
    """Central difference with two steps of extrapolation: errors of the order of h^6."""
    d = np.zeros_like(x)
    d[k] = 1.0
    table = [(function(x + s * d) - function(x - s * d)) / (2 * s) for s in (h, h / 2, h / 4)]
    first = [(4 * table[1] - table[0]) / 3, (4 * table[2] - table[1]) / 3]
    return (16 * first[1] - first[0]) / 15


def readings(model, rng, count, most=2.5):
    """Random readings within the limits, where there are some."""
    slides = model.table.sigma[model.table.joint_rows] == 1
    low = np.where(np.isfinite(model.lower), model.lower, np.where(slides, -0.4, -most))
    high = np.where(np.isfinite(model.upper), model.upper, np.where(slides, 0.5, most))
    return rng.uniform(np.maximum(low, -most), np.minimum(high, most), (count, model.n))


def corrections(parameters, rng, size=1e-3):
    """Random ones; a compliance gives a fiftieth at 1 N m."""
    xi = size * rng.normal(size=len(parameters))
    xi[[name.startswith("compliance") for name in parameters.names]] *= 0.02
    return xi


def off(model, rng, size=1e-3, frames=(None,), **options):
    """A robot with random errors in all candidates."""
    parameters = candidate_parameters(model, frames, **options)
    return calibrated_model(parameters, corrections(parameters, rng, size))


def distances(lengths):
    """Known distances of the two points of each place."""
    return [KnownDistance(f"point:{k}:0", f"point:{k}:1", x) for k, x in enumerate(lengths)]


class Arm:
    """A random arm of six joints, the real one, and errors of its joints.

    Kinds: none, compliance, eccentricity, and backlash (each joint lags behind its last move).
    The errors move the tool by three standard deviations of the noise (rms of a coordinate).
    """

    def __init__(self, seed, kind="none"):
        self.rng = rng = np.random.default_rng([seed, 17])
        a, b = rng.uniform(0.2, 0.7, size=2)
        turn = np.pi / 2
        alpha, d, r = [
            ([0, turn, 0, -turn, turn, -turn], [0, 0.1, a, 0.05, 0, 0], [0, 0, 0, b, 0, 0]),
            ([0, turn, 0, 0, -turn, turn], [0, 0, -a, -b, 0, 0], [0.1, 0, 0, 0.15, 0.1, 0.1]),
            (rng.uniform(-1.8, 1.8, 6), rng.uniform(0, 0.4, 6), rng.uniform(-0.3, 0.3, 6)),
        ][seed % 3]
        table = rm.DHTable(np.arange(6), np.zeros(6, int), theta=np.zeros(6), alpha=alpha, d=d, r=r)
        heavy = rm.RobotModel.from_table(table, inertia=random_bodies(rng, 6))
        self.nominal = heavy.with_tool(rm.se3.translation(0.06, -0.04, 0.12))
        self.real = erroneous(self.nominal, rng)
        self.kind, self.each, self.waves = kind, np.abs(rng.normal(size=6)), rng.normal(size=(4, 6))
        self.scale = 1e-5
        q = self.readings(300)
        moved = rm.dgm(self.real, self.actual(q)) - rm.dgm(self.real, q)
        rms = np.sqrt(np.mean(moved[:, :3, 3] ** 2))
        self.scale *= 3.0 * NOISE / rms if rms else 0.0

    def readings(self, count):
        return self.rng.uniform(-2.2, 2.2, (count, 6))

    def actual(self, q):
        """Where the joints are."""
        if self.kind == "compliance":
            return q - self.scale * self.each * rm.gravity_torque(self.nominal, q)
        if self.kind == "eccentricity":
            waves = np.stack([np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q)], axis=1)
            return q + self.scale * np.einsum("nki,ki->ni", waves, self.waves)
        if self.kind == "backlash":
            return q + self.scale * self.each * np.sign(np.diff(q, axis=0, prepend=0.0))
        return q

    def poses(self, q):
        return rm.dgm(self.real, self.actual(q))

    def positions(self, q, noise=NOISE):
        p = self.poses(q)[:, :3, 3]
        return Position(q, p + noise * self.rng.normal(size=p.shape))

    def touching(self, point, count):
        """Readings at which the real tool is near a point."""
        T = np.tile(np.eye(4), (4 * count, 1, 1))
        T[:, :3, 3] = point + NOISE * self.rng.normal(size=(len(T), 3))
        start = self.readings(len(T))
        found = rm.igm_numeric(self.real, T, q0=start, mask="position", rng=self.rng)
        return found.q[found.valid[:, 0], 0][:count]

    def touches(self, places, count, pitch=0.0):
        """Contacts with one or two points (pitch apart) at new places, and the points."""
        contacts, points = [], []
        while len(contacts) < places:
            k, way = len(contacts), self.rng.normal(size=3)
            first = 0.8 * rm.dgm(self.real, self.readings(1))[0, :3, 3]
            here = np.array([first, first + pitch * way / np.linalg.norm(way)])[: 1 + (pitch > 0)]
            q = np.concatenate([self.touching(point, count // len(here)) for point in here])
            if len(q) == count:
                labels = np.repeat([f"{k}:{j}" for j in range(len(here))], count // len(here))
                contacts.append(PointContact(q, labels.tolist()))
                points.append(here)
        return contacts, np.array(points)

    def sockets(self, places, count=24):
        """Places with two sockets each, 50 mm apart, and these distances."""
        return [*self.touches(places, count, 0.05)[0], *distances([0.05] * places)]

    def markers(self):
        """Three positions in each of 20 to 40 postures."""
        q = self.readings(int(self.rng.integers(20, 41)))
        return [self.positions(q) for _ in range(3)]
