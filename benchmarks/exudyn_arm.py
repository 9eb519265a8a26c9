"""Exudyn's side of `bench_flexible`: a simulated second of two flexible links, as text in and out.

Reads points, masses, shapes and frequencies of a link, gravity and steps; each link is a floating
frame with these modes. Prints seconds of processor time and the end of the second link, for each
number of steps. It needs no package of this project, so that another interpreter runs it.
"""

import json
import sys
import time

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from scipy.sparse import csr_matrix, diags


def main() -> None:
    """Read, simulate, print."""
    given = {key: np.array(value) for key, value in json.load(sys.stdin).items()}
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
    found = []
    for steps in given["steps"].tolist():
        arm.Assemble()
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = 1.0
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.useModifiedNewton = True
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = 1.0
        started = time.process_time()
        arm.SolveDynamic(settings)
        found.append([time.process_time() - started, *arm.GetSensorValues(sensor)])
    print(json.dumps(found))


if __name__ == "__main__":
    main()
