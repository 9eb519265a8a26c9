"""How many solutions there are, pose by pose, as frozen in `oracles/igm_counts.json`."""

import json
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm

FROZEN = json.loads(
    (Path(__file__).parent / "oracles" / "igm_counts.json").read_text(encoding="utf-8")
)
ROUNDING = 2
"""Of the 90 poses of an arm, those at which last digits may decide: another processor merges
two solutions beside a singularity that this one keeps apart, or the other way round."""
LOST: dict[str, int] = {"crx10ia": 1}
"""Further poses of an arm that may have fewer solutions than frozen, as README says."""


def solved(name, kept):
    """The solutions of the frozen poses, each checked; the posture of the pose is among them."""
    model, q = rm.load(name), np.array(kept["q"])
    T = rm.dgm(model, q)
    found = rm.igm(model, T, q_ref=q)
    i, s = np.nonzero(found.valid)
    assert np.abs(rm.dgm(model, found.q[i, s]) - T[i]).max(initial=0.0) < 1e-8
    turns = model.table.sigma[model.table.joint_rows] == 0
    difference = found.q - q[:, None]
    difference[..., turns] = np.angle(np.exp(1j * difference[..., turns]))
    gaps = np.where(found.valid, np.abs(difference).max(axis=-1, initial=0.0), np.inf)
    return found, gaps.min(axis=-1, initial=np.inf)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("rx90", "ur5", "crx10ia") else pytest.mark.nightly)
        for name in FROZEN["singular"]
    ],
)
def test_singular_poses_and_those_beside_them_keep_their_solutions(name):
    kept = FROZEN["singular"][name]
    found, nearest = solved(name, kept)
    assert (nearest > 1e-5).sum() <= ROUNDING
    change = found.count - np.array(kept["count"])
    fewer = [(kept["kind"][k], kept["away"][k]) for k in np.flatnonzero(change < 0)]
    assert len(fewer) <= ROUNDING + LOST.get(name, 0), fewer
    assert (change > 0).sum() <= ROUNDING
    assert (found.double.sum(axis=1) != np.array(kept["double"])).sum() <= ROUNDING + len(fewer)


@pytest.mark.sampled(24)
@pytest.mark.parametrize("name", FROZEN["regular"])
def test_regular_poses_of_every_arm_keep_their_solutions(name):
    kept = FROZEN["regular"][name]
    found, nearest = solved(name, kept)
    assert found.count.tolist() == kept["count"]
    assert nearest.max() < 1e-6
