"""Torques of a model before and after it was written as a URDF and read again."""

import warnings

import numpy as np

import robotmodels as rm


def urdf_parity(model, rng, samples=100):
    """Largest relative differences of link torques, of all torques and of friction; what is lost.

    Joints may come in another order; what a URDF has no place for (rotors, offsets, coupled
    motors) is added to the torques of both.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        text = rm.to_urdf(model)
    lost = [str(w.message) for w in caught if issubclass(w.category, rm.errors.UrdfWarning)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rm.errors.UrdfWarning)
        again = rm.RobotModel.from_urdf(text, dynamics=True)
    names, read = ([m.table.names[j] for j in m.table.joint_rows] for m in (model, again))
    order = [names.index(name) for name in read]
    again = again.with_gravity(model.gravity)
    sliding = model.table.sigma[model.table.joint_rows] == 1
    q = rng.uniform(-np.pi, np.pi, (samples, model.n)) * np.where(sliding, 0.5 / np.pi, 1.0)
    v, a = rng.uniform(-2.0, 2.0, (2, samples, model.n))
    friction = max(
        difference(getattr(again.drive, kind), getattr(model.drive, kind)[order])
        for kind in ("Fv", "Fc")
    )
    links = rm.idm(model, q, v, a, drive=False)[:, order]
    whole = rm.idm(model, q, v, a)[:, order]
    kept = (v * model.drive.Fv + np.sign(v) * model.drive.Fc)[:, order]
    q, v, a = (x[:, order] for x in (q, v, a))
    found = rm.idm(again, q, v, a, drive=False)
    own = v * again.drive.Fv + np.sign(v) * again.drive.Fc
    drives = difference(found + own + (whole - links - kept), whole)
    return difference(found, links), drives, friction, lost


def difference(found, expected):
    """Largest difference relative to the largest expected number."""
    largest = np.abs(expected).max(initial=0.0)
    return np.abs(found - expected).max(initial=0.0) / (largest or 1.0)
