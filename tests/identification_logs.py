"""Logs of random robots without noise, whose velocities and accelerations are exact."""

import warnings

import numpy as np
from identities.random_robots import random_model

import robotmodels as rm
from robotmodels.identification import Log


def swinging(model, rng, samples=4000, dt=2e-3, harmonics=5, period=4.0, size=1.0):
    """Positions, velocities and accelerations that are sums of sines, of order one."""
    t = dt * np.arange(samples)
    prismatic = model.table.sigma[model.table.joint_rows] == 1
    w = 2.0 * np.pi * np.arange(1, harmonics + 1) / period
    a, b = rng.normal(size=(2, harmonics, model.n)) / w[:, None]
    a, b = (size * x * np.where(prismatic, 0.3, 1.0) for x in (a, b))
    c, s = np.cos(np.outer(t, w)), np.sin(np.outer(t, w))
    q = rng.uniform(-1.0, 1.0, size=model.n) + s @ a - c @ b
    v = (c * w) @ a + (s * w) @ b
    return q, v, -(s * w**2) @ a + (c * w**2) @ b


def torques(model, q, v, a):
    """Torques, also of robots without masses, which would warn."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rm.InertiaWarning)
        return rm.idm(model, q, v, a)


def clean_log(model, rng, noise=0.0, **options):
    """A log whose torques are those of the model, with white noise if it is asked for."""
    dt = options.setdefault("dt", 2e-3)
    q, v, a = swinging(model, rng, **options)
    tau = torques(model, q, v, a)
    return Log(dt, q, tau + noise * rng.normal(size=tau.shape), v, a)


def recorded(name, samples, seed=7, noise=0.0, dt=0.002):
    """A log without velocities of a robot of the catalogue that moves slowly, with friction."""
    model, rng = rm.load(name), np.random.default_rng(seed)
    q, v, a = swinging(model, rng, samples, dt, 5, 10.0, 0.5)
    tau = torques(model, q, v, a) + 2.0 * v + np.sign(v) + noise * rng.normal(size=q.shape)
    return Log(dt, q, tau)


def odd_robots():
    """Serial, prismatic, branched and coupled arms with turned bases, tools and zero lengths."""

    def robot(seed, f, **options):
        return random_model(np.random.default_rng(seed), f, drive=True, **options)

    tree = robot(16, 5, tree=True)
    # axes that are nearly aligned are taken as aligned: torques then differ by the angle
    beta = np.where(abs(tree.table.beta) < 1e-4, 0.0, tree.table.beta)
    bodies = random_model(np.random.default_rng(7), 3, prismatic=False, drive=True)
    return {
        "serial": robot(5, 4, prismatic=False),
        "prismatic": robot(7, 4),
        "tree": tree.with_table(tree.table.replace(beta=beta)),
        "fixed frame": robot(9, 5, fixed=True),
        "coupled wrist": robot(12, 4, prismatic=False, transmission=True),
        "zero lengths": rm.RobotModel.from_table(
            rm.DHTable(antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=[0.0, np.pi / 2, -np.pi / 2]),
            inertia=bodies.inertia,
            drive=bodies.drive,
        ),
        "rx90": rm.load("rx90"),
    }
