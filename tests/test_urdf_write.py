"""URDF out: the same text for the same robot, nothing lost but what the warning lists."""

import warnings
import xml.etree.ElementTree as ET
from contextlib import nullcontext

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from identities.random_robots import (
    any_models,
    models,
    random_state,
    robot_size,
    table_poses,
)

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import UrdfError, UrdfWarning
from robotmodels.urdf.write import link_names

ONE = rm.DHTable(antecedent=[0], sigma=[0])


def quiet_urdf(model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UrdfWarning)
        return rm.to_urdf(model)


def pin_poses(text, links, joint_names, q):
    """World poses of links by Pinocchio's own reading of the text."""
    model = pin.buildModelFromXML(text)
    data = model.createData()
    x = np.zeros(model.nq)
    for name, value in zip(joint_names, q, strict=True):
        x[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, x)
    ids = [model.getFrameId(link, pin.FrameType.BODY) for link in links]
    assert max(ids) < model.nframes
    return np.array([data.oMf[i].homogeneous for i in ids])


@given(any_models())
def test_pinocchio_reads_the_table_from_the_text(model):
    """Links R_1..R_f and the tool stand where the plain product of the table puts them."""
    q, _, _ = random_state(model, np.random.default_rng(1))
    names = link_names(model.parts)
    got = pin_poses(quiet_urdf(model), (*names.frames[1:], names.tool), model.table.joint_names, q)
    poses = table_poses(model, q)
    wanted = np.concatenate((poses, (poses[model.tip - 1] @ model.tool)[None]))
    assert np.abs(got - wanted).max() < 1e-12 * robot_size(model, q)


@given(models(inertia="physical", drive=False, transmission=False, gravity=False))
def test_reading_back_gives_the_same_robot(model):
    """Poses, Jacobians and torques, with other frames: R_j are placed anew by the rules."""
    back = rm.RobotModel.from_urdf(rm.to_urdf(model), tip_link=None)
    rng = np.random.default_rng(2)
    tool = link_names(model.parts).tool
    q, v, a = random_state(model, rng)
    # depth first in the order of the text may number branches otherwise
    order = [model.table.joint_names.index(name) for name in back.table.joint_names]
    size = robot_size(model, q)
    assert np.abs(rm.dgm(back, q[order], tool) - rm.dgm(model, q)).max() < 1e-12 * size
    J = rm.jacobian(model, q)[:, order]
    assert np.abs(rm.jacobian(back, q[order], tool) - J).max() < 1e-12 * size
    tau = rm.idm(model, q, v, a)
    error = np.abs(rm.idm(back, q[order], v[order], a[order]) - tau[order]).max()
    assert error < 1e-12 * max(1.0, np.abs(tau).max()) * size
    for limit in ("lower", "upper", "velocity", "effort"):
        got, wanted = getattr(back.table, limit), getattr(model.table, limit)[order]
        assert np.array_equal(got, wanted), limit


@pytest.mark.parametrize(
    "names",
    [
        ("base", "world", "tool"),
        ("joint_1", "1", "link_1"),
        ("tool_fixed", "tool", "tool_kk"),
        ("a<&>\"'", "b c", "θ_1"),
    ],
    ids=lambda names: "-".join(names).encode("unicode_escape").decode(),
)
def test_names_that_collide_or_need_escaping(names):
    """Any names: all links and joints differ, each joint keeps its name, poses are right."""
    table = rm.DHTable(antecedent=[0, 1, 2], sigma=[0, 1, 0], d=[0.1, 0.2, 0.3], names=names)
    model = rm.RobotModel.from_table(table, tool=se3.translation(0.1, 0, 0), name=f"<{names[0]}>")
    # a joint called so takes the name by which the tool is found again: that is said
    taken = pytest.warns(UrdfWarning, match="tip_link=") if "tool" in names else nullcontext()
    with taken:
        text = rm.to_urdf(model)
    robot = ET.fromstring(text)
    for kind in ("link", "joint"):
        found = [element.get("name") for element in robot.findall(kind)]
        assert len(set(found)) == len(found)
    q = [0.1, 0.2, 0.3]
    back = rm.RobotModel.from_urdf(text)
    assert back.table.names == names
    assert back.name == model.name
    assert np.abs(rm.dgm(back, q) - rm.dgm(model, q)).max() < 1e-15
    for j, name in enumerate(names, start=1):
        # a name of the table is its frame, whatever else the text is made of
        assert np.array_equal(rm.dgm(model, q, name), rm.dgm(model, q, j))


def test_mimics_are_written_and_read_back():
    table = rm.DHTable(antecedent=[0, 1, 1], sigma=[0, 1, 1], names=["arm", "left", "right"])
    K = rm.Transmission([[1, 0, 0], [0, 1, 0], [0, -0.5, 0]], [0, 0, 0.25])
    model = rm.RobotModel.from_table(table, transmission=K)
    text = rm.to_urdf(model)
    element = ET.fromstring(text).find("joint[@name='right']/mimic")
    assert element.attrib == {"joint": "left", "multiplier": "-0.5", "offset": "0.25"}
    assert rm.RobotModel.from_urdf(text, mimic=True).transmission == K
    assert rm.RobotModel.from_urdf(text).transmission is None
    assert model.pin_model.nq == 3, "the twin keeps all joints independent"


@pytest.mark.parametrize(
    "matrix",
    [[[1, 1], [1, 1]], [[0.5, 0], [1, 0]], [[0, 1], [0, 0]]],
    ids=["sums", "geared master", "chain to a still one"],
)
def test_transmissions_that_a_urdf_cannot_say_are_refused(matrix):
    table = rm.DHTable(antecedent=[0, 1], sigma=[0, 0])
    model = rm.RobotModel.from_table(table, transmission=rm.Transmission(matrix))
    with pytest.raises(UrdfError, match=r"other poses\. .*with_transmission\(None\)"):
        rm.to_urdf(model)
    assert rm.to_urdf(model.with_transmission(None)).count("<mimic") == 0


LOST = {
    "rotor": ({"drive": rm.DriveParameters(Ia=[0.1])}, "the rotor inertias Ia"),
    "offset": ({"drive": rm.DriveParameters(offset=[0.1])}, "the torque offsets"),
    "gravity": ({"gravity": (0, 9.81, 0)}, "gravity [0.0, 9.81, 0.0]"),
    "moments": (
        {"inertia": rm.InertialParameters([[0] * 6 + [1, 0, 0, 0]])}, "the inertia of joint_1",
    ),
    "negative": ({"inertia": rm.InertialParameters([[0] * 9 + [-1.0]])}, "the inertia of joint_1"),
    "gears": ({"transmission": rm.Transmission([[0.01]])}, "the transmission"),
    "friction": ({"drive": rm.DriveParameters(Fc=[-1e-3])}, "negative friction"),
    "several": (
        {"drive": rm.DriveParameters(Ia=[0.1]), "gravity": (0, 0, 1)},
        "the rotor inertias Ia; gravity [0.0, 0.0, 1.0]",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("parts", "words"), LOST.values(), ids=LOST)
def test_each_loss_is_listed(parts, words):
    with pytest.warns(UrdfWarning) as caught:
        rm.to_urdf(rm.RobotModel.from_table(ONE, **parts))
    assert len(caught) == 1
    assert words in str(caught[0].message)
    assert caught[0].filename == __file__, "the warning points at the caller"


@given(models(max_frames=6))
def test_yourdfpy_loads_and_validates(model):
    yourdfpy = pytest.importorskip("yourdfpy")
    import io

    robot = yourdfpy.URDF.load(
        io.BytesIO(quiet_urdf(model).encode()), load_meshes=False, build_scene_graph=True
    )
    assert robot.validate(), robot.errors
    q, _, _ = random_state(model, np.random.default_rng(0))
    robot.update_cfg(dict(zip(model.table.joint_names, q, strict=True)))
    names = link_names(model.parts)
    got = robot.get_transform(names.tool, names.world)
    assert np.abs(got - rm.dgm(model, q)).max() < 1e-9 * robot_size(model, q)


def test_the_tool_survives_a_round_trip():
    """Also where it is neither on the last frame nor a link of the source."""
    for name in ("erd:panda", "erd:ur5", "erd:tiago_dual"):
        model = rm.load(name).with_tool(se3.translation(0.1, 0.2, 0.3), tip=3)
        back = rm.RobotModel.from_urdf(rm.to_urdf(model))
        q = np.linspace(-0.5, 0.5, model.n)
        assert np.abs(rm.dgm(back, q) - rm.dgm(model, q)).max() < 1e-14
