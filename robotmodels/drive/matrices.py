"""The drive terms of all joints together, coupled motors included, ready for many samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from .parameters import DriveParameters
from .transmission import Transmission


@dataclass(frozen=True, slots=True, eq=False)
class DriveMatrices:
    """Drive terms of all joints together, coupled motors included.

    ``tau_drive = rotor a + viscous v + Fc sign(v) + W^T (Fcm sign(W v)) + offset``

    Parameters
    ----------
    rotor, viscous : ndarray, shape (n, n)
        Symmetric; diagonal unless motors are coupled.
    coulomb, offset : ndarray, shape (n,)
        Of the joints.
    coupling : ndarray, shape (k, n)
        ``W``, a row for each coupled motor.
    coupled_coulomb : ndarray, shape (k,)
        ``Fcm`` of the coupled motors.
    rows : tuple of (Ia, Fv, Fc, offset)
        The same numbers joint by joint; empty if motors are coupled.

    Examples
    --------
    >>> drive_matrices(DriveParameters(Ia=[1.0, 2.0]), None).rotor
    array([[1., 0.],
           [0., 2.]])
    """

    rotor: Array
    viscous: Array
    coulomb: Array
    offset: Array
    coupling: Array
    coupled_coulomb: Array
    rows: tuple[tuple[float, float, float, float], ...]

    def torque(self, v: Array, a: Array | None) -> Array:
        """Torque the drives take up.

        Parameters
        ----------
        v : ndarray, shape (..., n)
            Joint velocities.
        a : ndarray, shape (..., n), or None
            Joint accelerations; None leaves the rotor term out.

        Returns
        -------
        ndarray, shape (..., n)
            N m or N.

        Examples
        --------
        >>> drive_matrices(DriveParameters(Fc=[2.0]), None).torque(np.array([-1.0]), None)
        array([-2.])
        """
        if self.rows and a is not None and v.ndim == a.ndim == 1:
            # one sample of uncoupled drives: plain floats take a third of small arrays' time
            return np.array([
                Ia * acc + Fv * vel + offset + (Fc if vel > 0.0 else -Fc if vel < 0.0 else 0.0)
                for (Ia, Fv, Fc, offset), vel, acc in zip(
                    self.rows, v.tolist(), a.tolist(), strict=True
                )
            ])  # fmt: skip
        if self.rows and a is not None and v.ndim == a.ndim == 2 and v.shape == a.shape:
            # many samples of them: one pass through the arrays instead of seven
            from ..kernels.drive_torques import drive_torques

            Ia, Fv, Fc, offset = np.array(self.rows).T.copy()
            out = np.empty(v.shape)
            v, a = np.ascontiguousarray(v), np.ascontiguousarray(a)
            drive_torques(v, a, Ia, Fv, Fc, offset, out)
            return out
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
    """Gather drive and coupling terms, see `Transmission` for the formula.

    Parameters
    ----------
    drive : DriveParameters
        Of the n joints.
    transmission : Transmission or None
        With the terms of coupled motors.

    Returns
    -------
    DriveMatrices
        Ready to be applied to many samples.

    Examples
    --------
    >>> wrist = Transmission([[1, 0], [-1, 1]], Iam=[0, 0.1])
    >>> drive_matrices(DriveParameters.zeros(2), wrist).rotor
    array([[0. , 0.1],
           [0.1, 0. ]])
    """
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
