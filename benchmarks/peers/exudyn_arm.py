"""Two flexible links in Exudyn: floating frames with given modes, a simulated second."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import exudyn as exu  # pyright: ignore[reportMissingImports]
import numpy as np
from exudyn import itemInterface  # pyright: ignore[reportMissingImports]
from exudyn.FEM import (  # pyright: ignore[reportMissingImports]
    FEMinterface,
    ObjectFFRFreducedOrderInterface,
)
from scipy.sparse import csr_matrix, diags


def two_links(given: Mapping[str, np.ndarray]) -> Callable[[int], np.ndarray]:
    """A function of the number of steps that gives the end of the second link after a second.

    From points (4 k, 3), their masses, shapes (4 k, 3, m) and frequencies (m,) of a link, gravity.
    """
    X, mass, Phi = given["points"], np.repeat(given["masses"], 3), given["shapes"]
    Phi = Phi.reshape(len(mass), -1)
    left = mass[:, None] * Phi @ np.linalg.inv(Phi.T @ (mass[:, None] * Phi))
    modal = Phi.T @ (mass[:, None] * Phi) @ np.diag(given["frequencies"] ** 2)
    fem = FEMinterface()
    fem.nodes = {"Position": X}
    fem.massMatrix = csr_matrix(diags(mass))
    fem.stiffnessMatrix = csr_matrix(left @ modal @ left.T)
    fem.modeBasis = {"matrix": Phi, "type": "NormalModes"}
    reduced = ObjectFFRFreducedOrderInterface(fem)
    system = exu.SystemContainer()
    arm = system.AddSystem()
    place, end = [0.0, 0.0, 0.0], [len(X) - 4 + k for k in range(4)]
    before = arm.AddMarker(
        itemInterface.MarkerBodyRigid(bodyNumber=arm.AddObject(itemInterface.ObjectGround()))
    )
    for _ in range(2):
        body = reduced.AddObjectFFRFreducedOrder(
            arm, positionRef=place, gravity=given["gravity"].tolist()
        )
        root = arm.AddMarker(itemInterface.MarkerNodeRigid(nodeNumber=body["nRigidBody"]))
        arm.AddObject(
            itemInterface.GenericJoint(
                markerNumbers=[before, root], constrainedAxes=[1, 1, 1, 1, 1, 0]
            )
        )
        before = arm.AddMarker(
            itemInterface.MarkerSuperElementRigid(
                bodyNumber=body["oFFRFreducedOrder"], meshNodeNumbers=end,
                weightingFactors=[0.25] * 4,
            )
        )  # fmt: skip
        place = [place[0] + X[-1, 0], 0.0, 0.0]
    sensor = arm.AddSensor(
        itemInterface.SensorMarker(
            markerNumber=before, storeInternal=True,
            outputVariableType=exu.OutputVariableType.Position,
        )
    )  # fmt: skip

    def run(steps: int) -> np.ndarray:
        arm.Assemble()
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = 1.0
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.useModifiedNewton = True
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = 1.0
        arm.SolveDynamic(settings)
        return np.array(arm.GetSensorValues(sensor))

    return run
