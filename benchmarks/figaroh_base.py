"""FIGAROH's regressor and base parameters of a robot, by its defaults.

Needs FIGAROH and nothing of this project: it also runs in an interpreter of its own.
"""

import warnings

import numpy as np
import pinocchio as pin

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from figaroh.identification import parameter
    from figaroh.tools import qrdecomposition, regressor


class Figaroh:
    """FIGAROH told a robot as Pinocchio's model, its rotor inertias and its friction."""

    def __init__(self, model: pin.Model, Ia, Fv, Fc) -> None:
        self.settings = {
            "has_friction": True, "has_actuator_inertia": True, "has_joint_offset": False,
            "act_idxv": list(range(model.nv)),
            "fv": [float(x) for x in Fv], "fs": [float(x) for x in Fc],
            "Ia": [float(x) for x in Ia],
        }  # fmt: skip
        self.robot = pin.RobotWrapper(model)
        self.values = parameter.get_standard_parameters(model)
        self.values |= parameter.add_standard_additional_parameters(model, self.settings)

    def stack(self, motion, drive: bool = True) -> np.ndarray:
        """The regressor of all samples."""
        config = regressor.RegressorConfig(has_friction=drive, has_actuator_inertia=drive)
        builder = regressor.RegressorBuilder(self.robot, config)
        return builder.build_basic_regressor(*motion, self.settings)

    def base(self, motion) -> tuple:
        """Regressor, columns without effect left out, double QR."""
        W = self.stack(motion)
        empty, names = regressor.get_index_eliminate(W, self.values)
        W = regressor.build_regressor_reduced(W, empty)
        found = qrdecomposition.QRDecomposer()
        found.double_decomposition(np.zeros(len(W)), W, names, self.values)
        return found, W, names

    def said(self, answer: tuple) -> str:
        """Rank, and how well the base parameters give the torques of all."""
        found, W, names = answer
        theta = np.array([self.values[name] for name in names])
        tau = W @ theta
        error = np.abs(W[:, found.base_indices] @ (found.M @ theta) - tau).max() / np.abs(tau).max()
        return f"rank {len(found.base_indices)}, torques kept to {error:.0e}"
