"""Write `igm_counts.json`: how many solutions `rm.igm` finds, pose by pose.

    python tests/oracles/make_igm_counts.py

Poses of eight arms, 60 of 100 of them singular or 1e-12 to 1e-3 rad beside a singularity, made by
`benchmarks.igm_postures` with a fixed seed; and regular poses of every arm of the catalogue with
at most seven joints. The postures are kept with the counts, so that neither file depends on the
generator. Made before the redesign of `igm`; 43 poses where two or three singularities come
together, and two beside the folded elbow of the RX-90, were counted anew after it: members of one
self-motion that stood there as separate solutions are one.
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import robotmodels as rm
from benchmarks.igm_postures import Kind, sample, uniform

ARMS = ("rx90", "puma560", "irb6640", "kr6_r900", "ur5", "ur5e", "crx10ia", "xarm6")
GENERAL = ("crx10ia", "xarm6")
POSES, SINGULAR, REGULAR = 90, 0.6, 3
MOST_JOINTS = 7


def singular_poses() -> dict[str, dict[str, list]]:
    """Postures, kinds and counts of the eight arms."""
    kept = {}
    for name in ARMS:
        model = rm.load(name)
        chosen = sample(model, name in GENERAL, POSES, SINGULAR, np.random.default_rng(11))
        found = rm.igm(model, rm.dgm(model, chosen.q), q_ref=chosen.q)
        kept[name] = {
            "kind": [tuple(Kind)[k].value for k in chosen.kind],
            "away": chosen.away.tolist(),
            "count": found.count.tolist(),
            "double": found.double.sum(axis=1).tolist(),
            "q": chosen.q.tolist(),
        }
    return kept


def regular_poses() -> dict[str, dict[str, list]]:
    """Postures and counts of the catalogue, with the posture itself as reference."""
    kept = {}
    for name in rm.robots():
        model = rm.load(name)
        if model.n > MOST_JOINTS:
            continue
        q = np.round(uniform(model, REGULAR, np.random.default_rng(7)), 6)
        found = rm.igm(model, rm.dgm(model, q), q_ref=q)
        kept[name] = {"count": found.count.tolist(), "q": q.tolist()}
    return kept


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    data = {"singular": singular_poses(), "regular": regular_poses()}
    text = json.dumps(data).replace('"q": [[', '\n"q": [[').replace("]], ", "]],\n")
    (Path(__file__).parent / "igm_counts.json").write_text(text + "\n", encoding="utf-8")
