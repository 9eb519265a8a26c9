"""Speed beside yardsticks that stand still: fails where ours has become slower than they have.

    python .ci/ratios.py [--write [--attempts 10]] [--only NAME ...] [--slowed NAME [--times 2]]

Each work of ours is timed in turns with something of other hands, NumPy, SciPy, Pinocchio, ruckig,
in this process. Only the ratio of the two medians is looked at, never a time: a machine that is
slow or busy is so for both. `benchmarks/results/ratios.json` keeps the median of such ratios and
their spread, the standard deviation of their logarithm. A ratio that is above the kept one by more
than `margin` of the spread, or below `FASTER` of it, is found again until there are `ATTEMPTS`,
and their median is judged: above fails, below is said. Every attempt after the first has a process
of its own, because where arrays and code come to lie decides up to a third of a ratio.
``--write`` writes the file anew, which another kind of processor may need: half of the attempts on
the machine as it is, half beside processes that keep it busy, so that the spread holds for both.
``--slowed`` does a work of ours more often than it says: the check has to fail then.
"""

# ruff: noqa: E402
import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import one_thread  # noqa: F401, before NumPy

# isort: split
import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.machine import load, machine
from benchmarks.measure import Contestant, in_turns, loop
from robotmodels import trajectories as tr

FILE = ROOT / "benchmarks" / "results" / "ratios.json"
ATTEMPTS, ROUNDS = 5, 7
FASTER, LEAST, SPREADS = 0.75, 1.4, 3.0  # another processor shifts ratios by a third
BURN = "import numpy as np; x = np.ones(10**6)\nwhile True: x = x * 0.5 + 0.5"
Run = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Pair:
    """Work of ours and what it is measured by; the counts say how often each does it in a run."""

    name: str
    yardstick: str
    ours: Run
    theirs: Run
    counts: tuple[int, int] = (1, 1)

    def ratio(self) -> float:
        """Ours to the yardstick, medians of rounds in which they take turns."""
        field = [
            Contestant("ours", self.ours, self.counts[0]),
            Contestant("theirs", self.theirs, self.counts[1]),
        ]
        found = in_turns(field, ROUNDS)
        return found["ours"].processor.median / found["theirs"].processor.median


@dataclass(frozen=True, slots=True)
class Kept:
    """What is known of a pair: its ratio, and the standard deviation of the ratio's logarithm."""

    ratio: float
    spread: float

    @property
    def margin(self) -> float:
        """How many times the ratio is still good."""
        return max(LEAST, math.exp(SPREADS * self.spread))

    def slower(self, found: float) -> bool:
        """Whether a ratio is above what spread explains."""
        return found > self.margin * self.ratio

    def faster(self, found: float) -> bool:
        """Whether a ratio is so much better that it should be kept."""
        return found < FASTER * self.ratio

    def alarm(self, times: float = 1.0) -> float:
        """Probability that a run calls a work slower that takes ``times`` as long."""
        away = math.log(self.margin / times) / max(self.spread, 1e-3)
        p = 0.5 * math.erfc(away / math.sqrt(2.0))
        # the first attempt, and then at least two of four
        return p * (1.0 - (1.0 - p) ** 4 - 4.0 * p * (1.0 - p) ** 3)


def pairs() -> Iterator[Pair]:
    """Every work that is watched."""
    yield from direct_models()
    yield from inverse_models()
    yield from motions()
    yield from estimations()


def direct_models() -> Iterator[Pair]:
    """Poses, Jacobians and dynamics beside Pinocchio."""
    model = rm.load("puma560").with_drive(None)
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-2.0, 2.0, (3, 20_000, 6))
    many, few, some = len(q), 500, (q[:500], v[:500], a[:500])
    pm, data = model.pin_model, model.pin_model.createData()
    tip = pm.getFrameId("tool", pin.FrameType.BODY)
    pool = pin.ModelPool(pm, 1)
    columns = [np.asfortranarray(x.T) for x in (q, v, a)]

    def pose(x: np.ndarray) -> np.ndarray:
        pin.forwardKinematics(pm, data, x)
        return pin.updateFramePlacement(pm, data, tip).homogeneous

    def jacobian(x: np.ndarray) -> np.ndarray:
        return pin.computeFrameJacobian(pm, data, x, tip, pin.LOCAL_WORLD_ALIGNED)

    def one(function: Callable) -> Callable:
        return lambda *x: function(pm, data, *x)

    def streamed() -> None:
        for _ in rm.torque_regressor_chunks(model, q, v, a, drive=False):
            pass

    poses, rnea = loop(pose, some[0]), loop(one(pin.rnea), *some)
    parallel = (lambda: pin.rneaInParallel(1, pool, *columns)), (many, many)
    batch = many, few
    yield Pair("pose, batch", "Pinocchio, loop", lambda: rm.dgm(model, q), poses, batch)
    yield Pair(
        "Jacobian, batch", "Pinocchio, loop", lambda: rm.jacobian(model, q),
        loop(jacobian, some[0]), batch,
    )  # fmt: skip
    yield Pair(
        "dgm, one call", "Pinocchio, one call", loop(lambda x: rm.dgm(model, x), some[0]), poses
    )
    yield Pair(
        "idm, one call", "Pinocchio, one call", loop(lambda *x: rm.idm(model, *x), *some), rnea
    )
    yield Pair("idm, batch", "rneaInParallel", lambda: rm.idm(model, q, v, a), *parallel)
    yield Pair("ddm, batch", "rneaInParallel", lambda: rm.ddm(model, q, v, a), *parallel)
    yield Pair("mass matrix, batch", "rneaInParallel", lambda: rm.mass_matrix(model, q), *parallel)
    regress = loop(one(pin.computeJointTorqueRegressor), *some)
    yield Pair("torque regressor, streamed", "Pinocchio, loop", streamed, regress, batch)


def inverse_models() -> Iterator[Pair]:
    """Velocities and postures beside LAPACK through NumPy."""
    rng = np.random.default_rng(1)
    model = rm.load("puma560")
    q = rng.uniform(-2.0, 2.0, (5000, 6))
    twist, J = rng.normal(size=(5000, 6)), rm.jacobian(model, q)
    svd = "LAPACK's SVD, batch of 6 x 6"

    def decompose() -> object:
        return np.linalg.svd(J[:2000])

    def decompose_each() -> object:
        return [np.linalg.svd(x) for x in J[:200]]

    yield Pair("ikm, batch", svd, lambda: rm.ikm(model, q, twist), decompose, (5000, 2000))
    for name in ("puma560", "ur5e"):
        arm = rm.load(name)
        T = rm.dgm(arm, q)
        yield Pair(
            f"igm, batch, {name}", svd, lambda m=arm, x=T: rm.igm(m, x), decompose, (5000, 2000)
        )
        each = loop(lambda x, m=arm: rm.igm(m, x), T[:200])
        yield Pair(f"igm, one pose, {name}", "NumPy's SVD of one 6 x 6", each, decompose_each)
    T = rm.dgm(model, q[:500])
    yield Pair(
        "igm_numeric, batch", svd, lambda x=T: rm.igm_numeric(model, x), decompose, (500, 2000)
    )  # fmt: skip
    general = rm.load("crx10ia")
    T = rm.dgm(general, q[:100])
    pencil = rng.normal(size=(50, 24, 24))
    yield Pair(
        "igm, general 6R, batch", "LAPACK's eigenvalues, batch of 24 x 24",
        lambda x=T: rm.igm(general, x), lambda: np.linalg.eigvals(pencil), (100, 50),
    )  # fmt: skip


def motions() -> Iterator[Pair]:
    """Trajectories beside ruckig and SciPy."""
    import ruckig
    from scipy.interpolate import CubicSpline

    rng = np.random.default_rng(2)
    q0, q1 = rng.uniform(-1.5, 1.5, (2, 30, 7))
    v0 = rng.uniform(-0.3, 0.3, (30, 7))
    limits = tr.MotionLimits(1.0, 2.0, 10.0)

    def ours() -> None:
        for states in zip(q0, q1, v0, strict=True):
            tr.jerk_limited(
                *states[:2], limits=limits, v0=states[2],
                synchronisation=tr.Synchronisation.SAME_TIME,
            )  # fmt: skip

    def bare() -> None:
        for start, end, speed in zip(q0, q1, v0, strict=True):
            given = ruckig.InputParameter(7)
            given.current_position, given.target_position = start, end
            given.current_velocity, given.target_velocity = speed, np.zeros(7)
            given.current_acceleration, given.target_acceleration = np.zeros(7), np.zeros(7)
            given.max_velocity, given.max_acceleration = np.full(7, 1.0), np.full(7, 2.0)
            given.max_jerk = np.full(7, 10.0)
            ruckig.Ruckig(7).calculate(given, ruckig.Trajectory(7))

    yield Pair("jerk-limited plan", "ruckig, bare", ours, bare)
    points = rng.uniform(-1.5, 1.5, (20, 7))
    motion = tr.cubic_spline(points, limits=tr.MotionLimits(1.0, 2.0))
    spline = CubicSpline(np.linspace(0.0, motion.duration, 20), points)
    t = np.linspace(0.0, motion.duration, 10_000)
    yield Pair(
        "spline, evaluated", "SciPy's CubicSpline", lambda: motion.at(t),
        lambda: [spline(t, k) for k in range(4)],
    )  # fmt: skip


def estimations() -> Iterator[Pair]:
    """Parameters beside LAPACK's least squares."""
    from robotmodels.calibration import Pose, fit
    from robotmodels.identification import fit as identify
    from robotmodels.logs import Log

    rng = np.random.default_rng(3)
    tall, short = rng.normal(size=(6000, 60)), rng.normal(size=(600, 30))
    solve = "LAPACK's least squares, 6000 x 60"
    model = rm.load("rx90")
    yield Pair(
        "base parameters, by rules", "LAPACK's least squares, 600 x 30",
        lambda: rm.base_parameters(model), lambda: np.linalg.lstsq(short, short[:, 0]),
    )  # fmt: skip
    motion = tuple(rng.uniform(-2.0, 2.0, (3, 2000, 6)))
    yield Pair(
        "base parameters, by numbers", solve,
        lambda: rm.base_parameters(model, "numeric", motion=motion),
        lambda: np.linalg.lstsq(tall, tall[:, 0]),
    )  # fmt: skip
    t = 1e-3 * np.arange(10_000)
    w = 2.0 * np.pi * 0.1 * np.arange(1, 6)
    A, s, c = 0.4 * rng.normal(size=(6, 5)), np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q, v, a = s @ A.T, (c * w) @ A.T, -(s * w**2) @ A.T
    tau = rm.idm(model, q, v, a) + 3.0 * v + 2.0 * np.sign(v) + 0.5 * a
    log = Log(1e-3, q + 1e-5 * rng.normal(size=q.shape), tau + 0.05 * rng.normal(size=q.shape))
    yield Pair(
        "identification, 1e4 samples", solve, lambda: identify(model, log),
        lambda: np.linalg.lstsq(tall, tall[:, 0]),
    )  # fmt: skip
    arm = rm.load("ur10e")
    q = rng.uniform(-2.5, 2.5, (100, 6))
    T = rm.dgm(arm, q)
    T[:, :3, 3] += 1e-4 * rng.normal(size=(100, 3))
    yield Pair(
        "calibration, 100 poses", solve, lambda: fit(arm, Pose(q, T), folds=0, held_out=0),
        lambda: np.linalg.lstsq(tall, tall[:, 0]),
    )  # fmt: skip


def checked(pair: Pair, kept: Kept, given: list[str]) -> tuple[float, int]:
    """The ratio, and of how many attempts it is the median."""
    found = [pair.ratio()]
    if kept.slower(found[0]) or kept.faster(found[0]):
        found += [
            in_new_process("--only", pair.name, *given)[pair.name] for _ in range(ATTEMPTS - 1)
        ]
    return float(np.median(found)), len(found)


def in_new_process(*given: str) -> dict[str, float]:
    """The ratios, found by a process of their own."""
    command = [sys.executable, __file__, "--bare", *given]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def slowed(pair: Pair, times: int) -> Pair:
    """With work of ours that is done several times."""

    def run() -> None:
        for _ in range(times):
            pair.ours()

    return replace(pair, ours=run)


@contextmanager
def others_at_work() -> Iterator[None]:
    """A process for each core that keeps it busy."""
    count = os.cpu_count() or 1
    busy = [subprocess.Popen([sys.executable, "-c", BURN]) for _ in range(count)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def write(attempts: int) -> None:
    """Keep the ratios of this machine and their spread."""
    about = machine(["ruckig"])
    runs = [in_new_process() for _ in range(attempts // 2)]
    with others_at_work():
        runs += [in_new_process() for _ in range(attempts - attempts // 2)]
    told = {}
    for name in runs[0]:
        found = np.array([run[name] for run in runs])
        told[name] = Kept(float(np.median(found)), float(np.std(np.log(found))))
        print(f"{name:28} {told[name].ratio:9.3f}  {rates(told[name])}", flush=True)
    keep(about, told, attempts)


def keep(about: dict[str, str], told: dict[str, Kept], attempts: int) -> None:
    """Write the file, and say how well it tells what is slow."""
    pairs_kept = {name: asdict(kept) for name, kept in told.items()}
    text = json.dumps({"machine": about, "attempts": attempts, "pairs": pairs_kept}, indent=2)
    FILE.write_text(text + "\n", encoding="utf-8")
    print(summary(told))


def rates(kept: Kept) -> str:
    """Margin, and what it sees."""
    return (
        f"spread {kept.spread:.3f}, margin {kept.margin:.2f}, sees 1.5 x in {kept.alarm(1.5):.0%}, "
        f"2 x in {kept.alarm(2.0):.1%}"
    )


def summary(told: dict[str, Kept]) -> str:
    """False alarms of a run, and the least that is seen of a work twice as slow."""
    false = 1.0 - math.prod(1.0 - kept.alarm() for kept in told.values())
    seen = [kept.alarm(2.0) for kept in told.values()]
    return (
        f"by their spreads: {false:.0e} false alarms a run; a work twice as slow is seen in "
        f"{min(seen):.0%} to {max(seen):.0%} of the runs, of all works {np.mean(seen):.1%}"
    )


def main() -> None:
    """Compare, print the table, end with 1 where something became slow."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="keep the ratios of this machine")
    parser.add_argument("--only", nargs="+", default=None, metavar="NAME")
    parser.add_argument("--slowed", metavar="NAME", help="do this work of ours more often")
    parser.add_argument("--times", type=int, default=2, help="how often, with --slowed")
    parser.add_argument("--attempts", type=int, default=10, help="processes, with --write")
    parser.add_argument(
        "--bare", action="store_true", help="print the ratios as JSON, no judgement"
    )
    given = parser.parse_args()
    if given.write:
        write(given.attempts)
        return
    again = [] if given.slowed is None else ["--slowed", given.slowed, "--times", str(given.times)]
    watched = (slowed(pair, given.times) if given.slowed == pair.name else pair for pair in pairs())
    if given.bare:
        wanted = (pair for pair in watched if given.only is None or pair.name in given.only)
        print(json.dumps({pair.name: pair.ratio() for pair in wanted}))
        return
    start = time.perf_counter()
    told = json.loads(FILE.read_text(encoding="utf-8"))["pairs"]
    kept = {name: Kept(**known) for name, known in told.items()}
    print(f"{load()}; ratios to yardsticks. {summary(kept)}")
    slow, fast, seen = [], [], set()
    for pair in watched:
        seen.add(pair.name)
        if given.only is not None and pair.name not in given.only:
            continue
        if pair.name not in kept:
            sys.exit(f"{FILE.name} has no ratio of {pair.name!r}: .ci/ratios.py --write adds it.")
        known = kept[pair.name]
        found, attempts = checked(pair, known, again)
        if known.slower(found):
            slow.append(pair.name)
        if known.faster(found):
            fast.append(pair.name)
        print(
            f"{pair.name:28} {found:9.3f}  kept {known.ratio:9.3f}  "
            f"{found / known.ratio:5.2f} x, at most {known.margin:.2f}  "
            f"{'SLOWER  ' if known.slower(found) else ''}"
            f"{pair.yardstick}{f', median of {attempts}' if attempts > 1 else ''}",
            flush=True,
        )
        if given.only is not None and seen.issuperset(given.only):
            break
    gone = sorted((set(kept) if given.only is None else set(given.only)) - seen)
    if gone:
        sys.exit(f"{FILE.name} or --only names what is not measured: {', '.join(gone)}.")
    if fast:
        print(f"faster than {FASTER:g} of what is kept, --write keeps it: {', '.join(fast)}")
    print(f"{time.perf_counter() - start:.0f} s")
    if slow:
        sys.exit(f"slower than it was, beside its yardstick: {', '.join(slow)}")


if __name__ == "__main__":
    main()
