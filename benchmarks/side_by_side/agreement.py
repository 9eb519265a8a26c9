"""Whether two tools that are timed side by side computed the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.igm_peers import CLOSE, Peer

MODELS = 1e-10
"""Largest difference of poses, Jacobians, torques and regressors, to their largest number."""


class DisagreementError(RuntimeError):
    """Two tools gave different answers: their times must not be set side by side."""


def same(what: str, ours: Any, theirs: Any) -> Callable[[Any], str]:
    """A note of the largest difference of two arrays.

    Raises
    ------
    DisagreementError
        If the arrays differ by more than `MODELS` of the largest number in them.
    """
    first, second = np.asarray(ours), np.asarray(theirs)
    if first.shape != second.shape:
        raise DisagreementError(f"{what}: shape {second.shape}, ours {first.shape}.")
    off = float(np.abs(first - second).max() / max(1.0, np.abs(first).max()))
    if not off <= MODELS:
        raise DisagreementError(f"{what} differs from ours by {off:.1e}, more than {MODELS:g}.")
    note = f"as ours to {off:.0e} on {len(first)}"
    return lambda _: note


def same_robot(model: rm.RobotModel, peer: Peer) -> bool:
    """Whether the peer's own direct model is ours."""
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (20, model.n))
    away = [np.abs(peer.direct(x) - T).max() for x, T in zip(q, rm.dgm(model, q), strict=True)]
    return max(away) <= MODELS


def same_postures(
    what: str, model: rm.RobotModel, T: np.ndarray, peer: Peer, found: Any, every: bool = True
) -> str:
    """A note on the postures of poses, compared with those of ours.

    Parameters
    ----------
    what
        Who gave them, for the message.
    model
        Ours.
    T
        Poses, shape (N, 4, 4).
    peer
        Of the same robot as ours.
    found
        What the peer gave, for each pose.
    every
        Whether it claims to give all of them.

    Raises
    ------
    DisagreementError
        If it lacks a posture of ours, or has one that reaches the pose and is not among ours.
    """
    own = rm.igm(model, T)
    lost = new = beside = total = 0
    gap = 0.0
    for k, answer in enumerate(found):
        ours, theirs = own.q[k][own.valid[k]], peer.postures(answer)
        reach = np.array([np.abs(peer.direct(q) - T[k]).max() <= CLOSE for q in theirs], bool)
        beside += int((~reach).sum())
        theirs = theirs[reach]
        total += len(theirs)
        turn = (ours[:, None] - theirs[None] + np.pi) % (2.0 * np.pi) - np.pi
        away = np.abs(turn).max(axis=2)
        lost += int((away.min(axis=1, initial=np.inf) > CLOSE).sum()) if every else 0
        nearest = away.min(axis=0, initial=np.inf)
        new += int((nearest > CLOSE).sum())
        gap = max(gap, float(nearest.max(initial=0.0)))
    if lost or new or not total:
        raise DisagreementError(
            f"{what} on {len(T)} poses: {total} postures, {lost} of ours are not among them, "
            f"{new} are not among ours."
        )
    note = f"{total} postures of {len(T)} poses, as ours to {gap:.0e} rad"
    return note + (f", and {beside} that miss the pose" if beside else "")
