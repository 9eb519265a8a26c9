"""Simulated arms whose real ones have geometric errors, errors of the joints, and noise."""

import dataclasses

import numpy as np
from identities.random_robots import random_bodies

import robotmodels as rm
from robotmodels.calibration import KnownDistance, PointContact, Position

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


def erroneous(model, rng, length=1e-3, angle=2e-3):
    """A robot with errors everywhere in its table."""
    table, f = model.table, model.f
    parallel = np.abs(np.sin(table.alpha)) < 1e-6
    sizes = {"alpha": angle, "beta": angle * parallel, "d": length, "theta": angle, "r": length}
    columns = {x: getattr(table, x) + size * rng.normal(size=f) for x, size in sizes.items()}
    return model.with_table(dataclasses.replace(table, **columns))


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

    def touching(self, points, count):
        """Readings at which the real tool is near points, and the number of the point of each."""
        q, labels = [], []
        for label, point in enumerate(points):
            T = np.tile(np.eye(4), (4 * count, 1, 1))
            T[:, :3, 3] = point + NOISE * self.rng.normal(size=(len(T), 3))
            start = self.readings(len(T))
            found = rm.igm_numeric(self.real, T, q0=start, mask="position", rng=self.rng)
            q.append(found.q[found.valid[:, 0], 0][:count])
            labels += [label] * len(q[-1])
        return np.concatenate(q), labels

    def touches(self, places, count, pitch=0.0):
        """Contacts with one or two points (pitch apart) at new places, and the points."""
        contacts, points = [], []
        while len(contacts) < places:
            k, way = len(contacts), self.rng.normal(size=3)
            first = 0.8 * rm.dgm(self.real, self.readings(1))[0, :3, 3]
            here = np.array([first, first + pitch * way / np.linalg.norm(way)])[: 1 + (pitch > 0)]
            q, labels = self.touching(here, count // len(here))
            if len(q) == count // len(here) * len(here):
                contacts.append(PointContact(q, [f"{k}:{label}" for label in labels]))
                points.append(here)
        return contacts, np.array(points)

    def sockets(self, places, count=24):
        """Places with two sockets each, 50 mm apart, and these distances."""
        return [*self.touches(places, count, 0.05)[0], *distances([0.05] * places)]

    def markers(self):
        """Three positions in each of 20 to 40 postures."""
        q = self.readings(int(self.rng.integers(20, 41)))
        return [self.positions(q) for _ in range(3)]
