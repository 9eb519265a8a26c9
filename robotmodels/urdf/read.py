"""URDF in: any fixed-base tree of revolute, continuous, prismatic and fixed joints becomes parts.

The frames are placed by `robotmodels.khalil_frames`; everything that was given in link frames
(inertia, shapes, tools) is moved to them, and the joint variables keep their sign and zero.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from .. import se3
from ..drive import DriveParameters, Transmission
from ..errors import FrameNotFoundError, InvalidValueError, UrdfError
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..khalil_frames import JointAxis, khalil_frames
from ..visual import Visual
from .meshes import MeshFinder
from .parts import TOOL, NamedFrame, RobotParts, UrdfSource
from .tip import default_tip
from .tree import MOVING_TYPES, OTHER_TYPES, UrdfJoint, UrdfTree, parse_urdf


def read_urdf(
    path_or_text: str | Path,
    base_link: str | None = None,
    tip_link: str | None = None,
    package_dirs: Iterable[str | Path] | str | Path = (),
    dynamics: bool = False,
    mimic: bool = False,
) -> RobotParts:
    """Read a URDF and describe it by a Khalil-Kleinfinger table.

    Parameters
    ----------
    path_or_text, base_link, tip_link, package_dirs, dynamics, mimic
        As for `RobotModel.from_urdf`; a text is recognised by its ``<``.

    Returns
    -------
    RobotParts
        Table, base, tool, inertia, limits, named frames, shapes and notes.
    """
    text, folder = _text_of(path_or_text)
    tree = parse_urdf(text, MeshFinder.of(package_dirs, folder))
    for link in (base_link, tip_link):
        if link is not None and (not isinstance(link, str) or link not in tree.links):
            raise FrameNotFoundError("link", link, tree.links)
    world = base_link or tree.root
    kept = None if tip_link is None else _chain(tree, world, tip_link)
    joints: list[UrdfJoint] = []
    axes: list[JointAxis] = []
    notes: list[str] = []
    placed = [NamedFrame(world, 0, np.eye(4), False)]
    _walk(tree, placed[0], kept, joints, axes, placed, notes)
    if not joints:
        raise UrdfError(
            f"no joint moves between {world!r} and "
            f"{repr(tip_link) if tip_link else 'the leaves'}: there is nothing to model. Choose "
            "base_link and tip_link on both sides of a moving joint."
        )
    frames = khalil_frames(axes)
    sigma = [axis.sigma for axis in axes]
    table = DHTable(
        antecedent=np.array([axis.antecedent for axis in axes]),
        sigma=np.array(sigma),
        mu=np.array([0 if mimic and joint.mimic else 1 for joint in joints]),
        gamma=frames.gamma, b=frames.b, beta=frames.beta, alpha=frames.alpha, d=frames.d,
        theta=frames.theta, r=frames.r,
        names=tuple(joint.name for joint in joints),
        lower=np.array([joint.lower for joint in joints]),
        upper=np.array([joint.upper for joint in joints]),
        velocity=np.array([joint.velocity for joint in joints]),
        effort=np.array([joint.effort for joint in joints]),
    )  # fmt: skip
    # pose of the link moved by joint j (or of the base link) in R_j (or R_0)
    links = np.concatenate((se3.inverse(frames.base)[None], frames.link_poses))
    named = tuple(NamedFrame(p.name, p.parent, links[p.parent] @ p.pose, p.merged) for p in placed)
    visuals = tuple(
        Visual(frame.parent, frame.pose @ v.pose, v.shape, v.color)
        for frame in named
        for v in tree.links[frame.name].visuals
    )
    notes += [
        f"joint {joint.name!r} mimics {joint.mimic[0]!r}, which the text does not define."
        for joint in joints
        if joint.mimic and joint.mimic[0] not in tree.joints
    ]
    if not mimic:
        notes += [
            f"joint {joint.name!r} mimics {joint.mimic[0]!r} and moves by itself here; read with "
            "mimic=True to couple them."
            for joint in joints
            if joint.mimic and joint.mimic[0] in tree.joints
        ]
    if tip_link is None:
        tip_frame, beyond = default_tip(tree, table.names, table.antecedent.tolist(), named)
        leaves = set(range(1, table.f + 1)) - set(table.antecedent.tolist())
        notes += _tip_notes(tip_frame.name, beyond, len(leaves))
    else:
        tip_frame = next(frame for frame in named if frame.name == tip_link)
    zeros = np.zeros(len(joints))
    return RobotParts(
        name=tree.name,
        table=table,
        base=frames.base,
        tool=tip_frame.pose,
        tip=tip_frame.parent,
        inertia=_inertia(tree, named, len(joints)),
        drive=DriveParameters(
            Fv=[joint.damping for joint in joints] if dynamics else zeros,
            Fc=[joint.friction for joint in joints] if dynamics else zeros,
        ),
        transmission=_mimicry(joints) if mimic else None,
        frames=named,
        visuals=visuals,
        notes=tuple(notes),
        source=UrdfSource(text, base_link, tip_link, tip_frame.name),
    )


def _text_of(source: str | Path) -> tuple[str, Path | None]:
    if isinstance(source, str) and not source.strip():
        raise UrdfError("expected a path or the text of a URDF, got an empty text.")
    if isinstance(source, str) and "<" in source:
        return source, None
    if not isinstance(source, (str, Path)):
        raise UrdfError(f"expected a path or the text of a URDF, got {type(source).__name__}.")
    path = Path(source)
    if path.name.endswith(".xacro"):
        raise UrdfError(
            f"{path.name} is a xacro file. Expand it first: `xacro {path.name} > robot.urdf` "
            "(Python packages xacro or xacrodoc)."
        )
    try:
        return path.read_text(encoding="utf-8-sig"), path.resolve().parent
    except UnicodeDecodeError as error:
        raise UrdfError(f"{path}: not UTF-8 text ({error.reason}).") from None
    except (OSError, ValueError) as error:  # the latter for a zero character in the path
        reason = getattr(error, "strerror", None) or error
        raise UrdfError(
            f"cannot read {str(path)!r}: {reason}. Give the path of a .urdf file, or its text."
        ) from None


def _chain(tree: UrdfTree, base_link: str, tip_link: str) -> set[str]:
    """Names of the joints between two links."""
    chain: set[str] = set()
    link = tip_link
    while link != base_link:
        joint = tree.parent_joint(link)
        if joint is None:
            below = [base_link]
            for name in below:
                below += [j.child for j in tree.children(name)]
            raise FrameNotFoundError(
                f"link below the base link {base_link!r} that is called", tip_link, below[1:]
            )
        chain.add(joint.name)
        link = joint.parent
    return chain


def _walk(
    tree: UrdfTree,
    start: NamedFrame,
    kept: set[str] | None,
    joints: list[UrdfJoint],
    axes: list[JointAxis],
    placed: list[NamedFrame],
    notes: list[str],
) -> None:
    """Number the moving joints depth first, and place every link in the link that moves it."""
    stack = [(joint, start) for joint in reversed(tree.children(start.name))]
    while stack:
        joint, parent = stack.pop()
        left_out = kept is not None and joint.name not in kept
        if joint.kind not in (*MOVING_TYPES, "fixed", *(OTHER_TYPES if left_out else ())):
            raise UrdfError(
                f"joint {joint.name!r} is of type {joint.kind!r}; a table describes revolute, "
                "continuous, prismatic and fixed joints. If the arm hangs below it, give the link "
                f"under it ({joint.child!r}) as base_link; choose tip_link to leave out a branch."
            )
        pose = parent.pose @ joint.origin
        moves = joint.kind in MOVING_TYPES and not left_out
        if moves:
            sigma = 1 if joint.kind == "prismatic" else 0
            axes.append(JointAxis(parent.parent, sigma, pose, joint.axis))
            joints.append(joint)
            link = NamedFrame(joint.child, len(joints), np.eye(4), False)
        else:
            link = NamedFrame(joint.child, parent.parent, pose, True)
            how = "fixed" if joint.kind == "fixed" else "locked at zero"
            owner = joints[parent.parent - 1].name if parent.parent else "the base"
            notes.append(
                f"link {joint.child!r} ({how} by joint {joint.name!r}) is merged into the link "
                f"of {owner}."
            )
        placed.append(link)
        stack += [(j, link) for j in reversed(tree.children(joint.child))]


def _tip_notes(tip: str, beyond: int, branches: int) -> list[str]:
    """Notes on the link of the tool, if there was a choice."""
    if tip == TOOL or (branches == 1 and not beyond):
        return []
    end = f", the end of the last of {branches} branches" if branches > 1 else ""
    if beyond:
        end += f", before {beyond} moving joint{'s' * (beyond > 1)} of a hand or gripper"
    return [f"the tool is link {tip!r}{end}. Use tip_link= or with_tool to choose another."]


def _inertia(tree: UrdfTree, named: tuple[NamedFrame, ...], f: int) -> InertialParameters:
    """Each link's inertia moved to its frame; merged links add to the one that carries them."""
    carried = [frame for frame in named if frame.parent > 0]
    links = [tree.links[frame.name] for frame in carried]
    total = np.zeros((f, 10))
    if not links:
        return InertialParameters(total)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # refused below
            own = InertialParameters.from_com(
                [link.mass for link in links],
                [link.com for link in links],
                [link.inertia for link in links],
            ).moved(np.array([frame.pose for frame in carried]))
            np.add.at(total, [frame.parent - 1 for frame in carried], own.values)
        return InertialParameters(total)
    except InvalidValueError:  # it does not name the link
        largest = max(links, key=lambda link: max(abs(link.mass), *map(abs, link.com)))
        raise UrdfError(
            f"link {largest.name!r}: its mass, its centre of mass or its distance from its joint "
            "is so large that its inertia there overflows."
        ) from None


def _mimicry(joints: list[UrdfJoint]) -> Transmission | None:
    """q = K q_c + q_0 with the mimicking joints' own columns zero; None if nothing mimics."""
    numbers = {joint.name: i for i, joint in enumerate(joints)}
    K, q0 = np.eye(len(joints)), np.zeros(len(joints))
    followers = [joint for joint in joints if joint.mimic]
    for joint in followers:
        master, gain, offset = joint.mimic or ("", 1.0, 0.0)
        chain = [joint.name]
        # a master may itself mimic another joint: follow it to one that does not
        while master in numbers and joints[numbers[master]].mimic:
            if master in chain:
                raise UrdfError(f"the joints {', '.join(chain)} mimic each other in a circle.")
            chain.append(master)
            above, factor, shift = joints[numbers[master]].mimic or ("", 1.0, 0.0)
            master, gain, offset = above, gain * factor, offset + gain * shift
        if master not in numbers:
            raise UrdfError(
                f"joint {joint.name!r} mimics {master!r}, which is not a moving joint of this "
                "part of the robot; read it with mimic=False."
            )
        i = numbers[joint.name]
        K[i] = 0.0
        K[i, numbers[master]] = gain
        q0[i] = offset
    return Transmission(K, q0) if followers else None
