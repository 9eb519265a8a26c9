"""Feasible paths, polytopes, dexterity, their figures and commands."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from test_performance import LIMITED, PLANE, POSITION, TWO, WENGER, planar

import robotmodels as rm
from robotmodels import performance as pf
from robotmodels.cli import main
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.se3 import translation

RNG = np.random.default_rng(11)


def straight(arm, q, way, count=80):
    start = rm.dgm(arm, q)
    shift = np.linspace(0, 1, count)[:, None] * np.array(way)
    return np.array([translation(*s) @ start for s in shift])


# --- paths ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["puma560", "ur5e", "crx10ia", "cobra_s600", "planar_3r"])
def test_a_known_joint_motion_is_found(name):
    arm = rm.load(name)
    q = RNG.uniform(0.5, 1, arm.n) + np.linspace(0, 0.4, 60)[:, None] * RNG.uniform(-1, 1, arm.n)
    found = pf.feasible_path(arm, rm.dgm(arm, q), limits=False)
    assert found.status is pf.PathStatus.FOLLOWED
    np.testing.assert_allclose(rm.dgm(arm, found.q), rm.dgm(arm, q), atol=1e-9)
    assert np.abs(np.diff(found.q, axis=0)).max() < 0.2
    away = np.abs((found.postures - q[:, None] + np.pi) % (2 * np.pi) - np.pi).max(axis=2)
    chain = [int(np.nanargmin(away[0]))]
    for row in found.following:
        chain.append(int(row[chain[-1]]))
    assert away[np.arange(60), chain].max() < 1e-6  # the posture that goes on is the one that was
    factors = rm.explain_singularities(arm).values(found.q) > 0
    assert (found.aspect == factors @ (1 << np.arange(factors.shape[1]))).all()


def test_a_line_breaks_for_some_postures():
    crx = rm.load("crx10ia")
    line = straight(crx, [0.3, -1.5, 0.6, -1.3, 1.3, 0.7], [1, 0.3, -0.6], 100)
    found = pf.feasible_path(crx, line, limits=False)
    assert found.reached.sum() == 2
    assert (found.breaks[found.reached] == 100).all()
    assert (found.breaks[~found.reached] < 100).all()
    # where one breaks a singular position is near
    for s in np.flatnonzero(~found.reached):
        at = s
        for k in range(found.breaks[s] - 1):
            at = found.following[k, at]
        q = found.postures[found.breaks[s] - 1, at]
        assert np.linalg.svd(rm.jacobian(crx, q), compute_uv=False)[-1] < 0.1
    assert np.ptp(found.aspect) == 0


def test_a_reached_line_that_no_posture_follows():
    crx = rm.load("crx10ia")
    line = straight(crx, [-0.6, -1.6, -0.4, -1.9, -0.8, 0.3], [0.2, -0.5, 0.4], 100)
    assert pf.accessibility(crx, line, limits=False).count.min() >= 4
    found = pf.feasible_path(crx, line, limits=False)
    assert found.status is pf.PathStatus.BROKEN
    assert str(found.breaks.max()) in found.reason()
    assert np.isnan(found.q[found.breaks.max() :]).all()
    iiwa = rm.load("iiwa14")
    found = pf.feasible_path(iiwa, rm.dgm(iiwa, np.zeros((3, 7))))
    assert found.status is pf.PathStatus.NOT_DEFINED
    nowhere = pf.feasible_path(TWO, np.array([translation(9, 0, 0)] * 3))
    assert (nowhere.status, len(nowhere.reached)) == (pf.PathStatus.BROKEN, 0)
    assert pf.feasible_path(TWO, np.zeros((0, 4, 4))).q.shape == (0, 2)


def test_limits_and_whole_turns():
    arm = planar(1.0, 0.6, lower=[-1, 0.1], upper=[9, 2])
    q = np.column_stack((np.linspace(0, 8.5, 200), np.full(200, 1.0)))
    found = pf.feasible_path(arm, rm.dgm(arm, q))
    assert found.reached.tolist() == [False, True] or found.reached.tolist() == [True, False]
    np.testing.assert_allclose(found.q, q, atol=1e-6)
    assert 0 in found.breaks  # the other elbow is outside the limits
    far = pf.feasible_path(arm, rm.dgm(arm, q + np.array([1.0, 0.0])))
    assert far.status is pf.PathStatus.BROKEN
    assert far.breaks.max() == np.argmax(q[:, 0] + 1 > 9)
    arm = planar(1.0, 0.6, lower=[2, 0.1], upper=[9, 2])  # a start beyond half a turn
    q = np.column_stack((np.linspace(3.5, 8.0, 100), np.full(100, 1.0)))
    np.testing.assert_allclose(pf.feasible_path(arm, rm.dgm(arm, q)).q, q, atol=1e-6)


def test_through_a_singular_position():
    arm = TWO
    q = np.column_stack((np.linspace(0, 0.2, 41), np.linspace(-0.2, 0.2, 41)))
    T = rm.dgm(arm, q)
    assert pf.feasible_path(arm, T).status is pf.PathStatus.BROKEN
    found = pf.feasible_path(arm, T, through_singular=True)
    assert found.status is pf.PathStatus.FOLLOWED
    np.testing.assert_allclose(rm.dgm(arm, found.q)[:, :2, 3], T[:, :2, 3], atol=1e-8)


def test_the_best_motion_has_the_least_cost():
    arm = rm.load("puma560")
    line = straight(arm, [0.2, 0.3, -0.4, 0.5, 0.6, 0.1], [0.05, 0.1, 0.05])
    found = pf.feasible_path(arm, line, limits=False)
    lengths = []
    for s in range(len(found.reached)):
        at, total = s, 0.0
        for k, row in enumerate(found.following):
            step = found.postures[k + 1, row[at]] - found.postures[k, at]
            total += np.linalg.norm((step + np.pi) % (2 * np.pi) - np.pi)
            at = row[at]
        lengths.append(total)
    best = np.linalg.norm(np.diff(found.q, axis=0), axis=1).sum()
    assert best == pytest.approx(min(lengths), rel=1e-9)
    other = pf.feasible_path(arm, line, limits=False, cost="conditioning")
    assert other.status is pf.PathStatus.FOLLOWED


# --- polytopes -----------------------------------------------------------------------------------


MASKS = [[1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1], PLANE, [0, 0, 1, 0, 0, 0], [1] * 6]


def limited(arm):
    """The arm with limits of velocities and efforts."""
    limits = {"velocity": np.linspace(1, 2, arm.n), "effort": np.linspace(9, 5, arm.n)}
    return arm.with_table(replace(arm.table, **limits))


@pytest.mark.parametrize("mask", MASKS)
@pytest.mark.parametrize("name", ["ur5e", "panda", "cobra_s600", "planar_2r"])
def test_velocity_polytope_has_the_extremes_of_the_box(name, mask):
    arm, rows = limited(rm.load(name)), np.array(mask, bool)
    for q in (RNG.uniform(-2, 2, arm.n), np.zeros(arm.n)):
        found = pf.polytope(arm, q, "velocity", mask)
        G = rm.jacobian(arm, q)[rows] * arm.table.velocity
        d = RNG.normal(size=(300, len(G)))
        np.testing.assert_allclose((d @ found.vertices.T).max(axis=1), np.abs(d @ G).sum(axis=1),
                                   rtol=1e-9, atol=1e-9)  # fmt: skip
        full = np.linalg.matrix_rank(G, tol=1e-8) == len(G)
        assert (found.status is pf.PolytopeStatus.BOUNDED) == full
        if full:
            support = np.abs(d @ G).sum(axis=1) / np.linalg.norm(d, axis=1)
            assert found.radius <= support.min() + 1e-9
            if len(G) == 3:  # the origin is on one side of each face, a triangle
                a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
                n = np.cross(b - a, c - a)
                heights = np.abs((n * a).sum(1)) / (size := np.linalg.norm(n, axis=1))
                assert found.radius == pytest.approx(heights.min(), rel=1e-9)
                away = np.abs(found.vertices @ (n / size[:, None]).T)
                assert (away <= heights + 1e-8).all()


@pytest.mark.parametrize("k", [3, 2, 6])
@pytest.mark.parametrize("name", ["ur5e", "panda"])
def test_force_polytope_is_what_torques_balance(name, k):
    arm, mask = limited(rm.load(name)), [1] * k + [0] * (6 - k)
    q = RNG.uniform(-2, 2, arm.n)
    J, tau = rm.jacobian(arm, q)[:k], arm.table.effort
    found = pf.polytope(arm, q, "force", mask)
    assert (np.abs(found.vertices @ J) <= tau * (1 + 1e-8)).all()
    for d in RNG.normal(size=(8, k)):
        best = linprog(-d, np.vstack((J.T, -J.T)), np.tile(tau, 2), bounds=[(None, None)] * k)
        assert (found.vertices @ d).max() == pytest.approx(-best.fun, rel=1e-7)


def test_acceleration_polytope():
    arm, q = limited(rm.load("ur5e")), RNG.uniform(-2, 2, 6)
    found = pf.polytope(arm, q, "acceleration", "position")
    tau = RNG.choice([-1.0, 1.0], (400, 6)) * arm.table.effort
    v = np.zeros(6)
    a = rm.ddm(arm.with_gravity([0, 0, 0]), np.tile(q, (400, 1)), np.tile(v, (400, 1)), tau)
    images = a @ rm.jacobian(arm, q)[:3].T
    d = RNG.normal(size=(100, 3))
    assert ((d @ images.T).max(axis=1) <= (d @ found.vertices.T).max(axis=1) * (1 + 1e-9)).all()


def test_polytopes_without_inside_or_bound():
    two = limited(TWO)
    stretched = pf.polytope(two, [0.3, 0.0], "velocity", PLANE)
    assert stretched.status is pf.PolytopeStatus.FLAT
    assert stretched.radius == 0.0
    forces = pf.polytope(two, [0.3, 0.0], "force", PLANE)
    assert forces.status is pf.PolytopeStatus.UNBOUNDED
    for call, words in (
        ((rm.load("rx90"), np.zeros(6)), "velocity limits"),
        ((two, [[0, 1]]), "one configuration"),
        ((two, [0, 1], "acceleration", PLANE), "masses"),
    ):
        with pytest.raises((InvalidValueError, ShapeError), match=words):
            pf.polytope(*call)


# --- dexterity -----------------------------------------------------------------------------------


def test_isotropy_of_two_links():
    arm = planar(np.sqrt(2), 1.0)
    q = RNG.uniform(-3, 3, (4, 50, 2))
    found = pf.isotropy_index(arm, q)
    assert found.shape == (4, 50)
    J = rm.jacobian(arm, q)[..., :2, :]
    values = np.linalg.eigvalsh(J @ np.swapaxes(J, -1, -2))
    np.testing.assert_allclose(found, np.sqrt(values.prod(-1)) / values.mean(-1), atol=1e-9)
    assert pf.isotropy_index(arm, [0.4, 0.75 * np.pi]) == pytest.approx(1.0)
    assert pf.isotropy_index(arm, [0.4, 0.0]) < 1e-7
    puma, q = rm.load("puma560"), RNG.uniform(-2, 2, 6)
    J = rm.jacobian(puma, q) / np.repeat((0.3, 1.0), 3)[:, None]  # metres by a length
    values = np.linalg.eigvalsh(J @ J.T)
    expected = values.prod() ** (1 / 6) / values.mean()
    assert pf.isotropy_index(puma, q, None, 0.3) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("index", ["inverse_condition", "manipulability", "least_singular_value",
                                   "isotropy"])  # fmt: skip
def test_maps_are_those_of_the_postures(index):
    w = pf.workspace(WENGER, resolution=12)
    found = pf.dexterity_map(WENGER, w, index)
    best, mean = found
    assert np.isnan(best[w.count == 0]).all()
    for count in (2, 4):
        k = int(np.argmax(w.count == count))
        q = rm.igm(WENGER, w.poses[k], mask=POSITION).q
        s = np.linalg.svd(rm.jacobian(WENGER, q)[:, :3], compute_uv=False)
        values = {
            "inverse_condition": s[:, 2] / s[:, 0],
            "manipulability": s.prod(axis=1),
            "least_singular_value": s[:, 2],
            "isotropy": (s**2).prod(axis=1) ** (1 / 3) / (s**2).mean(axis=1),
        }[index]
        assert best[k] == pytest.approx(values.max())
        assert mean[k] == pytest.approx(values.mean())


def test_means_over_joints_and_workspace():
    w = pf.workspace(TWO, resolution=150)
    joints = pf.global_index(TWO, "manipulability", "joints", w)
    assert joints == pytest.approx(0.6 * 2 / np.pi, rel=1e-3)
    assert joints.spread == pytest.approx(0.6 * np.sqrt(0.5 - 4 / np.pi**2), rel=1e-2)
    # over the area dA = l1 l2 |sin q2| dq: the mean of |sin| squared over that of |sin|
    over = pf.global_index(TWO, "manipulability", "workspace", w)
    assert over == pytest.approx(0.6 * np.pi / 4, rel=3e-3)


# --- figures and commands ------------------------------------------------------------------------


def test_figures_of_workspaces_aspects_and_paths():
    figure = rm.viz.plot_workspace(pf.workspace(LIMITED, resolution=30))
    assert {"boundary", "limit"} <= {x.get_label() for x in figure.axes[0].get_lines()}
    space = pf.workspace(WENGER, section="space", resolution=8)
    assert len(rm.viz.plot_workspace(space).axes) == 4
    assert len(rm.viz.plot_aspects(pf.aspects(WENGER)).axes) == 3
    line = straight(TWO, [0.1, 1.0], [1.0, 0.0, 0.0], 30)
    labels = rm.viz.plot_feasible_path(pf.feasible_path(TWO, line)).axes[0]
    assert "ends here" in labels.get_legend_handles_labels()[1]
    assert {"workspace/2", "workspace/4"} <= set(rm.viz.show_workspace(space).paths)


def test_command_workspace(capsys, tmp_path):
    words = ["workspace", "planar_2r", "--no-limits", "--picture", str(tmp_path / "section.png")]
    assert main(words) == 0
    assert "12.5664 m^2" in capsys.readouterr().out
    assert main(["workspace", "planar_2r", "--resolution", "10", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["by_postures"][0]["postures"] == 2
    assert main(["workspace", "planar_2r", "--resolution", "0"]) == 2
    assert "--resolution" in capsys.readouterr().err


def test_command_follow(capsys, tmp_path):
    file, motion = tmp_path / "poses.csv", tmp_path / "joints.csv"
    rows = [f"{0.5},{0.1 + 0.01 * k},0.5,0,90,0" for k in range(5)]
    file.write_text("x,y,z,roll,pitch,yaw\n" + "\n".join(rows))
    words = ["follow", "rx90", str(file), "--degrees"]
    assert main([*words, "--motion", str(motion)]) == 0
    assert "8" not in capsys.readouterr().err
    q = np.deg2rad(np.loadtxt(motion, delimiter=",", skiprows=1))
    np.testing.assert_allclose(rm.dgm(rm.load("rx90"), q)[:, 1, 3], 0.1 + 0.01 * np.arange(5))
    file.write_text("9 0 0\n9 0 1\n")
    assert main(["follow", "lab_trr", str(file), "--no-limits", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["status"] == "BROKEN"
    for text in ("1 2\n", "1 2 3\n1 2 x\n", "", "0 0 0 0 0 0 2\n"):
        file.write_text(text)
        assert main(["follow", "rx90", str(file)]) == 2
    T = rm.dgm(rm.load("rx90"), [0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    file.write_text(" ".join(map(repr, map(float, T.ravel()))))
    assert main(["follow", "rx90", str(file)]) == 0
