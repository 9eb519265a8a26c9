"""pybotics at work in an interpreter of its own, a task at a time: see `foreign.py`.

Needs pybotics and nothing of this project. Tasks: ``["calibrate", COUNT]``, as many positions.
"""

import json
import sys
from importlib.metadata import PackageNotFoundError, version

try:
    READY = {"ready": version("pybotics")}
except PackageNotFoundError as error:
    READY = {"skipped": f"pybotics is not installed ({error})"}


def main():
    """Answer until there is nothing more to do."""
    print(json.dumps(READY), flush=True)
    if "ready" not in READY:
        return
    from calibration_pybotics import fit

    for line in sys.stdin:
        _, count = json.loads(line)
        said = fit(int(count))
        parameters, position = said["parameters"][0], 1e3 * said["position"]
        note = f"{parameters} parameters of rank {said['rank']}, no angles, {position:.3f} mm"
        answer = {"processor": said["processor"], "clock": said["clock"], "note": note}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
