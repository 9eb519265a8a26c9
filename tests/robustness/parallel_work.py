"""Calls whose numbers must not depend on who else computes at the same time."""

import hashlib

import numpy as np
from looped_robots import four_bar

import robotmodels as rm
from robotmodels import calibration, control, flexible, identification, loops, parallel, se3
from robotmodels import visual_servoing as vs

SERIAL = ("rx90", "planar_2r", "stanford_arm", "puma560")


def robots():
    """Robots of different sizes and kinds, with inertia: one thread's data are not another's."""
    models = map(rm.load, SERIAL)
    return tuple(model.with_inertia(rm.uniform_bodies(model, 4.0)) for model in models)


def digest(*values):
    """The bits of arrays."""
    total = hashlib.sha256()
    for value in values:
        array = np.ascontiguousarray(value)
        total.update(str((array.shape, array.dtype)).encode() + array.tobytes())
    return total.hexdigest()


def states(model, seed, count=20):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.0, 1.0, (4, count, model.n))


def models_of_motion(model, seed=0):
    """Direct models one by one and as batches, which take different ways."""
    q, v, a, tau = states(model, seed)
    parts = []
    for k in range(len(q)):
        parts += [
            rm.dgm(model, q[k]), rm.jacobian(model, q[k]), rm.idm(model, q[k], v[k], a[k]),
            rm.ddm(model, q[k], v[k], tau[k]), rm.mass_matrix(model, q[k]),
            rm.gravity_torque(model, q[k]), rm.torque_regressor(model, q[k], v[k], a[k]),
        ]  # fmt: skip
    parts += [rm.dgm(model, q), rm.jacobian(model, q), rm.idm(model, q, v, a),
              rm.ddm(model, q, v, tau), rm.torque_regressor(model, q, v, a)]  # fmt: skip
    return digest(*parts)


def inverse_models(model, seed=0):
    q, v = states(model, seed, 4)[:2]
    T = rm.dgm(model, q)
    twist = (rm.jacobian(model, q) @ v[..., None])[..., 0]
    found = rm.ikm(model, q, twist)
    parts = [found.v, found.status]
    if model.n == 6:
        solutions = rm.igm(model, T, q_ref=q)
        parts += [solutions.q, solutions.residual, solutions.branch]
        numeric = rm.igm_numeric(model, T, q0=q + 0.05, rng=seed)
        parts += [numeric.q, numeric.status]
    return digest(*parts)


def minimal_parameters(model, seed=0):
    found = rm.base_parameters(model, method="numeric")
    symbolic = rm.base_parameters(model)
    return digest(found.matrix, symbolic.matrix, np.array(symbolic.names))


def motion(model, seed=0):
    q, v, _, tau = states(model, seed, 1)
    found = rm.simulate(model, q[0], v[0], 0.1 * tau[0], t=np.linspace(0.0, 0.05, 6))
    return digest(found.q, found.v)


def calibrated(model, seed=0):
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.0, 1.0, (12, model.n))
    p = rm.dgm(model, q)[:, :3, 3] + 1e-4 * rng.normal(size=(12, 3))
    measured = [calibration.Position(q, p)]
    found = calibration.fit(
        model, measured, parameters=("theta2",), base=False, tool=False, rng=seed
    )
    return digest(found.values, found.covariance)


def identified(model, seed=0):
    t, w = 0.005 * np.arange(800)[:, None], np.linspace(2.0, 4.0, model.n)
    q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    log = identification.Log(0.005, q, rm.idm(model, q, v, a) + 2.0 * v)
    found = identification.fit(model, log, drive=("Fv",))
    return digest(found.values)


def later_chapters(model, seed=0):
    """A platform, a controlled arm, a camera, flexible links and a loop, all of this seed."""
    rng = np.random.default_rng(seed + model.n)
    hexapod = parallel.gough_symmetric(1.0 + 0.01 * model.n)
    T = hexapod.pose([*0.1 * rng.normal(size=2), 1.0, *0.1 * rng.normal(size=3)])
    legs = parallel.igm(hexapod, T).q[0]
    q, v, _, tau = states(model, seed, 1)[:, 0]
    law = control.ComputedTorque(q, omega=8.0, model=model)
    run = control.run(model, law, q + 0.1, v, t=np.linspace(0.0, 0.02, 3)).simulation
    square = np.array([[-1, -1, 0.0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.1 * model.n]])
    seen = se3.translation(0.1, 0.2, 6.0) @ se3.rotation("x", 0.1 + 0.01 * seed)
    points = square @ seen[:3, :3].T + seen[:3, 3]
    pose = vs.pnp(square, points[:, :2] / points[:, 2:])
    link = flexible.beam(0.5, EI=(np.inf, 1.0), density=0.2, hub=0.1)
    arm = flexible.FlexibleRobot(rm.load("planar_2r"), {1: link, 2: link})
    bent = flexible.simulate(arm, q[:2], None, 0.1 * tau[:2], t=np.linspace(0.0, 0.02, 3))
    bar = four_bar(np.random.default_rng(0))
    closed = loops.close(bar, [0.5 + 0.1 * rng.random()])
    return digest(legs, parallel.dgm(hexapod, legs).T, run.q, pose.T, bent.q, bent.e, closed.q)


WORK = (models_of_motion, inverse_models, minimal_parameters, motion, calibrated, identified,
        later_chapters)  # fmt: skip


def everything(name_of_work, model, seed=0):
    """One of the above by its name, so that it can be sent to another process."""
    return {work.__name__: work for work in WORK}[name_of_work](model, seed)
