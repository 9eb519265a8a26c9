"""An independent search for postures of a chain of joints, and what it is compared by."""

import numpy as np

from robotmodels.igm.motion import jacobians, tool_poses


def missing(U, T):
    """Position [m] and the sine of the angle missing, (..., 6)."""
    E = U[..., :3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2)
    sine = np.stack([E[..., j, i] - E[..., i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
    return np.concatenate([U[..., :3, 3] - T[..., :3, 3], 0.5 * sine], axis=-1)


def apart(chain, a, b):
    """Largest difference in a joint, angles by the shorter way round."""
    d = np.abs(a - b)
    return np.where(chain.sigma == 0, np.minimum(d, 2 * np.pi - d), d).max(axis=-1)


def draw(chain, N, rng, stroke=0.2):
    """Random postures (N, k)."""
    q = rng.uniform(-np.pi, np.pi, (N, chain.k))
    return np.where(chain.sigma == 0, q, stroke * q)


def searched(chain, U, rng, starts=400, free=None, values=None):
    """Postures with some joints at given values, by Gauss-Newton from many random starts."""
    q, rest = draw(chain, starts, rng), np.ones(chain.k, bool) if free is None else ~free
    q[:, ~rest] = values
    for _ in range(50):
        T, J = tool_poses(chain, q), jacobians(chain, q)
        step = (np.linalg.pinv(J[:, :, rest], rcond=1e-9) @ missing(U, T)[..., None])[..., 0]
        largest = np.abs(step).max(axis=1)[:, None]
        q[:, rest] += step * np.minimum(1.0, 0.5 / np.maximum(largest, 1e-9))
    T = tool_poses(chain, q)
    met = (np.abs(missing(U, T)).max(axis=1) < 1e-9) & (np.einsum("ij,nij->n", U, T) > 3.0)
    q = np.where(chain.sigma == 0, np.remainder(q + np.pi, 2 * np.pi) - np.pi, q)
    found = []
    for one in q[met]:
        if all(apart(chain, one, other) > 1e-4 for other in found):
            found.append(one)
    return found
