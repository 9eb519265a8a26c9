"""The model: parts that fit, a value that copies, pickles and computes the same anywhere."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import (
    any_models,
    models,
    random_bodies,
    random_drive,
    random_model,
    random_pose,
    random_state,
    random_transmission,
)

import robotmodels as rm
from robotmodels.errors import (
    FrameNotFoundError,
    InvalidValueError,
    NotARotationError,
    ShapeError,
)

TWO = rm.DHTable.from_rows([{}, {"d": 0.3}])


def tree_model(seed=0, **options):
    options = {"f": 7, "tree": True, "fixed": True, "drive": True, "transmission": True, **options}
    return random_model(np.random.default_rng(seed), **options)


def numbers(model, q, v, a):
    """One vector of everything that threads and processes must agree on."""
    parts = (
        rm.dgm(model, q), rm.jacobian(model, q), rm.idm(model, q, v, a), rm.mass_matrix(model, q),
        rm.link_poses(model, q), rm.ddm(model, q, v, a),
    )  # fmt: skip
    return np.concatenate([np.ravel(part) for part in parts])


# --- making one ----------------------------------------------------------------------------------


def test_defaults():
    model = rm.RobotModel.from_table(TWO)
    assert (model.n, model.f, model.name, model.tip) == (2, 2, "robot", 2)
    assert np.array_equal([model.base, model.tool], [np.eye(4)] * 2)
    assert model.gravity.tolist() == [0, 0, -9.81]
    assert model.transmission is None
    assert model.inertia == rm.InertialParameters.zeros(2)
    assert model.drive.is_zero
    assert model.frame_names == ("base", "joint_1", "joint_2", "tool")
    assert str(TWO) in str(model)


MISTAKES = {
    "table": ({"table": "rx90"}, InvalidValueError, "expected a DHTable, got str"),
    "name": ({"name": ""}, InvalidValueError, "name: expected a text"),
    "base shape": ({"base": np.eye(3)}, ShapeError, r"base: expected shape \(\.\.\., 4, 4\)"),
    "bases": ({"base": [np.eye(4)] * 2}, ShapeError, "base: expected one pose"),
    "tool mirror": ({"tool": np.diag([1, 1, -1, 1])}, NotARotationError, "det R = -1"),
    "tip 3": ({"tip": 3}, FrameNotFoundError, "No frame number 3"),
    "tip name": ({"tip": "joint_1"}, FrameNotFoundError, "tip is a number"),
    "gravity column": ({"gravity": [[0], [0], [1]]}, ShapeError, r"got \(3, 1\)"),
    "gravity nan": ({"gravity": [0, 0, np.nan]}, InvalidValueError, "gravity: .* got nan"),
    "drive": ({"drive": [0, 0]}, InvalidValueError, "expected DriveParameters, got list"),
    "gears": ({"transmission": np.eye(2)}, InvalidValueError, "expected Transmission, got ndarr"),
    "gears of 3": ({"transmission": rm.Transmission(np.eye(3))}, ShapeError, "2 moving joints"),
    "posture": ({"configurations": {"up": [1]}}, ShapeError, "configuration 'up': expected shape"),
    "postures": ({"configurations": [1]}, InvalidValueError, "configurations: expected a mapping"),
    "zero": ({"configurations": {"zero": [1, 0]}}, InvalidValueError, "'zero' is q = 0"),
}  # fmt: skip


@pytest.mark.parametrize(("parts", "error", "words"), MISTAKES.values(), ids=MISTAKES)
def test_parts_that_do_not_fit(parts, error, words):
    with pytest.raises(error, match=words):
        rm.RobotModel.from_table(**{"table": TWO, **parts})


# --- a value -------------------------------------------------------------------------------------


@given(any_models())
def test_models_pickle_copy_and_compare(model):
    q, _, _ = random_state(model, np.random.default_rng(0))
    rm.jacobian(model, q)  # what was computed and cached must not go along
    for other in (
        pickle.loads(pickle.dumps(model)),
        copy.deepcopy(model),
        copy.copy(model),
    ):
        assert other == model
        assert hash(other) == hash(model)
        assert np.array_equal(rm.dgm(other, q), rm.dgm(model, q))
        assert np.array_equal(rm.gravity_torque(other, q), rm.gravity_torque(model, q))
        for array in (other.base, other.tool, other.gravity, other.table.d, other.inertia.values):
            assert not array.flags.writeable


CHANGES = {
    "table": lambda m, rng: m.with_table(m.table.replace(d=m.table.d + 0.1)),
    "inertia": lambda m, rng: m.with_inertia(random_bodies(rng, m.f)),
    "no inertia": lambda m, rng: m.with_inertia(None),
    "drive": lambda m, rng: m.with_drive(random_drive(rng, m.n)),
    "no drive": lambda m, rng: m.with_drive(None),
    "base": lambda m, rng: m.with_base(random_pose(rng)),
    "no base": lambda m, rng: m.with_base(None),
    "tool": lambda m, rng: m.with_tool(random_pose(rng)),
    "tip": lambda m, rng: m.with_tool(m.tool, tip=1),
    "no tool": lambda m, rng: m.with_tool(None),
    "gravity": lambda m, rng: m.with_gravity([1, 2, 3]),
    "gears": lambda m, rng: m.with_transmission(random_transmission(rng, m.n)),
    "no gears": lambda m, rng: m.with_transmission(None),
}


@pytest.mark.parametrize("change", CHANGES)
def test_with_methods_change_one_thing_in_a_new_model(change, rng):
    model = tree_model()
    q, v, a = random_state(model, rng)
    before = numbers(model, q, v, a)
    changed = CHANGES[change](model, np.random.default_rng(5))
    assert changed != model
    assert np.array_equal(numbers(model, q, v, a), before), "the old one must not change"
    differing = [
        part
        for part in ("table", "inertia", "drive", "base", "tool", "tip", "gravity", "transmission")
        if not np.array_equal(getattr(changed, part), getattr(model, part))
    ]
    expected = {"gears": "transmission"}.get(change.split()[-1], change.split()[-1])
    assert differing == [expected]
    fresh = pickle.loads(pickle.dumps(changed))
    assert np.array_equal(numbers(changed, q, v, a), numbers(fresh, q, v, a)), "no stale cache"


# --- Pinocchio's side ----------------------------------------------------------------------------


@given(models(tree=True))
def test_pin_order_leads_to_each_joint_in_the_twin(model):
    twin = model.pin_model
    assert (twin.nq, twin.nv) == (model.n, model.n)
    assert sorted(model.pin_order) == list(range(model.n))
    for name, column in zip(model.table.joint_names, model.pin_order, strict=True):
        assert twin.joints[twin.getJointId(name)].idx_q == column
    lower = twin.lowerPositionLimit[model.pin_order]
    assert np.array_equal(np.where(lower < -1e300, -np.inf, lower), model.lower)
    x = np.arange(float(model.n))
    assert np.array_equal(model.twin.from_pin(model.twin.to_pin(x)), x)
    assert np.array_equal(twin.gravity.linear, model.gravity)


# --- frames --------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", ["wrist_3_lnk", 7, -1, True, 1.0, np.zeros(2)])
def test_unknown_frames(frame):
    model = rm.load("erd:ur5")
    rm.dgm(model, np.zeros(6), frame=1)  # True and 1.0 must not find what 1 has left behind
    with pytest.raises(FrameNotFoundError, match=r"^No frame") as caught:
        rm.dgm(model, np.zeros(6), frame=frame)
    if isinstance(frame, str) and frame:
        assert "Did you mean 'wrist_3_link'" in str(caught.value)
        assert caught.value.nearest[0] == "wrist_3_link"


# --- joint vectors -------------------------------------------------------------------------------

WRONG = {
    "short": (np.zeros(5), ShapeError, r"expected shape \(\.\.\., 6\), got \(5,\)"),
    "column": (np.zeros((6, 1)), ShapeError, r"got \(6, 1\)\. This is a column: pass"),
    "transposed": (np.zeros((6, 4)), ShapeError, r"rows are samples, so pass .*\.T"),
    "scalar": (0.0, ShapeError, r"got \(\)"),
    "nan": ([0, 0, np.nan, 0, 0, 0], InvalidValueError, r"got nan at index \[2\]"),
    "inf": (np.full((2, 6), np.inf), InvalidValueError, r"got inf at index \[0, 0\]"),
    "text": ("123456", InvalidValueError, "expected real numbers"),
    "ragged": ([[0], [0, 1]], InvalidValueError, "in a regular array"),
    "None": (None, InvalidValueError, "expected real numbers"),
}

CALLS = {
    "dgm": lambda m, x: rm.dgm(m, x),
    "link_poses": lambda m, x: rm.link_poses(m, x),
    "jacobian_rate": lambda m, x: rm.jacobian_rate(m, np.zeros(6), x),
}


@pytest.fixture(scope="module")
def ur5():
    return rm.load("erd:ur5")


@pytest.mark.parametrize(("value", "error", "words"), WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("call", CALLS)
def test_wrong_joint_vectors_are_refused_everywhere(ur5, call, value, error, words):
    with pytest.raises(error, match=words):
        CALLS[call](ur5, value)
