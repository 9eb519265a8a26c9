"""Names of methods and attributes of a robot in other programs, and their replacements."""

from __future__ import annotations

REPLACEMENTS = {
    "fkine": "rm.dgm(robot, q)",
    "fkine_all": "rm.link_poses(robot, q)",
    "forward_kinematics": "rm.dgm(robot, q)",
    "jacob0": "rm.jacobian(robot, q)",
    "jacobe": "rm.jacobian(robot, q, reference='local')",
    "jacobian": "rm.jacobian(robot, q)",
    "manipulability": "rm.manipulability(robot, q)",
    "ikine": "rm.igm(robot, T)",
    "ikine_a": "rm.igm(robot, T)",
    "ikine_LM": "rm.igm_numeric(robot, T)",
    "ik_LM": "rm.igm_numeric(robot, T)",
    "inverse_kinematics": "rm.igm(robot, T)",
    "rne": "rm.idm(robot, q, v, a)",
    "accel": "rm.ddm(robot, q, v, tau)",
    "fdyn": "rm.simulate(robot, q0, v0, control)",
    "inertia_matrix": "rm.mass_matrix(robot, q)",
    "coriolis": "rm.coriolis_matrix(robot, q, v)",
    "gravload": "rm.gravity_torque(robot, q)",
    "plot": "rm.viz.show(robot, q)",
    "teach": "rm.viz.jog(robot)",
    "animate": "rm.viz.animate(robot, q)",
    "payload": "rm.with_payload(robot, ...)",
    "q": "robot.configurations; a configuration is an argument of each function",
    "qz": "robot.configurations['zero']",
    "qr": "robot.configurations['ready'] where the robot has it",
    "dof": "robot.n",
    "links": "robot.table",
    "qlim": "robot.lower and robot.upper",
    "nq": "robot.n",
    "nv": "robot.n",
}  # fmt: skip
"""Calls or attributes here, by the name in another program."""


def no_attribute(kind: str, name: str) -> AttributeError:
    """The error for an attribute that a robot lacks, with the replacement where there is one."""
    hint = f"; here: {REPLACEMENTS[name]}" if name in REPLACEMENTS else ""
    return AttributeError(f"{kind!r} object has no attribute {name!r}{hint}.")
