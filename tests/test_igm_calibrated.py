"""Arms that have a closed form up to calibration errors or rounded numbers."""

from functools import cache

import numpy as np
import pytest

import robotmodels as rm

ARMS = ("rx90", "puma560", "kr6_r900", "stanford_arm", "ur5e", "ur10e")
LENGTHS, ANGLES = ("d", "b", "r"), ("alpha", "beta", "gamma", "theta")


@cache
def changed(name, seed, share=1.0):
    """The arm with every parameter off by up to 5 mm and 0.5 deg, or a share of it."""
    return off(rm.load(name), seed, share * 5e-3, share * np.deg2rad(0.5))


def off(arm, seed, length, angle):
    rng, table = np.random.default_rng(seed), arm.table
    columns = {c: getattr(table, c) + rng.uniform(-length, length, table.f) for c in LENGTHS}
    columns |= {c: getattr(table, c) + rng.uniform(-angle, angle, table.f) for c in ANGLES}
    return arm.with_table(table.replace(**columns))


def configurations(model, count, seed=0):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 6))
    q[:, turns(model) == 0] *= 0.2
    return q


def turns(model):
    return model.table.sigma[model.table.joint_rows] == 0


def lost(model, found, q):
    d = found.q - q[:, None]
    d = np.abs(np.where(turns(model), (d + np.pi) % (2 * np.pi) - np.pi, d)).max(axis=-1)
    return np.where(np.isnan(d), np.inf, d).min(axis=1) > 1e-6


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ARMS)
def test_solutions_are_found_again_and_nothing_else_is_returned(name):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        model = changed(name, seed).with_base(rm.se3.translation(*rng.normal(size=3)))
        q = configurations(model, 60, seed)
        T = rm.dgm(model, q)
        found = rm.igm(model, T)
        assert "elimination" in found.method
        assert np.nanmax(found.residual) <= 1e-12
        errors = np.abs(rm.dgm(model, found.q[found.valid]) - T[found.valid.nonzero()[0]])
        assert errors.max() <= 4e-12
        assert not lost(model, found, q).any()
        # real solutions of six equations come in pairs
        assert np.all((found.valid.sum(axis=1) + found.double.sum(axis=1)) % 2 == 0)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", ["rx90", "ur5e", "stanford_arm"])
@pytest.mark.parametrize("digits", [4, 5, 6])
def test_rounded_urdf_numbers(name, digits):
    model = off(rm.load(name), digits, 0.5 * 10.0**-digits, 0.5 * 10.0**-digits)
    q = configurations(model, 200, seed=digits)
    q[:100, 4] = np.repeat([0.0, 1e-9, 1e-6, 1e-3], 25)  # beside the singular wrist
    if name == "stanford_arm":
        q[:100, 2] = 0.3  # not drawn in: there the arm is singular a second time
    found = rm.igm(model, rm.dgm(model, q))
    # a fold that misses the pose by less than the tolerance counts as a double solution
    assert found.residual[found.valid & ~found.double].max() <= 1e-12
    assert found.double.sum() <= 2
    assert not lost(model, found, q)[100:].any()
    assert lost(model, found, q)[:100].sum() <= 1
