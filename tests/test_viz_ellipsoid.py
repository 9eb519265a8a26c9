"""Ellipsoids in scenes and figures: where they are, how large, what the legend says of it."""

import json
import re

import numpy as np
import pytest
from identities.random_robots import random_model, random_pose, random_state

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.kinematics.ellipsoid import Ellipsoid, EllipsoidQuantity
from robotmodels.kinematics.ellipsoids import (
    OtherPart,
    TwistPart,
    force_ellipsoid,
    velocity_ellipsoid,
)
from robotmodels.visual import Sphere
from robotmodels.viz.ellipsoid import draw_ellipsoids
from robotmodels.viz.nodes import Segments, Triangles, apply
from robotmodels.viz.plot_ellipsoids import plot_ellipsoids

RX90 = rm.load("rx90")
Q = np.array([0.4, 0.7, 0.8, 0.4, 0.9, 0.6])
PLANAR = rm.load("planar_2r")
BENT, STRAIGHT = [0.4, 1.2], [0.4, 0.0]


def shape(scene, path):
    """The shape of a node, with its points in the world."""
    node = next(n for n in scene.nodes if n.path == path)
    points = node.shape.vertices if isinstance(node.shape, Triangles) else node.shape.points
    return apply(scene.pose(path), np.asarray(points, float))


def scale_of(text):
    found = re.search(r": ([\d.e+-]+) m drawn per", text)
    assert found
    return float(found.group(1))


# ---------------------------------------------------------------- in a scene


@pytest.mark.parametrize("part", list(TwistPart))
@pytest.mark.parametrize("function", [velocity_ellipsoid, force_ellipsoid])
def test_the_surface_is_the_ellipsoid_at_the_tool_to_scale(function, part):
    model = RX90.with_base(random_pose(np.random.default_rng(4)))
    ellipsoid = function(model, Q, part)
    scene = rm.viz.show(model, Q, ellipsoids=ellipsoid)
    ((text, color),) = scene.legend
    assert text.startswith(f"{ellipsoid.quantity.value}: ")
    assert text.endswith(f"drawn per {ellipsoid.quantity.unit}")
    s = scale_of(text)
    np.testing.assert_allclose(
        scene.pose("ellipsoids/1")[:3, 3], rm.dgm(model, Q)[:3, 3], atol=1e-14
    )
    points = shape(scene, "ellipsoids/1/surface") - rm.dgm(model, Q)[:3, 3]
    inside = (points @ ellipsoid.axes) / (s * ellipsoid.radii)
    np.testing.assert_allclose(np.linalg.norm(inside, axis=-1), 1.0, atol=1e-5)
    # outwards as inwards: the surface is closed and goes around the centre
    assert (inside.max(axis=0) > 0.98).all()
    assert (inside.min(axis=0) < -0.98).all()
    outline = shape(scene, "ellipsoids/1/outline") - rm.dgm(model, Q)[:3, 3]
    inside = (outline @ ellipsoid.axes) / (s * ellipsoid.radii)
    np.testing.assert_allclose(np.linalg.norm(inside, axis=-1), 1.0, atol=1e-12)
    surface = next(n for n in scene.nodes if n.path == "ellipsoids/1/surface")
    assert surface.color[:3] == color[:3]
    assert 0 < surface.color[3] <= 0.2
    assert len(set(scene.paths)) == len(scene.paths)


def test_the_scale_is_round_and_fits_the_robot(rng):
    for size in (0.05, 1.0, 30.0):
        for largest in (1e-3, 0.7, 40.0, 1e5):
            ellipsoid = Ellipsoid(
                EllipsoidQuantity.LINEAR_VELOCITY, np.zeros(3), np.eye(3),
                largest * np.array([1.0, 0.5, 0.3]), np.int64(3),
            )  # fmt: skip
            drawn = draw_ellipsoids([ellipsoid], size)
            s = scale_of(drawn.legend[0][0])
            assert f"{s:e}"[0] in "125"
            assert float(f"{s:.0e}") == pytest.approx(s)
            assert 0.09 * size < s * largest <= 0.2500001 * size
            np.testing.assert_allclose(np.abs(drawn.points).max(), s * largest, rtol=1e-12)


def test_a_scale_asked_for_is_taken():
    ellipsoid = velocity_ellipsoid(RX90, Q)
    scene = rm.viz.show(RX90, Q, ellipsoids=ellipsoid, ellipsoid_scale=0.37)
    assert scene.legend[0][0] == "linear velocity: 0.37 m drawn per m/s"
    points = shape(scene, "ellipsoids/1/surface") - ellipsoid.centre
    reach = np.linalg.norm(points, axis=-1).max()
    np.testing.assert_allclose(reach, 0.37 * ellipsoid.radii[0], rtol=1e-2)


def test_a_flat_ellipsoid_is_a_disc_in_its_plane():
    scene = rm.viz.show(PLANAR, BENT, ellipsoids=velocity_ellipsoid(PLANAR, BENT))
    points = shape(scene, "ellipsoids/1/surface")
    assert np.ptp(points[:, 2]) < 1e-7
    assert np.ptp(points[:, 0]) > 0.1
    assert not any("axis_3" in p for p in scene.paths)


def test_a_line_is_a_bar_and_a_point_a_dot():
    line = velocity_ellipsoid(PLANAR, STRAIGHT)
    scene = rm.viz.show(PLANAR, STRAIGHT, ellipsoids=line)
    s = scale_of(scene.legend[0][0])
    assert "ellipsoids/1/surface" not in scene.paths
    bar = shape(scene, "ellipsoids/1/axis_1") - line.centre
    along = bar @ line.axes[:, 0]
    np.testing.assert_allclose([along.min(), along.max()], [-s * line.radii[0], s * line.radii[0]],
                               rtol=1e-6)  # fmt: skip
    # at the base nothing moves
    point = velocity_ellipsoid(PLANAR, BENT, frame=0)
    assert int(point.rank) == 0
    scene = rm.viz.show(PLANAR, BENT, ellipsoids=point)
    dot = next(n for n in scene.nodes if n.path == "ellipsoids/1/dot")
    assert isinstance(dot.shape, Sphere)
    np.testing.assert_allclose(scene.pose("ellipsoids/1/dot")[:3, 3], point.centre)


@pytest.mark.parametrize(("q", "endless"), [(BENT, 1), (STRAIGHT, 2)])
def test_an_endless_ellipsoid_is_cut_and_says_so(q, endless):
    ellipsoid = force_ellipsoid(PLANAR, q)
    assert int(np.isinf(ellipsoid.radii).sum()) == endless
    scene = rm.viz.show(PLANAR, q, ellipsoids=ellipsoid)
    text = scene.legend[0][0]
    assert "goes on along the dashes" in text
    s = scale_of(text)
    points = (shape(scene, "ellipsoids/1/surface") - ellipsoid.centre) @ ellipsoid.axes
    assert np.isfinite(points).all()
    finite = np.isfinite(ellipsoid.radii)
    # across the open axes every point is on the ellipse (the sheets) of the finite ones
    inside = points[:, finite] / (s * ellipsoid.radii[finite])
    np.testing.assert_allclose(np.linalg.norm(inside, axis=-1), 1.0, atol=1e-5)
    marks = [p for p in scene.paths if "dash_" in p]
    assert {p.split("dash_")[1][0] for p in marks} == {str(k + 1) for k in range(endless)}
    ends = np.abs(points[:, ~finite]).max(axis=0)
    for path in marks:
        dash = (shape(scene, path) - ellipsoid.centre) @ ellipsoid.axes
        k = int(path.split("dash_")[1][0]) - 1
        assert np.abs(dash[:, k]).min() > ends[k]
    # the camera sees the marks
    everything = np.concatenate([shape(scene, p) for p in marks])
    back = scene.camera.position - scene.camera.target
    depth = (scene.camera.position - everything) @ back / scene.camera.distance
    assert (depth > 0).all()


def test_forces_in_every_direction_have_no_surface():
    everything = force_ellipsoid(PLANAR, BENT, frame=0)
    assert np.isinf(everything.radii).all()
    scene = rm.viz.show(PLANAR, BENT, ellipsoids=everything)
    assert "ellipsoids/1/surface" not in scene.paths
    assert sum("dash_" in p for p in scene.paths) == 18
    assert "goes on" in scene.legend[0][0]
    assert scene.html()


def test_a_long_ellipsoid_is_cut_on_its_own_surface():
    """Near a singular position forces are long but not endless: what is drawn is still exact."""
    q = [0.4, 0.02]
    ellipsoid = force_ellipsoid(PLANAR, q)
    assert np.isfinite(ellipsoid.radii[1])
    assert ellipsoid.radii[1] > 50 * ellipsoid.radii[2]
    scene = rm.viz.show(PLANAR, q, ellipsoids=ellipsoid)
    s = scale_of(scene.legend[0][0])
    points = (shape(scene, "ellipsoids/1/surface") - ellipsoid.centre) @ ellipsoid.axes / s
    inside = points[:, 1:] / ellipsoid.radii[1:]
    np.testing.assert_allclose(np.linalg.norm(inside, axis=-1), 1.0, atol=1e-5)
    assert np.abs(points[:, 1]).max() < 0.5 * ellipsoid.radii[1]
    assert {p[:-2] for p in scene.paths if "dash_" in p} == {
        "ellipsoids/1/dash_1", "ellipsoids/1/dash_2"}  # fmt: skip
    whole = rm.viz.show(PLANAR, q, ellipsoids=ellipsoid, ellipsoid_scale=s)
    assert not any("dash_2" in p for p in whole.paths)


def test_several_quantities_and_postures(rng):
    q = np.array([Q, Q + 0.3, Q - 0.2])
    kinds = [velocity_ellipsoid(RX90, q), force_ellipsoid(RX90, q),
             velocity_ellipsoid(RX90, q, TwistPart.ANGULAR)]  # fmt: skip
    scene = rm.viz.show(RX90, q, ellipsoids=kinds, legend=["a", "b", "c"])
    assert [text for text, _ in scene.legend[:3]] == ["a", "b", "c"]
    assert [text.split(":")[0] for text, _ in scene.legend[3:]] == [
        "linear velocity", "angular velocity", "force",
    ]  # fmt: skip
    assert len({color for _, color in scene.legend}) == 6
    for k in range(9):
        np.testing.assert_allclose(
            scene.pose(f"ellipsoids/{k + 1}")[:3, 3], rm.dgm(RX90, q[k % 3])[:3, 3], atol=1e-14
        )
    assert scene.html().count("drawn per") == 3
    without = rm.viz.show(RX90, q)
    assert without.legend == ()
    assert not any(p.startswith("ellipsoids") for p in without.paths)


@pytest.mark.parametrize("seed", range(10))
def test_any_robot_gives_a_page(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=1 + seed % 6, tree=True, fixed=True)
    q, _, _ = random_state(model, rng)
    kinds = [
        function(model, q, part, other=other)
        for function in (velocity_ellipsoid, force_ellipsoid)
        for part in TwistPart
        for other in OtherPart
    ]
    scene = rm.viz.show(model, q, ellipsoids=kinds)
    for node in scene.nodes:
        if isinstance(node.shape, (Triangles, Segments)):
            vertices = getattr(node.shape, "vertices", getattr(node.shape, "points", None))
            assert np.isfinite(vertices).all(), node.path
    found = re.search(r'id="scene">(.*?)</script>', scene.html(), re.DOTALL)
    assert found
    json.loads(found.group(1), parse_constant=lambda word: pytest.fail(word))  # NaN, Infinity
    figure = plot_ellipsoids(kinds)
    for line in (line for axes in figure.axes for line in axes.lines):
        assert np.isfinite(line.get_xydata()).all()
    if seed == 3:  # laid out and drawn, with tick labels and all: slow
        figure.draw_without_rendering()


def test_mistakes_are_named():
    ellipsoid = velocity_ellipsoid(RX90, Q)
    for bad in ("linear", [ellipsoid, 3], np.eye(3)):
        with pytest.raises(InvalidValueError, match="ellipsoids"):
            rm.viz.show(RX90, Q, ellipsoids=bad)
    for bad in (0.0, -1.0, np.nan):
        with pytest.raises(InvalidValueError, match="ellipsoid_scale"):
            rm.viz.show(RX90, Q, ellipsoids=ellipsoid, ellipsoid_scale=bad)
    with pytest.raises(InvalidValueError, match="columns"):
        rm.viz.show(RX90, [Q, Q], columns=2, ellipsoids=ellipsoid)
    empty = velocity_ellipsoid(RX90, np.zeros((0, 6)))
    assert rm.viz.show(RX90, Q, ellipsoids=empty).legend == ()


# ---------------------------------------------------------------- in a figure


def lines(axes, kind):
    return [line for line in axes.lines if (line.get_label()[0] == "_") == (kind == "axes")]


def test_shadows_are_the_widths_of_the_ellipsoid():
    kinds = [velocity_ellipsoid(RX90, Q), force_ellipsoid(RX90, Q)]
    figure = plot_ellipsoids(kinds)
    assert len(figure.axes) == 6
    assert not figure.legends
    for row, ellipsoid in enumerate(kinds):
        for column, plane in enumerate(((0, 1), (0, 2), (1, 2))):
            axes = figure.axes[3 * row + column]
            (border,) = lines(axes, "borders")
            points = border.get_xydata()
            for direction in np.eye(2):
                world = np.zeros(3)
                world[list(plane)] = direction
                np.testing.assert_allclose(
                    (points @ direction).max(), ellipsoid.extent_along(world), rtol=1e-3
                )
            assert len(lines(axes, "axes")) == 3
            low, high = axes.get_xlim()
            assert low < points[:, 0].min() < points[:, 0].max() < high
            assert axes.get_aspect() == 1.0
            assert axes.get_xlabel() == f"${'vf'[row]}_{'xyz'[plane[0]]}$ ({['m/s', 'N'][row]})"
            assert axes.get_ylabel() == f"${'vf'[row]}_{'xyz'[plane[1]]}$ ({['m/s', 'N'][row]})"


def test_flat_and_endless_shadows():
    figure = plot_ellipsoids([velocity_ellipsoid(PLANAR, BENT), force_ellipsoid(PLANAR, BENT)])
    xz = lines(figure.axes[1], "borders")[0].get_xydata()
    assert np.abs(xz[:, 1]).max() < 1e-12
    np.testing.assert_allclose(
        xz[:, 0].max(), velocity_ellipsoid(PLANAR, BENT).extent_along([1, 0, 0]), rtol=1e-6
    )
    strip = lines(figure.axes[4], "borders")[0].get_xydata()
    assert np.abs(strip[:, 1]).min() > 100 * figure.axes[4].get_ylim()[1]
    np.testing.assert_allclose(
        np.abs(strip[:, 0]), force_ellipsoid(PLANAR, BENT).extent_along([1, 0, 0]), rtol=1e-9
    )
    ends = [line for line in figure.axes[4].lines if line.get_label() == "_axis without end"]
    assert len(ends) == 1
    # endless in two directions: a strip in the plane of one, all of the planes of both
    both = plot_ellipsoids(force_ellipsoid(PLANAR, STRAIGHT))
    slab = lines(both.axes[0], "borders")[0].get_xydata()
    normal = [-np.sin(0.4), np.cos(0.4)]
    np.testing.assert_allclose(
        np.abs(slab @ normal), force_ellipsoid(PLANAR, STRAIGHT).radii[2], rtol=1e-6
    )
    covered = lines(both.axes[1], "borders")[0].get_xydata()
    assert np.abs(covered).min() > 100 * both.axes[1].get_xlim()[1]


def test_legend_and_labels():
    q = np.array([Q, Q + 0.3])
    kinds = [velocity_ellipsoid(RX90, q), force_ellipsoid(RX90, q)]
    figure = plot_ellipsoids(kinds, labels=["bent", "stretched"], title="RX-90")
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["bent", "stretched"]
    assert legend.get_title().get_text() == "RX-90"
    first = [lines(axes, "borders")[0] for axes in figure.axes]
    assert len({line.get_color() for line in first}) == 1  # one posture, one colour
    numbers = plot_ellipsoids(kinds).legends[0].get_texts()
    assert [text.get_text() for text in numbers] == ["1", "2"]
    with pytest.raises(ShapeError, match="labels"):
        plot_ellipsoids(kinds, labels=["bent"])
    with pytest.raises(InvalidValueError, match="at least one"):
        plot_ellipsoids([])
    with pytest.raises(InvalidValueError, match="ellipsoids"):
        plot_ellipsoids(3)
