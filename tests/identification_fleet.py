"""Robots and their logs: exact motions, odd structures, a fleet nobody tuned the toolbox to."""

import warnings
from dataclasses import dataclass

import numpy as np
from identities.random_robots import random_model
from scipy.linalg import qr
from scipy.signal import butter, lfilter, sosfiltfilt

import robotmodels as rm
from robotmodels.identification import Log, choose_processing
from robotmodels.identification.closed_loop import simulated_log, tuned_controller

# --- exact motions and logs ----------------------------------------------------------------------


def waves(rng, model, t, w, a, b, size=(1.0, 1.0)):
    """Sums of sines about a random posture with their derivatives; amplitudes (k, n) and sizes of
    postures and amplitudes of prismatic joints.
    """
    slides = model.table.sigma[model.table.joint_rows] == 1
    a, b = (x * np.where(slides, size[1], 1.0) for x in (a, b))
    c, s = np.cos(np.outer(t, w)), np.sin(np.outer(t, w))
    q = rng.uniform(-1.0, 1.0, model.n) * np.where(slides, size[0], 1.0) + s @ a - c @ b
    return q, (c * w) @ a + (s * w) @ b, (c * w**2) @ b - (s * w**2) @ a


def swinging(model, seed, samples=4000, dt=2e-3, harmonics=5, period=4.0, size=1.0, late=0.0):
    """Positions, velocities and accelerations of order one; `seed` may be a generator."""
    rng = np.random.default_rng(seed)
    w = 2.0 * np.pi * np.arange(1, harmonics + 1) / period
    a, b = size * rng.normal(size=(2, harmonics, model.n)) / w[:, None]
    return waves(rng, model, dt * np.arange(samples) - late, w, a, b, (1.0, 0.3))


def torques(model, q, v, a):
    """Torques, also of robots without masses, which would warn."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rm.InertiaWarning)
        return rm.idm(model, q, v, a)


def clean_log(model, rng, noise=0.0, **options):
    """A log whose torques are those of the model, with white noise; `rng` may be a seed."""
    rng, dt = np.random.default_rng(rng), options.setdefault("dt", 2e-3)
    q, v, a = swinging(model, rng, **options)
    tau = torques(model, q, v, a)
    return Log(dt, q, tau + noise * rng.normal(size=tau.shape), v, a)


def recorded(name, samples, seed=7, noise=0.0, dt=0.002):
    """A log without velocities of a robot of the catalogue that moves slowly, with friction."""
    model, rng = rm.load(name), np.random.default_rng(seed)
    q, v, a = swinging(model, rng, samples, dt, 5, 10.0, 0.5)
    tau = torques(model, q, v, a) + 2.0 * v + np.sign(v) + noise * rng.normal(size=q.shape)
    return Log(dt, q, tau)


def raw(log, decimation=1, dead_band=0.0):
    """No filter and nothing cut: positions, velocities and accelerations of the log are exact."""
    return choose_processing(
        log, filtered=False, decimation=decimation, edges=0.0, dead_band=dead_band
    )


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


def two_links(**drive):
    """A planar arm with bodies and drives."""
    tensors = [np.diag([0.02, 0.1, 0.1]), np.diag([0.01, 0.05, 0.05])]
    com = [[0.3, 0.02, 0.0], [0.2, 0.01, 0.0]]
    bodies = rm.InertialParameters.from_com([3.0, 2.0], com, tensors)
    return rm.load("planar_2r").with_inertia(bodies).with_drive(rm.DriveParameters(**drive))


# --- arms of a fleet -----------------------------------------------------------------------------

KINDS = ("slow", "fast", "badly exciting", "closed loop")
SPEED = {"slow": 0.5, "fast": 2.5, "badly exciting": 0.3, "closed loop": 1.2}


@dataclass(frozen=True)
class Case:
    """A robot, the log of a motion, and another motion: exact signals and measured torque."""

    kind: str
    model: rm.RobotModel
    log: Log
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray

    def error(self, predict):
        """Torque of the other motion that is not predicted, in parts of it, all joints."""
        rows = slice(len(self.q) // 20, -len(self.q) // 20, max(1, len(self.q) // 4000))
        missed = self.tau[rows] - predict(self.q[rows], self.v[rows], self.a[rows])
        return np.sqrt((missed**2).sum() / (self.tau[rows] ** 2).sum())


def arm(rng):
    """An arm of 4 to 7 joints, some with a slide, heavy or light, with rotors and friction."""
    n, heavy = int(rng.integers(4, 8)), rng.random() < 0.5
    size = rng.uniform(0.6, 1.3) if heavy else rng.uniform(0.2, 0.5)
    alpha = np.r_[0.0, rng.choice([-0.5, 0.5, 0.0], size=n - 1, p=[0.35, 0.35, 0.3]) * np.pi]
    alpha[1] = -0.5 * np.pi
    sigma = np.zeros(n, int)
    if rng.random() < 0.25:
        sigma[rng.integers(2, n)] = 1
    table = rm.DHTable(
        antecedent=np.arange(n), sigma=sigma, alpha=alpha, theta=np.zeros(n),
        d=np.r_[0.0, size * rng.uniform(0.1, 1.0, n - 1) * (rng.random(n - 1) < 0.6)],
        r=size * rng.uniform(0.1, 1.0, n) * (rng.random(n) < 0.5),
    )  # fmt: skip
    mass = (rng.uniform(20, 80) if heavy else rng.uniform(1, 4)) * 0.65 ** np.arange(n)
    mass *= rng.uniform(0.7, 1.3, n)
    points = 0.25 * size * rng.normal(size=(n, 8, 3))
    points -= points.mean(axis=1, keepdims=True)
    second = mass[:, None, None] * np.einsum("nki,nkj->nij", points, points) / 8.0
    tensors = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    bodies = rm.InertialParameters.from_com(mass, 0.3 * size * rng.normal(size=(n, 3)), tensors)
    bare = rm.RobotModel.from_table(table, inertia=bodies)
    q = rng.uniform(-1.0, 1.0, (200, n))
    inertia = rm.mass_matrix(bare, q).diagonal(axis1=1, axis2=2).mean(axis=0)
    load = np.maximum(np.abs(rm.gravity_torque(bare, q)).mean(axis=0), 3.0 * inertia)
    drive = rm.DriveParameters(
        Ia=inertia * rng.uniform(0.1, 1.0, n), Fv=load * rng.uniform(0.02, 0.15, n),
        Fc=load * rng.uniform(0.03, 0.2, n), offset=load * rng.uniform(-0.02, 0.02, n),
    )  # fmt: skip
    return bare.with_drive(drive)


def motion(rng, model, seconds, dt, kind):
    """Positions, velocities and accelerations of five harmonics; badly exciting ones of two."""
    lowest = {"slow": 1.0 / seconds, "badly exciting": 0.1}.get(kind, rng.uniform(0.1, 0.25))
    w = 2.0 * np.pi * lowest * np.arange(1, 6)
    a, b = SPEED[kind] * rng.normal(size=(2, 5, model.n)) / np.sqrt(5.0) / w[:, None]
    if kind == "badly exciting":
        few = rng.random(model.n) < 0.4
        for x in (a, b):
            x[2:] = 0.0
            x[:, few] *= 0.2
    return waves(rng, model, dt * np.arange(round(seconds / dt)), w, a, b, (0.2, 0.25))


def case(seed):
    """Noise of encoders (white or quantised), of torques (white, correlated), and ripple."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    model = arm(rng)
    rates = [500, 1000] if kind == "closed loop" else [100, 250, 500, 1000, 2000, 5000]
    rate = float(rng.choice(rates))
    seconds = 10.0 if rate > 3000.0 else float(rng.choice([10.0, 15.0, 20.0]))
    dt, runs = 1.0 / rate, []
    controller = None
    for _ in range(2):
        q, v, a = motion(rng, model, seconds, dt, kind)
        if kind == "closed loop":
            controller = controller or tuned_controller(
                model, q, rng.uniform(3.0, 6.0), period=dt, feed_forward=False
            )
            made = simulated_log(model, controller, q, v, dt)
            runs.append((made.q, made.v, made.a, np.array(made.tau)))
        else:
            runs.append((q, v, a, rm.idm(model, q, v, a)))
    size = runs[0][3].std(axis=0)
    step = 2.0 * np.pi / 2.0 ** rng.integers(12, 21)
    quantised, noise = rng.random() < 0.5, 10.0 ** rng.uniform(-5.5, -4.0)
    white, coloured, ripple = rng.uniform(0.003, 0.03), rng.uniform(0.0, 0.05), rng.uniform(0, 0.05)
    memory, waves = np.exp(-dt / rng.uniform(0.005, 0.08)), int(rng.integers(30, 150))
    measured = []
    for q, _, _, tau in runs:
        e = rng.normal(size=(2, *q.shape))
        slow = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], e[1], axis=0)
        cogging = np.sin(waves * q + rng.uniform(0.0, 6.0, model.n))
        measured.append(tau + size * (white * e[0] + coloured * slow + ripple * cogging))
    q = runs[0][0]
    read = np.round(q / step) * step if quantised else q + noise * rng.normal(size=q.shape)
    return Case(kind, model, Log(dt, read, measured[0]), *runs[1][:3], measured[1])


def textbook(model, log, cutoff=20.0):
    """Butterworth filter of both sides, base columns by QR, weighted least squares: predictor."""
    dt, n = log.dt, model.n
    cutoff = min(cutoff, 0.4 / dt)
    sections = butter(4, cutoff, fs=1.0 / dt, output="sos")
    q, tau = (sosfiltfilt(sections, x, axis=0) for x in (log.q, log.tau))
    v = np.gradient(q, dt, axis=0)
    a = np.gradient(v, dt, axis=0)
    cut = int(np.ceil(2.0 / cutoff / dt))
    inner = slice(cut, -cut, max(1, len(q) // 20000))
    rng = np.random.default_rng(0)
    W = rm.torque_regressor(model, *rng.normal(size=(3, 300, n))).reshape(300 * n, -1)
    _, R, order = qr(W, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    kept = np.sort(order[: int((size > 1e-9 * size[0]).sum())])
    W = rm.torque_regressor(model, q[inner], v[inner], a[inner])[..., kept]
    y, weights = tau[inner], np.ones(n)
    for _ in range(2):
        A, b = (W * weights[:, None]).reshape(-1, len(kept)), (y * weights).reshape(-1)
        x = np.linalg.lstsq(A, b, rcond=None)[0]
        weights = 1.0 / (y - W @ x).std(axis=0)
    return lambda q, v, a: rm.torque_regressor(model, q, v, a)[..., kept] @ x


def pair(seed, seconds=30.0):
    """Two logs of one arm whose friction and joint 2 do what no model of the fit has."""
    rng = np.random.default_rng(seed)
    model, dt = arm(rng), 1.0 / float(rng.choice([250, 500]))
    of_load, at_rest, spring = rng.uniform(0.0, 0.03, 3)
    w = 2.0 * np.pi / seconds * np.arange(1, int(0.5 * seconds) + 1)
    t = dt * np.arange(round(seconds / dt))
    logs = []
    for _ in range(2):
        size = rng.normal(size=(2, len(w), model.n)) / np.sqrt(len(w))
        a, b = 1.2 * size / np.maximum(w, 0.6)[:, None]
        q, v, acc = waves(rng, model, t, w, a, b, (0.2, 0.25 / 1.2))
        tau = rm.idm(model, q, v, acc)
        load = tau.std(axis=0)
        tau = tau + of_load * np.abs(rm.idm(model, q, v, acc, drive=False)) * np.tanh(v / 0.05)
        tau = tau + at_rest * load * np.exp(-np.abs(v) / 0.1) * np.tanh(v / 0.02)
        tau[:, 1] += spring * load[1] * np.sin(q[:, 1] + 0.5) * np.cos(2.0 * q[:, 1])
        noise = rng.normal(size=(2, *q.shape))
        logs.append(Log(dt, q + 1e-5 * noise[0], tau + 0.02 * load * noise[1]))
    return model, logs
