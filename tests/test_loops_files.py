"""Looped robots from SYMORO's and MuJoCo's files, and their pictures."""

import warnings

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import loops
from robotmodels.errors import LoopError, ParFileError, RobotModelsWarning

SR400 = """(* Robotname = 'SR400' *)
NL = 8
NJ = 9
NF = 10
Type = 2
ant = {0,1,2,3,4,5,1,7,8,3}
sigma = {0,0,0,0,0,0,0,0,0,2}
d = {0,D2,D3,D4,0,0,D2,D8,D3,-D8}
r = {0,0,0,RL4,0,0,0,0,0,0}
gamma = {0,0,0,0,0,0,0,0,0,pi/2}
b = {0,0,0,0,0,0,0,0,0,0}
alpha = {0,-pi/2,0,-pi/2,pi/2,-pi/2,-pi/2,0,0,0}
mu = {1,1,0,1,1,1,1,0,0,0}
theta = {th1,th2,th3,th4,th5,th6,th7,th8,th9,0}
IA = {IA1,IA2,IA3,IA4,IA5,IA6,IA7,IA8}
"""
LENGTHS = {"D2": 0.4, "D3": 0.8, "D4": -0.2, "RL4": 1.0, "D8": 1.0}
BAR = '<inertial pos="0.2 0 0" mass="1.5" diaginertia="0.1 0.2 0.3"/>'
FOUR_BAR = f"""<mujoco model="bars"><compiler angle="radian"/>
<worldbody>
  <body name="crank"><joint name="j1" axis="0 0 1" damping="0.2" armature="0.1"/>{BAR}
    <body name="rod" pos="0.3 0 0"><joint name="j2" axis="0 0 1" range="-3 2" limited="true"/>{BAR}
    </body></body>
  <body name="rocker" pos="1 0 0" euler="0.3 0 0"><joint name="j3" axis="0 0 1"/>{BAR}</body>
</worldbody>
<equality><connect body1="rod" body2="rocker" anchor="0.7 0 0"/></equality>
<actuator><motor joint="j1"/></actuator></mujoco>"""


@pytest.fixture
def read(tmp_path):
    def read_text(text, reader, name="robot.par", **options):
        (tmp_path / name).write_text(text)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RobotModelsWarning)
            return reader(tmp_path / name, **options)

    return read_text


def test_a_parallelogram_robot_of_symoro(read):
    robot = read(SR400, loops.read_par, values=LENGTHS)
    assert robot.name == "SR400"
    assert robot.actuated.tolist() == [0, 1, 3, 4, 5, 6]
    assert robot.closures == (loops.Closure("cut_9", (9, 10), "revolute"),)
    found = loops.close(robot, [0.3, 0.5, 0.2, 0.4, 0.1, 1.2])
    assert found.status == loops.ClosingStatus.CLOSED
    first, second = (rm.dgm(robot.tree, found.q, frame) for frame in (9, 10))
    assert np.allclose(first[:3, 2:], second[:3, 2:], atol=1e-12)
    mobility = loops.mobility(robot, found.q)
    assert int(mobility) == 6
    assert mobility.redundant == ("cut_9.z", "cut_9.rx", "cut_9.ry")
    # as many as an independent rank of G^T W, with rotors and without friction
    assert len(loops.base_parameters(robot, found.q, drive=("Ia",))) == 51
    assert len(rm.base_parameters(robot.tree, drive=("Ia",))) == 55


def test_mjcf_with_one_and_with_two_root_bodies(read):
    robot = read(FOUR_BAR, loops.read_mjcf, name="bars.xml")
    assert robot.name == "bars"
    assert sorted(robot.tree.table.joint_names) == ["j1", "j2", "j3"]
    assert robot.tree.drive.Ia.sum() == pytest.approx(0.1)
    assert robot.tree.drive.Fv[robot.actuated[0]] == pytest.approx(0.2)
    assert robot.tree.upper[robot.tree.table.joint_names.index("j2")] == 2.0
    poses = {name: rm.dgm(robot.tree, np.zeros(3), f"connect_1_{name}") for name in ("1", "2")}
    assert np.allclose(poses["1"][:3, 3], [1.0, 0.0, 0.0], atol=1e-12)
    assert np.allclose(poses["2"][:3, 3], [1.0, 0.0, 0.0], atol=1e-12)
    # frame 1 has z along the joint's axis and the file's zero
    expected = rm.InertialParameters.from_com([1.5], [[0.2, 0, 0]], [np.diag([0.1, 0.2, 0.3])])
    row = robot.tree.table.names.index("j1")
    assert np.allclose(robot.tree.inertia.values[row], expected.values[0], atol=1e-12)
    assert robot.tree.inertia.values[:, 9].sum() == pytest.approx(4.5)
    inside = FOUR_BAR.replace("<worldbody>", '<worldbody><body name="ground">').replace(
        "</worldbody>", "</body></worldbody>"
    )
    one = read(inside, loops.read_mjcf, name="one.xml")
    q, v, a = np.random.default_rng(0).normal(size=(3, 3))
    order = [one.tree.table.joint_names.index(name) for name in robot.tree.table.joint_names]
    tau = [
        rm.idm(r.tree, q[o], v[o], a[o]) for r, o in ((robot, [0, 1, 2]), (one, np.argsort(order)))
    ]
    assert np.allclose(tau[0], tau[1][order], atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("<mujoco", "<robot><mujoco", "cannot read"),
        ("connect", "joint", "not supported"),
        ('<joint name="j3" axis="0 0 1"/>', '<freejoint name="j3"/>', "'j3' is a"),
        ('body2="rocker"', 'body2="nobody"', "nobody"),
        (' anchor="0.7 0 0"', "", "anchor with 3 numbers"),
        ("NF = 10", "NF = 9", "second frame"),
    ],
)
def test_files_that_are_refused_by_name(read, old, new, words):
    reader, text = (loops.read_mjcf, FOUR_BAR) if old in FOUR_BAR else (loops.read_par, SR400)
    with pytest.raises((LoopError, ParFileError), match=words):
        read(text.replace(old, new), reader, **({} if text is FOUR_BAR else {"values": LENGTHS}))
    with pytest.raises(ParFileError, match=r"loops\.read_par"):
        read(SR400, rm.read_par, values=LENGTHS)


def test_mjcf_equalities_keep_their_order_and_inactive_ones_are_none(read):
    connect = '<connect body1="rod" body2="rocker" anchor="0.7 0 0"/>'
    other = connect.replace("0.7", "0.4")
    weld = '<weld name="z" body1="crank" body2="rod"/>'
    off = weld.replace("/>", ' active="false"/>')
    many = FOUR_BAR.replace(connect, off + weld + connect + other)
    robot = read(many, loops.read_mjcf, name="many.xml")
    names = [(closure.name, closure.kind) for closure in robot.closures]
    assert names == [("weld_1", "full"), ("connect_2", "point"), ("connect_3", "point")]
    for name, x in (("connect_2_1", 1.0), ("connect_3_1", 0.7)):
        place = rm.dgm(robot.tree, np.zeros(3), name)[:3, 3]
        assert np.allclose(place, [x, 0.0, 0.0], atol=1e-12)
    scene, bare = (rm.viz.show(shown, np.zeros(3)) for shown in (robot, robot.tree))
    assert len(scene.paths) >= len(bare.paths) + 2 * 3  # a ring and a ball for each closure
