"""The figure of an exciting trajectory: what its lines are, and that nothing covers anything."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.identification.excitation import exciting_trajectory
from robotmodels.viz import plot_excitation

QUICK = {"starts": 2, "baseline": 5, "iterations": 6, "rng": 0}
CASES = {
    "revolute": lambda: exciting_trajectory(rm.load("ur10e"), **QUICK),
    "mixed": lambda: exciting_trajectory(rm.load("stanford_arm"), criterion="log_det", **QUICK),
    "without masses": lambda: exciting_trajectory(rm.load("planar_2r"), **QUICK),
    "infeasible": lambda: exciting_trajectory(rm.load("ur10e"), torque_limits=0.1, **QUICK),
}


@pytest.fixture(scope="module")
def results():
    return {name: make() for name, make in CASES.items()}


@pytest.mark.parametrize("name", CASES)
def test_nothing_covers_anything_else(results, name):
    figure = plot_excitation(results[name])
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
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


def named(figure):
    return {" ".join(axes.get_ylabel().split()): axes for axes in figure.axes}


def test_lines_are_the_motion_and_its_torques(results):
    found = results["revolute"]
    axes = named(plot_excitation(found))
    assert list(axes) == [
        "position (rad)", "velocity (rad/s)", "acceleration (rad/s²)", "torque (N m)",
        "smooth condition number", "condition number",
    ]  # fmt: skip
    line = axes["torque (N m)"].get_lines()[2]
    t = line.get_xdata()
    q, v, a = (f(t) for f in (found.trajectory.q, found.trajectory.v, found.trajectory.a))
    assert np.allclose(line.get_ydata(), rm.idm(found.model, q, v, a)[:, 2])
    assert np.allclose(axes["velocity (rad/s)"].get_lines()[1].get_ydata(), v[:, 1])
    limits = [line.get_ydata()[0] for line in axes["torque (N m)"].get_lines()
              if "limit" in line.get_label()]  # fmt: skip
    assert sorted(set(np.abs(limits))) == [56.0, 150.0, 330.0]
    starts = [line for line in axes["smooth condition number"].get_lines()
              if line.get_label() == "_start"]  # fmt: skip
    assert [len(line.get_xdata()) for line in starts] == [len(s.history) for s in found.starts]
    random = axes["condition number"].get_lines()[0].get_ydata()
    assert sorted(random) == pytest.approx(list(found.baseline_conditions))


def test_units_and_masses_decide_the_panels(results):
    mixed = named(plot_excitation(results["mixed"]))
    assert {"position (m)", "position (rad)", "force (N)", "minus log det"} <= set(mixed)
    bare = named(plot_excitation(results["without masses"]))
    assert "torque (N m)" not in bare
    title = plot_excitation(results["revolute"]).legends[0].get_title().get_text()
    assert title.startswith("ur10e: condition number")


def test_other_things_are_refused():
    with pytest.raises(InvalidValueError, match="ExcitingTrajectory"):
        plot_excitation(rm.load("rx90"))
