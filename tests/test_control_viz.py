"""Figures and scenes of controlled robots."""

import numpy as np
import pytest
from test_control import Q0, WALL, arm, hybrid

import robotmodels as rm
from robotmodels import control
from robotmodels.errors import InvalidValueError


@pytest.fixture(scope="module")
def pushed():
    return control.run(arm(), hybrid(), Q0, t=np.linspace(0, 0.5, 51), environment=WALL)


def test_figures_have_the_panels_of_the_law(pushed):
    figure = rm.viz.plot_control(pushed, title="hybrid")
    assert [axes.get_ylabel() for axes in figure.axes] == ["error", "torque (N m)", "force (N)"]
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert texts == ["x", "y"]
    drawn = figure.axes[2].get_lines()[-1].get_ydata()
    assert np.allclose(drawn, pushed.wrench[:, 0])
    law = control.SlidingMode(Q0, 5.0, 30.0, layer=0.1, model=arm())
    run = control.run(arm(), law, Q0 - 0.1, t=np.linspace(0, 0.2, 5))
    assert len(rm.viz.plot_control(run).axes) == 3
    lines = rm.viz.plot_surface(run).axes[0].get_lines()[-2:]
    assert np.allclose([line.get_ydata() for line in lines], run.surface.T)
    with pytest.raises(InvalidValueError, match="ParallelHybrid has no surface"):
        rm.viz.plot_surface(pushed)
    with pytest.raises(InvalidValueError, match="run: expected"):
        rm.viz.plot_control(law)
    for wrong in ({"walls": 3}, {"walls": [law]}, {"length": 0.0}, {"length": "a"}):
        with pytest.raises(InvalidValueError, match=f"{next(iter(wrong))}: expected"):
            rm.viz.animate_control(pushed, **wrong)


def test_the_force_is_an_arrow_at_the_tool(pushed):
    scene = rm.viz.animate_control(pushed, walls=[WALL], length=0.5)
    assert any("force" in track.path for track in scene.motion.tracks)
    assert "walls/1" in scene.paths
    free = control.run(arm(), control.PDGravity(Q0, 9, 9, arm()), Q0 + 0.1, t=0.2)
    assert not any("force" in path for path in rm.viz.animate_control(free).paths)
