"""The regressor of a motion, and how a function of it changes with the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._arrays import Array
from ...drive import DriveKind, Drives
from ...model import RobotModel
from ...regressors.columns import LINKS, chosen_columns, standard_blocks
from ...regressors.drives import couplings
from ...regressors.torque import fill_torques


class StackedRegressor:
    """Selected torque regressor columns over samples, with derivatives by the motion."""

    __slots__ = ("chosen", "model", "width")

    def __init__(
        self, model: RobotModel, names: Sequence[str], drive: Drives, width: Array | None = None
    ) -> None:
        self.model = model
        self.chosen = chosen_columns(standard_blocks(model, drive, None), names, model)
        self.width = width

    def matrix(self, q: Array, v: Array, a: Array) -> Array:
        """The columns, shape (N, n, c)."""
        W = np.empty((len(q), self.model.n, self.chosen.count))
        fill_torques(self.model, self.chosen, None, (q, v, a), W)
        if self.width is None:
            return W
        joints, columns = self._places(DriveKind.FC)
        W[:, joints, columns] = np.tanh(v / self.width)[:, joints]
        for column, row, width in self._coupled_friction():
            W[:, :, column] = np.tanh(v @ row / width)[:, None] * row
        return W

    def pulled_back(self, q: Array, v: Array, a: Array, G: Array) -> tuple[Array, Array, Array]:
        """Gradient of ``sum(G * matrix(q, v, a))`` by q, v and a.

        Shapes: q, v, a (N, n); G (N, n, c) -> of_q, of_v, of_a (N, n).
        """
        from ...kernels.regressor_gradient import regressor_gradients

        of_q, of_v, of_a = np.zeros(q.shape), np.zeros(q.shape), np.zeros(q.shape)
        regressor_gradients(
            q, v, a, *self.model.chain, self.model.gravity, self.chosen.places[LINKS],
            np.ascontiguousarray(G), of_q, of_v, of_a,
        )  # fmt: skip
        for kind, out in ((DriveKind.IA, of_a), (DriveKind.FV, of_v)):
            joints, columns = self._places(kind)
            out[:, joints] += G[:, joints, columns]
            if kind.coupling is not None and self.chosen.has(kind.coupling):
                self._pull_coupling(kind.coupling, G, out)
        if self.width is not None:
            joints, columns = self._places(DriveKind.FC)
            slope = (1.0 - np.tanh(v / self.width) ** 2) / self.width
            of_v[:, joints] += G[:, joints, columns] * slope[:, joints]
            for column, row, width in self._coupled_friction():
                slope = (1.0 - np.tanh(v @ row / width) ** 2) / width
                of_v += ((G[:, :, column] @ row) * slope)[:, None] * row
        return of_q, of_v, of_a

    def _pull_coupling(self, name: str, G: Array, out: Array) -> None:
        for motor, (_, cross) in enumerate(couplings(self.model)):
            if (column := self.chosen.column(name, motor)) >= 0:
                out += G[:, :, column] @ cross.T

    def _places(self, kind: DriveKind) -> tuple[np.ndarray, np.ndarray]:
        """Joints whose parameter of a kind has a column, and these columns."""
        place = self.chosen.places.get(kind.value)
        if place is None:
            place = np.empty(0, dtype=np.int64)
        joints = np.flatnonzero(place >= 0)
        return joints, place[joints]

    def _coupled_friction(self) -> list[tuple[int, Array, float]]:
        """Column, turns of the motor per joint and smoothing width of coupled dry friction."""
        assert self.width is not None
        return [
            (column, row, float(np.abs(row) @ self.width))
            for motor, (row, _) in enumerate(couplings(self.model))
            if (column := self.chosen.column("Fcm", motor)) >= 0
        ]
