"""Drive terms of all joints as matrices, coupled motors included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from .parameters import DriveParameters
from .transmission import Transmission


@dataclass(frozen=True, slots=True, eq=False)
class DriveMatrices:
    """Drive terms of n joints and k coupled motors, see `Transmission` for the formula.

    ``rotor a + viscous v + Fc sign(v) + W^T (Fcm sign(W v)) + offset``
    """

    rotor: Array  # (n, n), symmetric; diagonal unless motors are coupled
    viscous: Array
    coulomb: Array  # (n,)
    offset: Array
    coupling: Array  # W (k, n), a row for each coupled motor
    coupled_coulomb: Array  # (k,)
    rows: tuple[tuple[float, float, float, float], ...]  # Ia, Fv, Fc, offset if none is coupled

    def torque(self, v: Array, a: Array | None) -> Array:
        """Torque of the drives at v, a (..., n); None for a leaves the rotor term out."""
        if self.rows and a is not None and v.ndim == a.ndim == 1:
            # one sample of uncoupled drives: floats are three times faster than small arrays
            joints = zip(self.rows, v.tolist(), a.tolist(), strict=True)
            torques = [
                Ia * acc + Fv * vel + offset + (Fc if vel > 0.0 else -Fc if vel < 0.0 else 0.0)
                for (Ia, Fv, Fc, offset), vel, acc in joints
            ]
            return np.array(torques)
        tau = np.sign(v)
        tau *= self.coulomb
        tau += v.dot(self.viscous)
        tau += self.offset
        if a is not None:
            tau = tau + a.dot(self.rotor)
        if self.coupling.size:
            W = self.coupling
            tau = tau + (np.sign(v @ W.T) * self.coupled_coulomb) @ W
        return tau


def drive_matrices(drive: DriveParameters, transmission: Transmission | None) -> DriveMatrices:
    """Gather the drive terms of n joints with those of coupled motors."""
    rotor, viscous = np.diag(drive.Ia), np.diag(drive.Fv)
    coupling, coulomb = np.zeros((0, drive.n)), np.zeros(0)
    if transmission is not None and transmission.coupled_motors:
        motors = np.array(transmission.coupled_motors) - 1
        coupling, coulomb = transmission.weights[motors], transmission.Fcm[motors]
        cross = np.einsum("mi,mj->mij", coupling, coupling)
        cross[:, range(drive.n), range(drive.n)] = 0.0
        rotor = rotor + np.einsum("m,mij->ij", transmission.Iam[motors], cross)
        viscous = viscous + np.einsum("m,mij->ij", transmission.Fvm[motors], cross)
    columns = (drive.Ia, drive.Fv, drive.Fc, drive.offset)
    rows = () if len(coupling) else tuple(zip(*(c.tolist() for c in columns), strict=True))
    return DriveMatrices(rotor, viscous, drive.Fc, drive.offset, coupling, coulomb, rows)
