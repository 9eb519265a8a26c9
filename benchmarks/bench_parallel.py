"""Parallel robots.

No package on the index lists all assembly modes of a hexapod; the elimination of E. Martyushev
(fkSGP, Python code) states 8.4 ms with errors up to 1.3e-7.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks.measure import Contestant
from benchmarks.works import OURS, Settings, Work, at_most
from robotmodels import parallel as pr

Array = NDArray[np.float64]
ROWS = 2000


def modes(settings: Settings) -> Iterator[Work]:
    """All assembly modes."""
    rng = np.random.default_rng(0)
    robot = pr.gough(*rng.normal(size=(2, 6, 3)))
    many = pr.igm(robot, robot.pose(rng.uniform(-1, 1, (20, 6)))).q[:, 0]
    goal = [at_most(25.0, "ms")]
    one = [Contestant(OURS, lambda: pr.assembly_modes(robot, many[0]))]
    yield Work("all modes of a 6-6, alone", "ms", one, goal)
    batch = [Contestant(OURS, lambda: pr.assembly_modes(robot, many), 20)]
    yield Work("all modes of a 6-6, batch", "ms", batch, goal)
    for kind in ("SSM", "TSSM", "MSSM"):
        special = pr.gough_symmetric(1.0, kind=kind)
        lengths = pr.igm(special, special.home).q[0]
        one = [Contestant(OURS, lambda r=special, x=lengths: pr.assembly_modes(r, x))]
        yield Work(f"all modes, {kind}", "ms", one, goal)
    planar = pr.planar_3rpr(*rng.normal(size=(2, 3, 2)))
    places = pr.igm(planar, planar.pose(rng.normal(size=(ROWS, 3)))).q[:, 0]
    polynomial = np.r_[1.0, rng.normal(size=6)]
    roots = Contestant("numpy.roots of a sextic", lambda: np.roots(polynomial), whole=False)
    for title, q, count in (("batch", places, ROWS), ("alone", places[0], 1)):
        ways = [Contestant(OURS, lambda x=q: pr.assembly_modes(planar, x), count), roots]
        yield Work(f"all modes of a 3-RPR, {title}", "us", ways, [at_most(50.0, "us")])


def models(settings: Settings) -> Iterator[Work]:
    """Iterative direct model and inverse Jacobian of a hexapod."""
    rng, hexapod = np.random.default_rng(0), pr.gough_symmetric(1.0)
    T = hexapod.pose(hexapod.coordinates(hexapod.home) + 0.2 * rng.uniform(-1, 1, (ROWS, 6)))
    q = pr.igm(hexapod, T).q[:, 0]
    ways = [Contestant(OURS, lambda: pr.dgm(hexapod, q), ROWS)]
    yield Work("hexapod, iterative direct model, batch", "us", ways, [at_most(15.0, "us")])
    ways = [Contestant(OURS, lambda: pr.inverse_jacobian(hexapod, T), ROWS)]
    yield Work("hexapod, inverse Jacobian, batch", "us", ways, [at_most(5.0, "us")])


WORKS = {"modes": modes, "platforms": models}
