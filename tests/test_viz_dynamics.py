"""Figures of dynamics: what their lines and maps are, and that nothing covers anything else."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from robotmodels.drive import DriveParameters
from robotmodels.dynamics import gravity_torque, idm, mass_matrix
from robotmodels.errors import InvalidValueError, RobotModelsError, ShapeError
from robotmodels.friction import ViscousFriction
from robotmodels.geometry import DHTable
from robotmodels.inertia import InertialParameters
from robotmodels.model import RobotModel
from robotmodels.robots import load
from robotmodels.simulation import SimulationEventKind, dynamics_map, simulate
from robotmodels.trajectories import Samples, quintic
from robotmodels.viz.plot_dynamics_energy import plot_energy
from robotmodels.viz.plot_dynamics_maps import plot_inertia_map
from robotmodels.viz.plot_dynamics_torques import plot_torque_parts

RX90 = load("rx90").with_drive(
    DriveParameters(
        Ia=np.full(6, 0.2), Fv=[20, 20, 10, 1, 1, 0.5], Fc=[20, 30, 20, 5, 3, 2], offset=np.ones(6)
    )
)
SCARA = RobotModel.from_table(
    DHTable(antecedent=[0, 1, 2], sigma=[0, 0, 1], d=[0, 0.3, 0.3], alpha=[0, 0, np.pi],
            names=("waist", "elbow", "lift")),
    InertialParameters.from_com([3.0, 2.0, 1.0], [[0.1, 0, 0], [0.1, 0, 0], [0, 0, 0]],
                                [0.02 * np.eye(3)] * 3), name="scara",
)  # fmt: skip
REST = np.array([0.0, 0.3, 0.5, 0.2, 0.4, 0.1])


def falling(**options):
    t = np.linspace(0.0, 1.5, 120)
    return simulate(RX90, REST, np.zeros(6), t=t, **options)


FALL = falling()
WORKED = falling(control=np.full(6, 5.0), wrench=[10.0, 0, 20.0, 0, 1.0, 0])
MOVE = quintic(np.zeros(6), [1, -0.5, 0.8, 1, 0.5, 2], duration=1.0)

FIGURES = {
    "fall": lambda: plot_energy(FALL, title="A falling arm"),
    "work": lambda: plot_energy(WORKED),
    "one instant": lambda: plot_energy(simulate(RX90, REST, np.zeros(6), t=0.0)),
    "move": lambda: plot_torque_parts(RX90, MOVE, title="A move", wrench=[0, 0, 9, 0, 0, 0]),
    "simulated": lambda: plot_torque_parts(RX90, WORKED),
    "prismatic": lambda: plot_torque_parts(SCARA, quintic([0, 0, 0], [1, 1, 0.2], duration=1.0)),
    "line": lambda: plot_inertia_map(dynamics_map(load("rx90"), 2), title="RX-90"),
    "mixed": lambda: plot_inertia_map(dynamics_map(SCARA, 1)),
    "map": lambda: plot_inertia_map(dynamics_map(load("panda"), (0, 3)), title="Panda"),
    "lift": lambda: plot_inertia_map(dynamics_map(SCARA, (1, 2)), of=2, pair=(0, 1)),
}


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines() if line.get_label()[0] != "_"}


def legend(figure):
    return [text.get_text() for each in figure.legends for text in each.get_texts()]


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_covers_anything_else(name):
    figure = FIGURES[name]()
    figure.draw_without_rendering()
    FigureCanvasAgg(figure)
    boxes = [axes.get_tightbbox() for axes in figure.axes if axes.get_visible()]
    boxes += [each.get_window_extent() for each in figure.legends]
    slack = 2.0
    for box in boxes:
        assert min(box.x0, box.y0) >= -slack
        assert box.x1 <= figure.bbox.x1 + slack
        assert box.y1 <= figure.bbox.y1 + slack
    for a, b in combinations(boxes, 2):
        width = min(a.x1, b.x1) - max(a.x0, b.x0)
        height = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(width, height) <= slack
    data = [axes.get_window_extent() for axes in figure.axes if axes.get_visible()]
    assert min(box.width for box in data if box.height < 5 * box.width) > 60.0


def test_energy_lines_are_those_of_the_balance():
    upper, lower = plot_energy(WORKED).axes
    found = lines(upper)
    assert list(found) == ["kinetic energy", "potential energy", "friction work",
                           "work of the tool", "\N{MINUS SIGN} control work", "sum"]  # fmt: skip
    assert legend(plot_energy(WORKED)) == list(found)
    assert upper.get_ylabel() == "energy (J)"
    assert np.array_equal(found["kinetic energy"].get_ydata(), WORKED.kinetic)
    assert found["potential energy"].get_ydata()[0] == 0.0
    parts = [line.get_ydata() for label, line in found.items() if label != "sum"]
    assert np.abs(np.sum(parts, axis=0) - found["sum"].get_ydata()).max() < 1e-9
    assert np.ptp(found["sum"].get_ydata()) < 1e-6
    drift = lines(lower)["drift"].get_ydata()
    assert np.ptp(drift) > 0.0
    unit = {"J": 1.0, "mJ": 1e3, "µJ": 1e6, "nJ": 1e9, "pJ": 1e12}[
        lower.get_ylabel().removeprefix("drift (").removesuffix(")")
    ]
    assert np.allclose(drift, unit * WORKED.drift)
    assert 1.0 <= np.abs(drift).max() < 1e3


def test_events_are_marked_where_joints_stick():
    marks = [line.get_xdata()[0] for line in plot_energy(FALL).axes[0].get_lines()
             if line.get_label() == "_event"]  # fmt: skip
    kinds = (SimulationEventKind.STUCK, SimulationEventKind.BROKE_AWAY)
    assert marks == [e.t for e in FALL.events if e.kind in kinds]
    assert marks
    bare = plot_energy(FALL, events=False)
    assert not [line for line in bare.axes[0].get_lines() if line.get_label() == "_event"]
    assert legend(bare)[:3] == ["kinetic energy", "potential energy", "friction work"]


def test_torque_parts_add_up_to_the_models_torque():
    wrench = [0, 0, 9.0, 0, 0, 0]
    friction = ViscousFriction(np.ones(6))
    figure = plot_torque_parts(RX90, MOVE, wrench=wrench, friction=friction)
    assert len(figure.axes) == 6
    t = lines(figure.axes[0])["total"].get_xdata()
    tau = idm(RX90, MOVE.q(t), MOVE.v(t), MOVE.a(t), wrench=wrench, friction=friction)
    for j, axes in enumerate(figure.axes):
        order = [0, 3, 1, 4, 2, 5][j]  # row by row, the joints below each other
        found = lines(axes)
        assert axes.get_title(loc="left") == f"joint_{order + 1} (N m)"
        assert np.allclose(found["total"].get_ydata(), tau[:, order], atol=1e-10)
        parts = [line.get_ydata() for label, line in found.items() if label != "total"]
        assert np.allclose(np.sum(parts, axis=0), tau[:, order], atol=1e-10)
    assert legend(figure) == ["inertia", "Coriolis and centrifugal", "gravity", "friction",
                              "wrench of the tool", "total"]  # fmt: skip
    bare = plot_torque_parts(RX90, MOVE, drive=False, joints=[1])
    assert legend(bare) == ["inertia", "Coriolis and centrifugal", "gravity", "total"]
    assert np.allclose(
        lines(bare.axes[0])["gravity"].get_ydata(), gravity_torque(RX90, MOVE.q(t))[:, 1]
    )
    units = [axes.get_title(loc="left") for axes in FIGURES["prismatic"]().axes]
    assert units == ["waist (N m)", "elbow (N m)", "lift (N)"]


def test_torques_of_a_simulation_have_its_friction_at_rest():
    figure = plot_torque_parts(RX90, FALL, joints=[1])
    found = lines(figure.axes[0])
    assert np.abs(found["total"].get_ydata()).max() < 1e-9  # it falls freely
    held = FALL.sticking[:, 1]
    assert held.any()
    assert np.allclose(found["friction"].get_ydata()[held], FALL.friction[held, 1] + 1.0)
    assert "wrench of the tool" not in found
    worked = lines(plot_torque_parts(RX90, WORKED, joints=[1]).axes[0])
    force = [10.0, 0, 20.0, 0, 1.0, 0]
    tool = idm(RX90, WORKED.q, 0 * WORKED.q, 0 * WORKED.q, wrench=force) - idm(
        RX90, WORKED.q, 0 * WORKED.q, 0 * WORKED.q
    )
    assert np.allclose(worked["wrench of the tool"].get_ydata(), tool[:, 1], atol=1e-7)
    assert np.allclose(worked["total"].get_ydata(), 5.0)
    one = Samples([0.0], *np.zeros((4, 1, 6)))
    assert lines(plot_torque_parts(RX90, one).axes[0])["total"].get_marker() == "o"


def test_lines_over_one_joint():
    arm = load("rx90")
    grid = dynamics_map(arm, 2, samples=9)
    gravity, inertia, coupling = plot_inertia_map(grid).axes
    q = np.zeros(6)
    q[2] = grid.ranges[0][3]
    M = mass_matrix(arm, q)
    for j, name in enumerate(arm.table.names):
        assert np.allclose(lines(gravity)[name].get_ydata()[3], gravity_torque(arm, q)[j])
        assert np.allclose(lines(inertia)[name].get_ydata()[3], M[j, j])
    assert inertia.get_yscale() == "log"
    assert gravity.get_lines()[0].get_xdata()[-1] == pytest.approx(180.0)
    assert coupling.get_xlabel() == "joint_3 (deg)"
    assert coupling.get_ylabel() == "coupling\n(no unit)"
    pair = lines(coupling)["joint_2 and joint_3"].get_ydata()[3]
    assert pair == pytest.approx(M[1, 2] / np.sqrt(M[1, 1] * M[2, 2]))
    shown = lines(coupling)
    assert len(shown) == 5
    strongest = max(np.abs(line.get_ydata()).max() for line in shown.values())
    off = np.abs(grid.coupling - np.eye(6))
    assert strongest == pytest.approx(off.max())
    mixed = FIGURES["mixed"]().axes
    assert " ".join(mixed[0].get_ylabel().split()) == "gravity torque (N m or N)"
    assert mixed[1].get_yscale() == "linear"
    single = RobotModel.from_table(
        DHTable(antecedent=[0], sigma=[1]), InertialParameters([[0] * 9 + [2.0]])
    )
    axes = plot_inertia_map(dynamics_map(single, 0, samples=3)).axes
    assert axes[2].texts[0].get_text() == "one joint: no coupling"
    assert axes[2].get_xlabel() == "joint_1 (m)"
    assert axes[1].get_ylabel() == "inertia\n(kg)"


def test_maps_over_two_joints():
    grid = dynamics_map(RX90, (1, 2), samples=(7, 5))
    figure = plot_inertia_map(grid, degrees=False)
    found = [axes for axes in figure.axes if axes.get_title()]
    values = [axes.collections[0].get_array() for axes in found]
    assert np.allclose(values[0], grid.gravity[..., 1].T)
    assert np.allclose(values[1], grid.mass[..., 1, 1].T)
    assert np.allclose(values[2], grid.coupling[..., 1, 2].T)
    assert [axes.get_ylabel() for axes in figure.axes if not axes.get_title()] == [
        "(N m)", "(kg m²)", "no unit"]  # fmt: skip
    assert found[0].get_xlabel() == "joint_2 (rad)"
    assert found[0].get_ylabel() == "joint_3 (rad)"
    low, high = found[0].collections[0].get_clim()
    assert low == -high
    # nothing but rounding errors is no pattern
    still = [axes for axes in FIGURES["map"]().axes if axes.get_title()]
    assert still[0].texts[0].get_text() == "zero everywhere"
    other = [axes for axes in FIGURES["lift"]().axes if axes.get_title()]
    assert "lift" in other[0].get_title()
    assert "waist, elbow" in other[2].get_title()
    massless = plot_inertia_map(dynamics_map(load("planar_2r"), (0, 1), samples=3))
    texts = [axes.texts[0].get_text() for axes in massless.axes if axes.texts]
    assert texts == ["zero everywhere", "zero everywhere", "a joint moves\nno inertia"]


def test_mistakes_are_named():
    for wrong, message in (
        (lambda: plot_energy(MOVE), "simulation: expected a Simulation"),
        (lambda: plot_torque_parts("rx90", MOVE), "load it first"),
        (lambda: plot_torque_parts(SCARA, MOVE), "motion: expected one of the 3 joints"),
        (lambda: plot_torque_parts(SCARA, FALL), "model: the simulation is one of 'rx90'"),
        (lambda: plot_torque_parts(RX90, FALL, drive=False), "motion: a simulation has its own"),
        (lambda: plot_torque_parts(RX90, MOVE, joints=[6]), "joints: expected some numbers"),
        (lambda: plot_torque_parts(RX90, MOVE, columns=0), "columns: expected a whole number"),
        (lambda: plot_inertia_map(FALL), "grid: expected a DynamicsMap"),
        (lambda: plot_inertia_map(dynamics_map(RX90, 1), of=1), "of, pair: these choose"),
        (lambda: plot_inertia_map(dynamics_map(RX90, (1, 2)), of=6), "of: expected a joint from"),
        (lambda: plot_inertia_map(dynamics_map(RX90, (1, 2)), pair=(1, 1)), "two different"),
        (lambda: plot_energy(FALL, size=[1.0]), "size"),
    ):
        with pytest.raises(RobotModelsError, match=message) as caught:
            wrong()
        assert isinstance(caught.value, (InvalidValueError, ShapeError))
