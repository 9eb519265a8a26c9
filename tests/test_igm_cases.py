"""Few poses of few arms, quick also where kernels run as plain Python: every step must be right."""

from itertools import product

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.igm.closed_form import closed_form_postures, plan_loop
from robotmodels.igm.loop import joint_chain

SERVED = ("rx90", "stanford_arm", "irb140", "ur5", "ur10e", "gantry")


@pytest.mark.parametrize("name", SERVED)
@pytest.mark.parametrize("seed", range(2))
def test_closed_forms_give_back_the_posture_and_true_ones_beside_it(name, seed):
    check(rm.load(name).with_base(np.eye(4)).with_tool(np.eye(4)), np.random.default_rng(seed))


@pytest.mark.parametrize("sigma", list(product((0, 1), repeat=3)), ids=str)
@pytest.mark.parametrize("seed", range(2))
def test_wrists_behind_any_three_joints(sigma, seed):
    rng = np.random.default_rng(seed)
    rows = [
        {"sigma": kind, "alpha": alpha, "d": d, "theta": theta, "r": r}
        for kind, (alpha, d, theta, r) in zip(sigma, rng.uniform(0.3, 1.2, (3, 4)), strict=True)
    ]
    rows += [{"sigma": 0, "alpha": a, "d": d, "r": r} for a, d, r in rng.uniform(0.3, 1.2, (1, 3))]
    rows += [{"sigma": 0, "alpha": a} for a in rng.uniform(0.7, 1.5, 2)]
    check(rm.RobotModel.from_table(rm.DHTable.from_rows(rows)), rng)


def check(model, rng):
    """A posture comes back, among others that meet its pose; none comes twice."""
    chain = joint_chain(model)
    q = rng.uniform(-2.0, 2.0, 6)
    q[chain.sigma == 1] *= 0.2
    T = rm.dgm(model, q)
    found, valid, free = closed_form_postures(plan_loop(chain), chain, T[None], q[None])
    postures = found[0][valid[0]]
    assert len(postures) > 1
    assert not free.any()
    np.testing.assert_allclose(rm.dgm(model, postures), np.broadcast_to(T, (len(postures), 4, 4)),
                               rtol=0, atol=1e-9)  # fmt: skip
    apart = postures - q
    turning = chain.sigma == 0
    apart[:, turning] = (apart[:, turning] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(apart).max(axis=1).min() < 1e-8
    # none is found twice
    between = postures[:, None] - postures
    between[..., turning] = (between[..., turning] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(between).max(axis=-1)[np.triu_indices(len(postures), 1)].min() > 1e-6
