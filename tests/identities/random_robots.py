"""Random robots: builders that take a NumPy generator, and hypothesis strategies around them.

    rng = np.random.default_rng(0)
    model = random_model(rng, f=7, tree=True, fixed=True, drive=True)
    q, v, a = random_state(model, rng, 5)            # each (5, n)

    @given(case=models(tree=True))                   # or serial_models(), any_models()
    def test_x(case): ...                            # case is a RobotModel

Hypothesis draws (and shrinks) the structure and the options; the numbers come from a seed that it
draws too, so a failing example prints the call that builds it again.
"""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

import robotmodels as rm

QUARTER = np.pi / 2


# --- numbers -----------------------------------------------------------------------------------


def random_rotation(rng):
    """A rotation matrix, uniform on the group."""
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return Q if np.linalg.det(Q) > 0 else -Q


def random_pose(rng, size=1.0):
    """A pose (4, 4), its position of about the given size."""
    T = np.eye(4)
    T[:3, :3] = random_rotation(rng)
    T[:3, 3] = size * rng.normal(size=3)
    return T


def random_angle(rng):
    """Zero, a multiple of a right angle, or anything."""
    return rng.choice([0.0, rng.integers(-2, 3) * QUARTER, rng.uniform(-np.pi, np.pi)])


def random_length(rng):
    """Zero as often as not, else up to a metre with either sign."""
    return rng.choice([0.0, rng.uniform(-1.0, 1.0)])


def random_beta(rng):
    """Mostly zero, else from rounding size to large."""
    return rng.choice([0.0, 0.0, 10.0 ** rng.uniform(-12, -2), rng.uniform(-np.pi, np.pi)])


# --- parts -------------------------------------------------------------------------------------


def random_names(rng, f):
    """Names that sort otherwise than they are numbered (J10 before J2), in any order."""
    return tuple(f"J{k}" for k in rng.permutation(np.arange(1, f + 12))[:f])


def random_table(rng, f=6, tree=False, prismatic=True, fixed=False, passive=False, limits=True):
    """A table of f rows with at least one moving joint.

    tree: branches, several of them at the base, gamma and b on any row. fixed: some rows have
    sigma = 2. passive: some joints have mu = 0.
    """
    antecedent = np.arange(f)
    if tree:
        branch = rng.random(f) < 0.5
        antecedent = np.where(branch, [rng.integers(0, j + 1) for j in range(f)], antecedent)
    kinds = [0, 0] + [1] * prismatic + [2] * fixed
    sigma = rng.choice(kinds, size=f)
    if (sigma == 2).all():
        sigma[rng.integers(f)] = 0
    n = int((sigma != 2).sum())
    beside = rng.random(f) < 0.4
    table = {
        "gamma": [random_angle(rng) * tree * s for s in beside],
        "b": [random_length(rng) * tree * s for s in beside],
        "beta": [random_beta(rng) for _ in range(f)],
        "alpha": [random_angle(rng) for _ in range(f)],
        "d": [random_length(rng) for _ in range(f)],
        "theta": [random_angle(rng) for _ in range(f)],
        "r": [random_length(rng) for _ in range(f)],
    }
    if limits:
        lower = -rng.uniform(0.1, 3.0, size=n)
        infinite = rng.random(n) < 0.2
        table |= {
            "lower": np.where(infinite, -np.inf, lower),
            "upper": np.where(infinite, np.inf, lower + rng.uniform(0.2, 6.0, size=n)),
            "velocity": np.where(infinite, np.inf, rng.uniform(0.5, 5.0, size=n)),
            "effort": np.where(infinite, np.inf, rng.uniform(5.0, 500.0, size=n)),
        }
    return rm.DHTable(
        antecedent=antecedent,
        sigma=sigma,
        mu=rng.integers(0, 2, size=f) if passive else None,
        names=random_names(rng, f),
        **table,
    )


def random_bodies(rng, f):
    """Inertial parameters of f real bodies: sets of twelve point masses near the frames."""
    rows = []
    for _ in range(f):
        points = 0.1 * rng.normal(size=(12, 3)) + 0.2 * rng.normal(size=3)
        masses = rng.uniform(0.05, 0.5, size=12)
        second = np.einsum("k,ki,kj->ij", masses, points, points)
        tensor = np.trace(second) * np.eye(3) - second
        rows.append([*tensor[np.triu_indices(3)], *(masses @ points), masses.sum()])
    return rm.InertialParameters(rows)


def random_parameters(rng, f):
    """Any real numbers, as identified: M = 0 with first moments, M < 0, rows of zeros."""
    values = rng.normal(size=(f, 10))
    values[:, 9] = rng.choice([0.0, -1.0, 1.0], size=f) * rng.uniform(0.1, 3.0, size=f)
    values[rng.random(f) < 0.2] = 0.0
    values[0, 6:] = 0.3, -0.2, 0.1, 0.0
    return rm.InertialParameters(values)


def random_drive(rng, n):
    """Rotor inertia, frictions and offsets of n joints."""
    return rm.DriveParameters(
        Ia=rng.uniform(0.05, 2.0, size=n),
        Fv=rng.uniform(0.1, 5.0, size=n),
        Fc=rng.uniform(0.1, 5.0, size=n),
        offset=rng.normal(size=n),
    )


def random_transmission(rng, n, coupled=True):
    """Gears with a reference offset; coupled: the last two motors turn as a TX40's wrist does."""
    K = np.diag(rng.choice([-1.0, 1.0], size=n) / rng.uniform(20.0, 120.0, size=n))
    terms = {}
    if coupled and n >= 2:
        K[-1, -2] = rng.uniform(0.3, 1.0) * K[-1, -1]
        terms = {
            key: np.r_[np.zeros(n - 1), rng.uniform(0.01, 0.5)] for key in ("Iam", "Fvm", "Fcm")
        }
    return rm.Transmission(K, rng.normal(size=n), **terms)


# --- models ------------------------------------------------------------------------------------


def random_model(
    rng,
    f=6,
    tree=False,
    prismatic=True,
    fixed=False,
    passive=False,
    inertia="physical",
    drive=False,
    transmission=False,
    base=True,
    tool=True,
    tip=None,
    gravity=True,
    limits=True,
    name="random",
):
    """A robot of f frames.

    inertia: "physical", "any" (see `random_parameters`) or None. base, tool, gravity: random, or
    the defaults. tip: None takes the last frame, "any" a random one.
    """
    table = random_table(rng, f, tree, prismatic, fixed, passive, limits)
    bodies = {"physical": random_bodies, "any": random_parameters, None: lambda *_: None}[inertia]
    robot = rm.RobotModel.from_table(
        table,
        inertia=bodies(rng, f),
        drive=random_drive(rng, table.n) if drive else None,
        base=random_pose(rng) if base else None,
        tool=random_pose(rng, 0.2) if tool else None,
        tip=int(rng.integers(1, f + 1)) if tip == "any" else tip,
        gravity=9.81 * random_rotation(rng)[0] if gravity else (0.0, 0.0, -9.81),
        transmission=random_transmission(rng, table.n) if transmission else None,
        name=name,
    )
    return robot.with_drive(with_coupled_rotors(robot)) if transmission else robot


def with_coupled_rotors(robot):
    """The drives, with the rotors of coupled motors in the Ia of every joint that turns them.

    Iam alone is the part of such a rotor that couples joints: without the rest it is of no motor.
    """
    turns = np.linalg.inv(robot.transmission.matrix)
    ratios = turns / np.diag(turns)[:, None]
    return replace(robot.drive, Ia=robot.drive.Ia + robot.transmission.Iam @ ratios**2)


def random_state(model, rng, *batch):
    """q, v, a of shapes (*batch, n): angles in (-pi, pi), strokes and rates of order one."""
    shape = (*batch, model.n)
    prismatic = model.table.sigma[model.table.joint_rows] == 1
    q = rng.uniform(-np.pi, np.pi, size=shape) * np.where(prismatic, 0.3, 1.0)
    return q, rng.normal(size=shape), rng.normal(size=shape)


def table_poses(model, q):
    """World poses (f, 4, 4) of R_1..R_f as the plain product of the table's factors, one q."""
    poses = [model.base]
    for j, T in enumerate(rm.link_transforms(model.table, q)):
        poses.append(poses[model.table.antecedent[j]] @ T)
    return np.array(poses[1:])


def robot_size(model, q):
    """A length to which errors of positions are relative: at least 1 m."""
    poses = table_poses(model, q)
    return max(1.0, float(np.abs(poses[:, :3, 3]).max()), float(np.abs(model.tool[:3, 3]).max()))


# --- strategies --------------------------------------------------------------------------------

seeds = st.integers(0, 2**32 - 1)


@st.composite
def models(draw, max_frames=8, **options):
    """Robots of 1 to max_frames frames; any option of `random_model` may be pinned."""
    choices = {
        "tree": st.booleans(),
        "prismatic": st.booleans(),
        "fixed": st.booleans(),
        "passive": st.just(False),
        "inertia": st.just("physical"),
        "drive": st.booleans(),
        "transmission": st.booleans(),
        "base": st.booleans(),
        "tool": st.booleans(),
        "tip": st.sampled_from([None, "any"]),
        "gravity": st.booleans(),
    }
    unknown = set(options) - {*choices, "limits"}
    if unknown:
        raise TypeError(f"models() has no options {sorted(unknown)}")
    chosen = {k: options[k] if k in options else draw(c) for k, c in choices.items()}
    f = draw(st.integers(1, max_frames))
    seed = draw(seeds)
    return random_model(
        np.random.default_rng(seed), f=f, **chosen, limits=options.get("limits", True),
        name=f"seed_{seed}",
    )  # fmt: skip


def serial_models(**options):
    """Chains without fixed frames."""
    return models(**{"tree": False, "fixed": False, **options})


def any_models(**options):
    """Everything, non-physical inertia and passive joints included."""
    return st.sampled_from(["physical", "any"]).flatmap(
        lambda inertia: models(**{"inertia": inertia, "passive": True, **options})
    )


def close(actual, expected, tolerance=1e-12):
    """Equal relative to the largest number, at least one."""
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


def within(actual, expected, tolerance=1e-12):
    """Of one shape, and nowhere further apart than the tolerance."""
    assert np.shape(actual) == np.shape(expected)
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)
