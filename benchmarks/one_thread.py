"""One thread for everybody, and not by chance: import this before NumPy."""

import os

for _library in ("OPENBLAS", "OMP", "MKL", "NUMBA", "RAYON"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"
