"""Simulated arms that bend, measured at some places: stated errors beside those of new places.

The real arm has geometric errors, which the fit can take, and joints that bend under gravity,
which it does not know. Readings are the actual angles less the bending.
"""

import dataclasses

import numpy as np

import robotmodels as rm
from robotmodels.calibration import KnownDistance, PointContact, Position, fit

TEMPLATES = ("rx90", "tx40", "ur10e", "irb140", "panda", "xarm5")
POSITION = [1, 1, 1, 0, 0, 0]
NOISE = 5e-5
"""Of a measured position, m; readings at contacts have twice as many rad."""
FRESH = 15
"""New places at which a calibrated arm is tried."""


class Arm:
    """A nominal arm of random lengths, and the real one with errors and bending joints."""

    def __init__(self, seed):
        self.rng = rng = np.random.default_rng(seed)
        plain = rm.load(TEMPLATES[seed % len(TEMPLATES)])
        table, f = plain.table, plain.f
        shaped = dataclasses.replace(
            table, d=table.d * rng.uniform(0.7, 1.3, f), r=table.r * rng.uniform(0.7, 1.3, f)
        )
        tool = rm.se3.translation(*rng.uniform([0.03, -0.08, 0.08], [0.1, 0.08, 0.25]))
        self.nominal = plain.with_table(shaped).with_inertia(bodies(rng, f)).with_tool(tool)
        parallel = np.abs(np.sin(shaped.alpha)) < 1e-6
        self.real = self.nominal.with_table(
            dataclasses.replace(
                shaped,
                alpha=shaped.alpha + 4e-3 * rng.normal(size=f),
                beta=shaped.beta + np.where(parallel, 4e-3 * rng.normal(size=f), 0.0),
                d=shaped.d + 1e-3 * rng.normal(size=f),
                theta=shaped.theta + 4e-3 * rng.normal(size=f),
                r=shaped.r + 1e-3 * rng.normal(size=f),
            )
        ).with_tool(rm.se3.translation(*(2e-3 * rng.normal(size=3))) @ tool)
        self.compliance = 10.0 ** rng.uniform(-6.0, -5.0, size=plain.n)
        q = self.postures(200)
        bent = (rm.dgm(self.real, q) - rm.dgm(self.real, self.read(q)))[:, :3, 3]
        rms = np.sqrt((bent**2).sum(axis=1).mean())
        self.compliance *= 10.0 ** rng.uniform(-3.7, -2.7) / rms  # 0.2 to 2 mm

    def read(self, q):
        """Readings of the joints where the arm is at q."""
        return q - self.compliance * rm.gravity_torque(self.real, q)

    def postures(self, count):
        """Random postures in the joint ranges."""
        low, high = np.maximum(self.nominal.lower, -2.5), np.minimum(self.nominal.upper, 2.5)
        return self.rng.uniform(low, high, (count, self.nominal.n))

    def reaching(self, p, start):
        """Postures near others that hold the tool at points; None if one is out of reach."""
        T = np.tile(np.eye(4), (len(start), 1, 1))
        T[:, :3, 3] = p
        found = rm.igm_numeric(
            self.real, T, q0=start, mask=POSITION, position_tolerance=1e-12, rng=self.rng
        )
        return found.q[:, 0] if found.valid[:, 0].all() else None

    def place(self, count, pitch=0.0):
        """Touches of one or two points (pitch apart) at a new place, the hand turned about them.

        Readings and points, one for each.
        """
        while True:
            middle = self.postures(1)[0]
            start = middle + 0.4 * self.rng.normal(size=(count, self.nominal.n))
            way = self.rng.normal(size=3)
            first = rm.dgm(self.real, middle)[:3, 3]
            points = np.array([first, first + pitch * way / np.linalg.norm(way)])[: 1 + (pitch > 0)]
            number = np.arange(count) * len(points) // count
            held = self.reaching(points[number], start)
            if held is not None:
                noise = 2.0 * NOISE * self.rng.normal(size=held.shape)
                return self.read(held) + noise, number, points

    def touches(self, places, count, pitch=0.0, name="point"):
        """Contacts at new places, one measurement for each, and the points that are touched."""
        contacts, points = [], []
        for k in range(places):
            q, number, here = self.place(count, pitch)
            contacts.append(PointContact(q, [f"{k}:{i}" for i in number], name=name))
            points.append(here)
        return contacts, np.array(points)

    def seen(self, q, noise=NOISE):
        """Positions of the tool by an external device."""
        p = rm.dgm(self.real, q)[:, :3, 3]
        return Position(self.read(q), p + noise * self.rng.normal(size=p.shape))


def bodies(rng, f):
    """Links that become lighter towards the hand."""
    rows = np.zeros((f, 10))
    mass = 12.0 * 0.6 ** np.arange(f) * rng.uniform(0.6, 1.5, size=f)
    rows[:, 9] = mass
    rows[:, 6:9] = mass[:, None] * 0.1 * rng.normal(size=(f, 3))
    rows[:, [0, 3, 5]] = 0.05 * mass[:, None]
    return rm.InertialParameters(rows)


# --- protocols: measurements, and others of the same kind at new places --------------------------


def sockets(arm, places=None):
    """3 to 8 places with two sockets each, whose distance of 50 mm is known."""
    places = places or int(arm.rng.integers(3, 9))
    count = int(arm.rng.integers(16, 40))
    contacts, p = arm.touches(places, count, 0.05)
    known = [KnownDistance(f"point:{k}:0", f"point:{k}:1", 0.05, 1e-4) for k in range(len(p))]
    return [*contacts, *known], arm.touches(FRESH, count, 0.05, "new")[0]


def markers(arm):
    """Three positions in each of 20 to 40 postures."""
    q, fresh = arm.postures(int(arm.rng.integers(20, 41))), arm.postures(200)
    return [arm.seen(q) for _ in range(3)], [arm.seen(fresh)]


def stated_over_true(protocol, seed):
    """What folds and the fit itself state, each over the error at new places."""
    arm = Arm(seed)
    measured, fresh = protocol(arm)
    far = np.full(arm.nominal.n, np.inf)  # simulated postures do not keep the limits
    table = arm.nominal.table.replace(lower=-far, upper=far)
    found = fit(arm.nominal.with_table(table), measured, held_out=fresh)
    stated = (found.validation.folds, found.validation.in_sample)
    return [errors.rms["m"] / found.validation.held_out.rms["m"] for errors in stated]
