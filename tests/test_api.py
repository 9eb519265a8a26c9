"""The public interface: what has a public name, and how it is called.

The list is ``api_snapshot.txt`` beside this file. After a change that is meant, write it again:

    python tests/test_api.py
"""

import difflib
import enum
import importlib
import inspect
import pkgutil
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import get_origin

import pytest

import robotmodels as rm

SNAPSHOT = Path(__file__).with_name("api_snapshot.txt")
AGAIN = "if the change is meant, write the list again with: python tests/test_api.py"
# Rooms of their own that serve the others: the command line is called by its options, kernels by
# the models, and formats of tables and texts by readers and printers.
INSIDE = {"cli", "csv_table", "file_units", "kernels", "latex_text", "table_text", "visual"}


# --- the list ------------------------------------------------------------------------------------


def rooms() -> dict[str, ModuleType]:
    """Name and module of the door and of each room behind it."""
    found = {"robotmodels": rm}
    for part in pkgutil.iter_modules(rm.__path__):
        if not part.name.startswith("_") and part.name not in INSIDE:
            name = f"robotmodels.{part.name}"
            found[name] = importlib.import_module(name)
    return found


def public_names(room: ModuleType) -> list[str]:
    """Its ``__all__``; where there is none, what is defined in it."""
    if hasattr(room, "__all__"):
        return sorted(room.__all__)
    return sorted(
        name
        for name, value in vars(room).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == room.__name__
    )


def call(function) -> str:
    """Arguments in order, with their kinds and defaults; types are not part of the contract."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return "(...)"
    plain = [
        p.replace(
            annotation=p.empty,
            default=p.empty if p.default is p.empty else Written(p.default),
        )
        for p in signature.parameters.values()
        if p.name not in ("self", "cls")
    ]
    return str(signature.replace(parameters=plain, return_annotation=signature.empty))


class Written:
    """A default as the list shows it: no addresses, members of enumerations by their name."""

    def __init__(self, value):
        self.value = value

    def __repr__(self):
        if isinstance(self.value, enum.Enum):
            return f"{type(self.value).__name__}.{self.value.name}"
        if type(self.value) is tuple:
            return repr(tuple(Written(part) for part in self.value))
        if inspect.isroutine(self.value) or inspect.isclass(self.value):
            return self.value.__name__
        return re.sub(r" at 0x[0-9a-f]+|\s+", " ", repr(self.value)).strip()


def members(kind: type) -> Iterator[str]:
    """One line for each public member that this package defines, inherited ones included."""
    if issubclass(kind, enum.Enum):
        for name, member in kind.__members__.items():
            yield f"    {name} = {str(member.value)!r}"
    owners = [c for c in kind.__mro__ if c.__module__.startswith("robotmodels")]
    fields = set(getattr(kind, "__dataclass_fields__", ()))
    seen = {}
    for owner in owners:
        for name, value in vars(owner).items():
            seen.setdefault(name, value)
    for name in sorted(seen.keys() | fields):
        if name.startswith("_") or (issubclass(kind, enum.Enum) and name in kind.__members__):
            continue
        value = seen.get(name)
        if name in fields:
            yield f"    {name}"
        elif isinstance(value, property):
            yield f"    {name} [property]"
        elif isinstance(value, classmethod | staticmethod):
            yield f"    {name}{call(value.__func__)} [{type(value).__name__}]"
        elif inspect.isfunction(value):
            yield f"    {name}{call(value)}"
        else:
            yield f"    {name} [{type(value).__name__}]"


def described(name: str, value) -> Iterator[str]:
    """The lines of one public name."""
    if inspect.ismodule(value):
        yield f"{name} [room]"
    elif inspect.isclass(value):
        bases = [b.__name__ for b in value.__mro__[1:] if b.__module__ == "builtins"]
        ours = any("__init__" in vars(c) for c in value.__mro__ if c.__module__ != "builtins")
        takes = call(value) if ours and not issubclass(value, enum.Enum) else ""
        yield f"class {name}{takes}" + (f" [{bases[0]}]" if bases[0] != "object" else "")
        yield from members(value)
    elif callable(value) and hasattr(value, "__name__"):
        yield f"{name}{call(value)}"
    elif isinstance(value, int | float | str | tuple | frozenset):
        yield f"{name} = {value!r}"
    elif get_origin(value) is not None:
        yield f"{name} [types]"
    else:
        yield f"{name} [{type(value).__name__}]"


def listed() -> str:
    """The whole list; a name that an earlier room has is not described again."""
    lines = ["# Written by: python tests/test_api.py"]
    home: dict[int, str] = {}
    keep = []  # ids are those of living things
    for room_name, room in rooms().items():
        lines += ["", f"[{room_name}]"]
        for name in public_names(room):
            value = getattr(room, name)
            if id(value) in home and not isinstance(value, int | float | str):
                lines.append(f"{name}: as in {home[id(value)]}")
                continue
            home[id(value)] = room_name
            keep.append(value)
            lines += described(name, value)
    return "\n".join(lines) + "\n"


def test_the_public_interface_is_the_one_listed():
    before, now = SNAPSHOT.read_text(encoding="utf-8"), listed()
    if before != now:
        change = "\n".join(
            difflib.unified_diff(
                before.splitlines(), now.splitlines(), "listed", "now", "", "", 1, ""
            )
        )
        pytest.fail(f"the public interface has changed; {AGAIN}\n{change}", pytrace=False)


def test_a_changed_default_is_seen():
    def before(model, q, *, limits=False):
        pass

    def now(model, q, *, limits=True):
        pass

    assert call(before) == "(model, q, *, limits=False)"
    assert call(now) != call(before)


def test_members_and_calls_are_in_the_list():
    text = SNAPSHOT.read_text(encoding="utf-8")
    assert "dgm(model, q, frame=None)" in text
    assert "    from_rows(rows, degrees=False" in text
    assert "class IGMStatus" in text
    assert "0x" not in re.sub(r"= \S+", "", text), "an address differs from run to run"


# --- the contract --------------------------------------------------------------------------------

# Calls that scripts outside this repository make. They may take more arguments behind these, with
# defaults; these keep their names, their order and, where one is written, their default.
CALLS = """
link_transforms(table, q)
DHTable.from_rows(rows, degrees=False)
DHTable.from_standard(rows)
InertialParameters(values)
InertialParameters.from_com(mass, com, inertia)
InertialParameters.from_standard(rows, mass, com, inertia)
DriveParameters(Ia, Fv, Fc, offset)
Transmission(matrix, offset)
RobotModel.from_table(table, inertia=None, drive=None, base=None, tool=None, tip=None, \
gravity=(0, 0, -9.81), transmission=None, name="robot")
RobotModel.from_urdf(path_or_text, base_link=None, tip_link=None, gravity=(0, 0, -9.81), \
package_dirs=(), dynamics=False, mimic=False)
RobotModel.with_table(table)
RobotModel.with_inertia(inertia)
RobotModel.with_drive(drive)
RobotModel.with_base(base)
RobotModel.with_tool(tool)
RobotModel.with_gravity(gravity)
RobotModel.with_transmission(transmission)
to_urdf(model)
write_urdf(model, path)
read_par(path)
load(name)
robots()
dgm(model, q, frame=None)
link_poses(model, q)
operational_coordinates(T, kind)
jacobian(model, q, frame=None, reference="world_aligned")
jacobian_rate(model, q, v, frame=None, reference="world_aligned")
jacobian_factors(model, q, projection, intermediate)
dkm(model, q, v)
ikm(model, q, twist)
idm(model, q, v, a, wrench=None, drive=True)
ddm(model, q, v, tau, wrench=None, drive=True)
mass_matrix(model, q, drive=True)
coriolis_matrix(model, q, v)
gravity_torque(model, q)
kinetic_energy(model, q, v, drive=True)
potential_energy(model, q)
torque_regressor(model, q, v, a, drive=True)
parameter_names(model, drive=True)
energy_regressor(model, q, v, drive=True)
base_parameters(model, method="symbolic", drive=("Ia", "Fv", "Fc"))
BaseParameters.reduce(W)
BaseParameters.values(model)
igm(model, T, q_ref=None, mask=None, mask_axes="world", limits=False, lock=None, arm_angle=None, \
position_tolerance=1e-9, orientation_tolerance=1e-9)
IGMSolutions.reason(i)
IGMSolutions.nearest(q)
explain_dgm(model)
explain_igm(model)
igm_numeric(model, T, q0=None, mask=None, mask_axes="world", position_tolerance=1e-6, \
orientation_tolerance=1e-6, rng=None)
trajectories.joint_trajectory(q0, q1, N)
trajectories.cartesian_trajectory(T0, T1, N)
calibration.fit(model, measurements)
calibration.identifiable_parameters(model, measurements)
calibration.select_configurations(model, kind, count)
calibration.observability(psi)
identification.fit(model, log, method="wls")
identification.exciting_trajectory(model)
viz.show(model, q)
viz.animate(model, q)
"""

# Properties and other names that the same scripts read.
NAMES = """
DHTable: antecedent sigma mu gamma b beta alpha d theta r names lower upper velocity effort
InertialParameters: values is_physical
DriveParameters: Ia Fv Fc offset
Transmission: matrix offset
RobotModel: n f name table base tool tip gravity inertia drive transmission lower upper
RobotModel: configurations frame_names pin_model pin_order
BaseParameters: names no_effect regrouping matrix
IKMSolution: v status
IGMSolutions: q valid count residual within_limits branch status double free_joints
IGMSolutions: family_joints method
InverseModelExplanation: latex
DirectModelExplanation: latex
trajectories: quintic trapezoidal smoothed_trapezoidal jerk_limited fourier
calibration: CalibrationResult Pose Position Distance PointContact FrameContact PlaneContact
identification: Log IdentificationResult read_log
"""


def found(path: str):
    """The object of a dotted name behind the door."""
    value = rm
    for part in path.split("."):
        value = getattr(value, part)
    return value


def calls() -> Iterator[tuple[str, inspect.Signature]]:
    for line in CALLS.strip().splitlines():
        name, _, arguments = line.partition("(")
        scope: dict = {}
        exec(f"def expected({arguments}: pass", scope)
        yield name, inspect.signature(scope["expected"])


@pytest.mark.parametrize(("name", "expected"), [pytest.param(*c, id=c[0]) for c in calls()])
def test_calls_that_scripts_make(name, expected):
    function = found(name)
    given = list(inspect.signature(function).parameters.values())
    if given and given[0].name == "self":
        given = given[1:]
    for p, asked in zip(given, expected.parameters.values(), strict=False):
        assert p.name == asked.name
        assert p.kind is p.POSITIONAL_OR_KEYWORD or asked.default is not p.empty
        if asked.default is not p.empty:
            assert equal(p.default, asked.default), f"{name}: {p.name}={p.default!r}"
    assert len(given) >= len(expected.parameters)
    required = [
        p.name
        for p in given[len(expected.parameters) :]
        if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)
    ]
    assert required == []


def equal(default, asked) -> bool:
    """Whether a default is the one asked for, an enumeration's member counting as its value."""
    if isinstance(default, enum.Enum):
        return asked in (default.value, default.name.lower())
    if isinstance(asked, tuple):
        return tuple(default) == asked
    return default == asked


def test_names_that_scripts_read():
    missing = []
    for line in NAMES.strip().splitlines():
        owner, _, names = line.partition(":")
        value = found(owner)
        known = set(dir(value)) | set(getattr(value, "__dataclass_fields__", ()))
        missing += [f"{owner}.{name}" for name in names.split() if name not in known]
    assert missing == []


def test_progress_means_the_same_everywhere():
    calls = {
        function
        for room in rooms().values()
        for function in map(vars(room).get, public_names(room))
        if inspect.isfunction(function) and "progress" in inspect.signature(function).parameters
    }
    assert len(calls) >= 16
    kinds = {inspect.signature(function).parameters["progress"].annotation for function in calls}
    assert kinds == {"Progress"}


if __name__ == "__main__":
    SNAPSHOT.write_text(listed(), encoding="utf-8")
    sys.stdout.write(f"{SNAPSHOT.name} is written\n")
