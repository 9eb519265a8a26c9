"""Figures: axes with units, and lines, limits and areas that are those of the data."""

import pickle
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import robotmodels as rm
from robotmodels import se3, simulation, viz
from robotmodels import trajectories as tr
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.symbolic import SingularityMap

H = np.pi / 2
RX90 = rm.load("rx90").with_drive(
    rm.DriveParameters(
        Ia=np.full(6, 0.2), Fv=[20, 20, 10, 1, 1, 0.5], Fc=[20, 30, 20, 5, 3, 2], offset=np.ones(6)
    )
)
SCARA = rm.RobotModel.from_table(
    rm.DHTable.from_rows([
        {"sigma": 0, "name": "waist", "lower": -2.0, "upper": 1.0}, {"sigma": 2, "d": 0.1},
        {"sigma": 0, "d": 0.35, "name": "elbow", "velocity": 3.0},
        {"sigma": 1, "d": 0.3, "alpha": np.pi, "lower": 0.0, "upper": 0.2, "name": "lift"},
    ]),
    rm.InertialParameters.from_com([3.0, 0.0, 2.0, 1.0], [[0.1, 0, 0]] * 3 + [[0, 0, 0]],
                                   [0.02 * np.eye(3)] * 4),
    name="scara",
)  # fmt: skip
Q = np.array([0.4, 0.7, 0.8, 0.4, 0.9, 0.6])
MOVE = tr.quintic([0.0, 0.0, 0.0], [1.0, -1.0, 0.2], duration=2.0)
SWING = tr.quintic(np.zeros(6), [1, -0.5, 0.8, 1, 0.5, 2], duration=1.0)
REST = np.array([0.0, 0.3, 0.5, 0.2, 0.4, 0.1])
FALL = simulation.simulate(RX90, REST, np.zeros(6), t=np.linspace(0.0, 1.5, 60))
WORKED = simulation.simulate(
    RX90, REST, np.zeros(6), np.full(6, 5.0), wrench=[10.0, 0, 20.0, 0, 1.0, 0],
    t=np.linspace(0.0, 0.5, 30),
)  # fmt: skip


def eventful_path(timed=True):
    """A path on which everything happens, without a robot that does it."""
    N, kinds = 40, list(tr.PathEventKind)
    t = np.linspace(0.0, 2.0, N) if timed else np.full(N, np.nan)
    q = np.outer(np.linspace(0.0, 1.0, N), [1.0, -1.0, 0.1])
    q[10:15] = np.nan
    events = [tr.PathEvent(kinds[0], 10, 14, t[10] - 0.01, t[14] + 0.01)]
    events += [tr.PathEvent(kind, 16 + 3 * k, 17 + 3 * k, t[16 + 3 * k], t[17 + 3 * k])
               for k, kind in enumerate(kinds[1:])]  # fmt: skip
    conditioning = np.linspace(0.3, 0.0, N)
    codes = np.zeros(N, np.int8)
    return tr.JointPath(t, q, 2.0 * q, codes, conditioning, np.full(N, "up"), tuple(events))


A, B = np.linspace(-np.pi, np.pi, 41), np.linspace(-2.0, 2.0, 31)
WRIST = SingularityMap(
    "rx90", np.array([2, 4]), ("elbow", "wrist"), A, B, np.cos(A)[:, None] * np.sin(B), "C3 S5",
    ("rad", "rad", "m^3"),
)  # fmt: skip


def crossing():
    """Two inverse models on a way through the wrist singularity."""
    d = np.linspace(-0.2, 0.2, 81)
    q = np.tile([0.1, 0.2, 0.3, 0.4, 0.0, 0.6], (81, 1))
    q[:, 4] = d
    twist = np.array([0.1, 0.2, 0.05, 0.1, 0.3, 0.2])
    found = {}
    for name, damping in (("light", 0.01), ("strong", 0.1)):
        J = rm.jacobian(RX90, q)
        square = J @ J.swapaxes(1, 2) + damping**2 * np.eye(6)
        v = (J.swapaxes(1, 2) @ np.linalg.solve(square, np.tile(twist, (81, 1))[..., None]))[..., 0]
        found[name] = (v, twist - np.einsum("nij,nj->ni", J, v))
    return d, q, twist, found


D, ROWS, TWIST, FOUND = crossing()
BOTH = [rm.velocity_ellipsoid(RX90, Q), rm.force_ellipsoid(RX90, Q)]
LINE = tr.straight_line(se3.translation(0.5, 0.1, 0.2), se3.from_rpy((0.2, 1.0, 0.4)), duration=1.0)


def lines(axes, label=None):
    """The lines that a legend would name, or those of one label."""
    if label is None:
        return [x for x in axes.get_lines() if x.get_label()[0] != "_" and len(x.get_xdata())]
    return [line for line in axes.get_lines() if line.get_label() == label]


def data(axes, label):
    """Values of the only line with a label."""
    (line,) = [line for line in lines(axes, label) if len(line.get_xdata())]
    return np.asarray(line.get_ydata(), dtype=float)


def labels(figure):
    return [" ".join(axes.get_ylabel().split()) for axes in figure.axes]


# ---------------------------------------------------------------- the data of every figure


def trajectory():
    figure = viz.plot_trajectory(MOVE, model=SCARA, units=["deg", "rad", "mm"])
    t = lines(figure.axes[0], "waist")[0].get_xdata()
    assert (t[0], t[-1]) == (0.0, 2.0)
    factors = {"waist": 180.0 / np.pi, "elbow": 1.0, "lift": 1e3}
    for order, of in enumerate((MOVE.q, MOVE.v, MOVE.a, MOVE.jerk)):
        for j, (name, factor) in enumerate(factors.items()):
            yield figure.axes[3 * order + j], name, factor * of(t)[:, j]
    samples = MOVE.resample(samples=7)
    drawn = viz.plot_trajectory(samples, orders=(3,)).axes[0]
    yield drawn, "joint 2", samples.jerk[:, 1]


def joint_path():
    path = eventful_path()
    figure = viz.plot_joint_path(path, model=SCARA, units=["deg", "deg", "mm"])
    yield figure.axes[0], "elbow", np.degrees(path.q[:, 1])
    yield figure.axes[3], "lift", 1e3 * path.v[:, 2]
    yield figure.axes[-2], "_conditioning", np.maximum(path.conditioning, 1e-6)
    for row, event in enumerate(path.events):
        bar, _ = [x for x in figure.axes[-1].get_lines() if x.get_ydata()[0] == row]
        assert list(bar.get_xdata()) == [event.start, event.stop]
    limits = lines(figure.axes[0], "_limit of waist")  # of the model
    assert [x.get_ydata()[0] for x in limits] == pytest.approx(np.degrees([-2.0, 1.0]))
    untimed = viz.plot_joint_path(eventful_path(timed=False))
    assert list(untimed.axes[-1].get_lines()[0].get_xdata()) == [10.0, 14.0]


def joint_motion():
    t = np.linspace(0.0, 2.0, 21)
    inside = np.c_[-0.5 + np.sin(t), 5.0 * t, 0.1 + 0.05 * t]
    motions = {"with": inside, "without": inside + np.array([0.0, 0.0, 0.1])}
    waist, elbow, lift, margin = viz.plot_joint_motion(SCARA, t, motions).axes
    assert lift.get_ylim()[1] > 0.3  # a joint beyond its limit is still to be seen
    assert (len(lift.patches), len(elbow.patches)) == (2, 0)  # no limits of the elbow
    yield waist, "with", np.degrees(inside[:, 0])
    expected = np.minimum(
        np.minimum(inside[:, 0] + 2.0, 1.0 - inside[:, 0]) / 1.5,
        np.minimum(inside[:, 2], 0.2 - inside[:, 2]) / 0.1,
    )
    yield margin, "with", 100.0 * expected


def inverse_velocities():
    limits = tr.MotionLimits([5, 5, 5, 6, 6, 6])
    figure = viz.plot_inverse_velocities(D, FOUND, model=RX90, limits=limits)
    speed, linear, angular = figure.axes
    for name, (v, error) in FOUND.items():
        np.testing.assert_allclose(lines(speed, name)[0].get_xdata(), np.degrees(D))
        yield speed, name, np.abs(v).max(axis=1)
        yield linear, f"_{name}", np.linalg.norm(error[:, :3], axis=1)
        yield angular, f"_{name}", np.linalg.norm(error[:, 3:], axis=1)
    drawn = {x.get_ydata()[0] for x in speed.get_lines() if x.get_label().startswith("_limit")}
    assert drawn == {5.0, 6.0}
    found = rm.ikm(RX90, ROWS, TWIST)
    own = viz.plot_inverse_velocities(D, {"ikm": found}, distance_unit="rad")
    yield own.axes[-1], "_ikm", found.singular_values[:, -1]
    masked = rm.ikm(RX90, ROWS, TWIST, mask=[1, 1, 1, 0, 0, 0])
    assert not any("angular" in text for text in labels(viz.plot_inverse_velocities(D, [masked])))


def energy():
    upper, lower = viz.plot_energy(WORKED).axes
    terms = [x.get_label() for x in lines(upper)][:-1]
    assert len(terms) == 5
    yield upper, "kinetic energy", WORKED.kinetic
    yield upper, "sum", np.sum([data(upper, name) for name in terms], axis=0)
    unit = lower.get_ylabel().removeprefix("drift (").removesuffix(")")
    factor = {"J": 1.0, "mJ": 1e3, "µJ": 1e6, "nJ": 1e9, "pJ": 1e12}[unit]
    yield lower, "_drift", factor * WORKED.drift
    kinds = (simulation.SimulationEventKind.STUCK, simulation.SimulationEventKind.BROKE_AWAY)
    marks = [line.get_xdata()[0] for line in lines(viz.plot_energy(FALL).axes[0], "_event")]
    assert marks == [e.t for e in FALL.events if e.kind in kinds] != []


def torque_parts():
    wrench, friction = [0, 0, 9.0, 0, 0, 0], rm.friction.ViscousFriction(np.ones(6))
    figure = viz.plot_torque_parts(RX90, SWING, wrench=wrench, friction=friction)
    t = lines(figure.axes[0], "total")[0].get_xdata()
    q, v, a = SWING.q(t), SWING.v(t), SWING.a(t)
    tau = rm.idm(RX90, q, v, a, wrench=wrench, friction=friction)
    names = ["inertia", "Coriolis and centrifugal", "gravity", "friction", "wrench of the tool"]
    for axes in figure.axes:
        j = int(axes.get_title(loc="left").removeprefix("joint_").removesuffix(" (N m)")) - 1
        yield axes, "total", tau[:, j]
        yield axes, "total", np.sum([data(axes, name) for name in names], axis=0)
    bare = viz.plot_torque_parts(RX90, SWING, drive=False, joints=[1]).axes[0]
    assert not {"friction", "wrench of the tool"} & {x.get_label() for x in lines(bare)}
    yield bare, "gravity", rm.gravity_torque(RX90, q)[:, 1]
    yield viz.plot_torque_parts(RX90, WORKED, joints=[1]).axes[0], "total", np.full(30, 5.0)


def inertia_map():
    grid = simulation.dynamics_map(RX90, 2, samples=9)
    gravity, inertia, coupling = viz.plot_inertia_map(grid).axes
    assert gravity.get_lines()[0].get_xdata()[-1] == pytest.approx(180.0)
    q = np.zeros((9, 6))
    q[:, 2] = grid.ranges[0]
    M, G = rm.mass_matrix(RX90, q), rm.gravity_torque(RX90, q)
    for j, name in enumerate(RX90.table.names):
        yield gravity, name, G[:, j]
        yield inertia, name, M[:, j, j]
    share = M[:, 1, 2] / np.sqrt(M[:, 1, 1] * M[:, 2, 2])
    yield coupling, "_joint_2 and joint_3", share


def plan_and_phase_plane():
    arm, ends = rm.load("ur5e"), ([0, -1.5, 1, 0, 0, 0], [1, -1, 0.5, 0, 0, 0])
    plan = tr.kinodynamic(arm, *ends, tr.MotionLimits(), seconds=0.1)
    bound = np.array([100.0, np.inf, 90.0, 80.0, 70.0, 60.0])
    position, _, torque = viz.plot_plan(plan, model=arm, torque=bound).axes
    names = [x.get_label() for x in lines(position)]
    assert [x.get_label() for x in lines(torque)][:5] == names[:1] + names[2:]
    at = plan.trajectory.at(lines(torque)[0].get_xdata())
    yield torque, names[2], rm.idm(arm, at.q, at.v, at.a)[:, 2] / 90.0
    timed = tr.time_optimal(tr.linear([0.0], [1.0], 1.0), tr.MotionLimits(1.0, 2.0))
    yield viz.plot_phase_plane(timed).axes[0], "quickest motion", timed.rate


FIGURES = (
    trajectory, joint_path, joint_motion, inverse_velocities, energy, torque_parts, inertia_map,
    plan_and_phase_plane,
)  # fmt: skip

WITHOUT_UNIT = ("least singular", "number of the pose", "path parameter s")


@pytest.mark.parametrize("figure", FIGURES, ids=lambda case: case.__name__)
def test_figures_show_the_data_on_axes_with_units(figure):
    for axes, label, expected in figure():
        np.testing.assert_allclose(data(axes, label), expected, atol=1e-9, err_msg=label)
        texts = [(axes.get_ylabel(), axes.get_title(loc="left")), (bottom_of(axes),)]
        for text in (" ".join(some) for some in texts):
            assert "(" in text or any(word in text for word in WITHOUT_UNIT), text
        assert all(np.isfinite(axes.axis()))


def bottom_of(axes):
    """The label of the lowest of the panels that share a horizontal axis."""
    shared = axes.get_shared_x_axes().get_siblings(axes)
    return next(text for each in shared if (text := each.get_xlabel()))


def test_a_figure_is_one_of_matplotlib_and_leaves_pyplot_alone():
    script = """
import sys
import robotmodels as rm
from robotmodels.viz import plot_trajectory
assert "matplotlib" not in sys.modules
figure = plot_trajectory(rm.trajectories.quintic(0.0, 1.0, duration=1.0))
assert figure._repr_png_().startswith(b"\\x89PNG")
assert "matplotlib.pyplot" not in sys.modules
sys.modules["matplotlib.style"] = None
try:
    plot_trajectory(rm.trajectories.quintic(0.0, 1.0, duration=1.0))
except rm.errors.MissingExtraError as error:
    print(error)
"""
    command = [sys.executable, "-W", "error", "-c", script]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    assert "pip install 'matplotlib" in run.stdout
    figure = pickle.loads(pickle.dumps(viz.plot_trajectory(MOVE, size=(5.0, 4.0))))
    assert isinstance(figure, Figure)
    assert figure.get_size_inches().tolist() == [5.0, 4.0]
    with pytest.raises(TypeError, match="unexpected arguments: colour"):
        viz.plot_trajectory(MOVE, colour="red")


# ---------------------------------------------------------------- marks, limits, areas


def test_both_sides_of_a_jump_and_the_pieces_are_drawn():
    axes = viz.plot_trajectory(tr.bang_bang(0.0, 1.0, duration=1.0), orders=(2,), units="m").axes[0]
    t, a = axes.get_lines()[0].get_data()
    at = np.flatnonzero(t == 0.5)[0]
    np.testing.assert_allclose(a[at - 1 : at + 1], [4.0, -4.0])
    assert lines(axes, "_break")[0].get_xdata() == [0.5, 0.5]
    move = tr.trapezoidal([0.0, 0.0], [1.0, 0.1], limits=tr.MotionLimits(1.0, 4.0),
                          synchronisation=tr.Synchronisation.INDEPENDENT)  # fmt: skip
    for j, mark in enumerate(lines(viz.plot_trajectory(move, units="deg").axes[1], "_break")):
        t, v = mark.get_data()
        np.testing.assert_array_equal(t, np.unique(move.motion.breaks[j]))
        np.testing.assert_allclose(v, np.degrees(move.v(t)[:, j]), atol=1e-12)


def test_limits_are_dashed_lines_and_values_beyond_them_are_underlaid():
    move = tr.trapezoidal([0, 0, 0], [1, -1, 0.2], limits=tr.MotionLimits(1.0, 4.0))
    limits = tr.MotionLimits(velocity=[0.8, 2.0, np.inf], velocity_lower=[-0.7, -2.0, -np.inf],
                             acceleration=[5.0, 5.0, 3.0], lower=[-3, -3, 0],
                             upper=[3, 3, 0.5])  # fmt: skip
    figure = viz.plot_trajectory(move, limits, units=["deg", "deg", "mm"], names=["a", "b", "c"])
    for row, label, values in (
        (0, "_limit of a and b", np.degrees([-3.0, 3.0])),
        (1, "_limit of c", [0.0, 500.0]),
        (2, "_limit of a", np.degrees([-0.7, 0.8])),
        (5, "_limit of c", [-3000.0, 3000.0]),
        (3, "_limit of c", []),  # infinite: no limit
    ):
        drawn = [line.get_ydata()[0] for line in lines(figure.axes[row], label)]
        assert drawn == pytest.approx(values)
    y, beyond = data(figure.axes[2], "a"), data(figure.axes[2], "beyond the limit")
    np.testing.assert_array_equal(np.isfinite(beyond), y > np.degrees(0.8))


def test_pose_path_has_equal_scales_frames_and_events():
    T = np.stack(
        [se3.from_rpy((0.1 * k, 0.0, 0.02 * k), (0.1 * k, 0.02 * k, 0.3)) for k in range(40)]
    )
    figure = viz.plot_pose_path(T, eventful_path(), frames=3, frame_size=0.1, unit="mm")
    (axes,) = figure.axes
    figure.draw_without_rendering()
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        assert axis.label.get_window_extent().y0 >= 0.0
    np.testing.assert_allclose(lines(axes, "path")[0].get_data_3d(), 1e3 * T[:, :3, 3].T)
    for k, name in enumerate("xyz"):
        for i, line in zip((0, 20, 39), lines(axes, f"tool {name}"), strict=True):
            start, tip = np.transpose(line.get_data_3d())
            np.testing.assert_allclose(start, 1e3 * T[i, :3, 3])
            np.testing.assert_allclose(tip - start, 1e2 * T[i, :3, k], atol=1e-9)
    (run,) = lines(axes, "_out of reach")
    np.testing.assert_allclose(run.get_data_3d(), 1e3 * T[10:15, :3, 3].T)
    spans = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())])
    np.testing.assert_allclose(spans / axes._box_aspect, (spans / axes._box_aspect)[0])


def test_maps_show_values_zeros_limits_and_postures():
    rows = [{}, {}, {"lower": -4.0, "upper": 1.5}, {}, {"lower": 2.5}]
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    q = np.outer(np.linspace(0.0, 1.0, 24), np.arange(5.0))
    axes = viz.plot_singularities([WRIST, WRIST], arm, q=q).axes[0]
    assert axes.get_xlabel() == "elbow (deg)"
    image = axes.collections[0]
    np.testing.assert_array_equal(image.get_array(), WRIST.values.T)
    assert image.norm.vmin == -image.norm.vmax == -np.abs(WRIST.values).max()
    # bold lines and dots lie where cos(elbow) sin(wrist) is zero
    drawn = [path.vertices for each in axes.collections[1:] for path in each.get_paths()]
    drawn += [dots.get_xydata() for dots in lines(axes, "_zero")]
    x, y = np.radians(np.concatenate(drawn)).T
    assert np.abs(np.cos(x) * np.sin(y)).max() < 5e-3
    assert np.ptp(x[np.abs(y) < 0.02]) == pytest.approx(2.0 * np.pi, rel=0.02)
    (limit,) = lines(axes, "_limit of elbow")  # the lower one is outside of the map
    assert limit.get_xdata()[0] == pytest.approx(np.degrees(1.5))
    assert len([patch for patch in axes.patches if patch.get_hatch()]) == 2
    drawn = [np.radians(np.asarray(x)) for x in lines(axes, "postures")[0].get_data()]
    np.testing.assert_allclose(drawn, q[:, [2, 4]].T)
    grid = simulation.dynamics_map(RX90, (1, 2), samples=(7, 5))
    found = [axes for axes in viz.plot_inertia_map(grid, degrees=False).axes if axes.get_title()]
    expected = (grid.gravity[..., 1], grid.mass[..., 1, 1], grid.coupling[..., 1, 2])
    for axes, values in zip(found, expected, strict=True):
        np.testing.assert_allclose(axes.collections[0].get_array(), values.T, atol=1e-9)


def test_projections_are_the_widths_of_the_ellipsoid():
    figure = viz.plot_ellipsoids(BOTH)
    for row, ellipsoid in enumerate(BOTH):
        for column, plane in enumerate(((0, 1), (0, 2), (1, 2))):
            axes = figure.axes[3 * row + column]
            points = axes.get_lines()[0].get_xydata()
            for direction in np.eye(2):
                world = np.zeros(3)
                world[list(plane)] = direction
                width = ellipsoid.extent_along(world)
                assert (points @ direction).max() == pytest.approx(width, rel=1e-3)
            assert axes.get_xlim()[1] > points[:, 0].max()
            assert axes.get_ylabel() == f"${'vf'[row]}_{'xyz'[plane[1]]}$ ({['m/s', 'N'][row]})"


# ---------------------------------------------------------------- mistakes

T3 = np.broadcast_to(np.eye(4), (3, 4, 4))
MAP_1, MAP_2 = (simulation.dynamics_map(SCARA, joints) for joints in (1, (1, 2)))
MISTAKES = (
    (lambda: viz.plot_trajectory(LINE), "trajectory: expected a Trajectory.*got PoseTrajectory"),
    (lambda: viz.plot_trajectory(MOVE, orders=(0, 4)), "orders: .* from 0 to 3, each once"),
    (lambda: viz.plot_trajectory(MOVE, tr.MotionLimits([1.0, 2.0])), "limits of 3 joints"),
    (lambda: viz.plot_trajectory(MOVE, size=(0.0, 1.0)), "size: expected positive inches"),
    (lambda: viz.plot_trajectory(MOVE, units="rad", model=SCARA), "joint 3 is prismatic"),
    (lambda: viz.plot_trajectory(MOVE, units="grad"), "expected one of 'rad', 'deg'"),
    (lambda: viz.plot_trajectory(MOVE, names=["a"]), "names: .* each of the 3 joints, got 1"),
    (lambda: viz.plot_trajectory(MOVE, model=RX90), "got 'rx90' of 6"),
    (lambda: viz.plot_profiles({"a": MOVE}, names=["b"]), "has its own names"),
    (lambda: viz.plot_pose_path(np.eye(4)), r"poses: expected shape \(N, 4, 4\)"),
    (lambda: viz.plot_pose_path(T3, eventful_path()), "path: .* these 3 poses, got 40"),
    (lambda: viz.plot_pose_path(T3, frames=-1), "frames: expected a whole number"),
    (lambda: viz.plot_joint_motion(SCARA, [0.0], {"a": [0.0]}), r"q of 'a': .* shape \(1, 3\)"),
    (lambda: viz.plot_singularities(WRIST, SCARA), "model: .* needs 5 joints, got 3"),
    (lambda: viz.plot_inverse_velocities(D[::-1], FOUND), "distance: .* ascend"),
    (lambda: viz.plot_inverse_velocities(D, {"a": (D[1:, None], None)}), r"shapes \(81, n\)"),
    (lambda: viz.plot_inverse_velocities(D, {"a": D}), "IKMSolution or a pair"),
    (lambda: viz.plot_torque_parts(SCARA, SWING), "motion: expected one of 3 joints"),
    (lambda: viz.plot_torque_parts(RX90, FALL, drive=False), "motion: a simulation has its own"),
    (lambda: viz.plot_inertia_map(MAP_2, pair=(1, 1)), "pair:"),
)


@pytest.mark.parametrize(("wrong", "message"), MISTAKES)
def test_mistakes_are_named(wrong, message):
    with pytest.raises((InvalidValueError, ShapeError), match=message):
        wrong()
