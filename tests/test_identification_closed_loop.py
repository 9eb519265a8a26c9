"""Methods that simulate the controlled robot: exact on exact logs, unbiased on noisy ones."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from identification_fleet import odd_robots, raw, swinging, two_links

import robotmodels as rm
from robotmodels.drive import DriveParameters
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation.estimate import EstimateStatus
from robotmodels.identification import (
    Controller,
    Didim,
    Instrumental,
    Log,
    OutputError,
    Wls,
    equations,
    hausman_test,
    reduce_equations,
    simulated_log,
    tuned_controller,
)
from robotmodels.identification.closed_loop import method as method_module
from robotmodels.identification.closed_loop.loop import closed_loop, friction_rates
from robotmodels.identification.closed_loop.method import instrument_step
from robotmodels.identification.fit import _identifiable
from robotmodels.identification.forms import Block
from robotmodels.identification.signals import central_differences
from robotmodels.inertia import InertialParameters

ROBOTS = odd_robots()
KINDS = ("rx90", "prismatic", "tree", "coupled wrist", "fixed frame")


def other(arm, factor=1.2):
    """A robot of the same kind whose bodies are heavier, with less friction."""
    drive = {k: getattr(arm.drive, k) / factor for k in ("Ia", "Fv", "Fc", "offset")}
    out = arm.with_inertia(InertialParameters(factor * arm.inertia.values))
    return out.with_drive(DriveParameters(**drive))


def motion(arm, seconds, dt, seed=4):
    """References and their exact velocities."""
    return swinging(arm, seed, round(seconds / dt), dt, 4, 1.0 / 0.35, 1.2)[:2]


def recorded(kind, seconds=3.0, dt=2e-3, substeps=1):
    """A robot, its controller, its log without noise, and the width of its dry friction."""
    arm = ROBOTS[kind]
    q_ref, v_ref = motion(arm, seconds, dt)
    # tuned for another robot, so that the tracking errors are not small
    control = tuned_controller(other(arm), q_ref, 4.0, period=dt, feed_forward=False)
    width = dt / substeps * friction_rates(arm, q_ref).dry
    log = simulated_log(arm, control, q_ref, v_ref, dt, width=width, substeps=substeps)
    return arm, control, log, width


def problem(arm, log, width=0.0, decimation=1):
    """Equations and factors in the identifiable parameters, and the true values."""
    system = equations(rm.base_parameters(arm, drive=True), log, raw(log, decimation, width))
    system, factors, _, _ = _identifiable(system, reduce_equations(system))
    return system, factors, values_of(system, arm)


def values_of(system, arm):
    found = dict(zip(system.base.names, system.base.values(arm), strict=True))
    return np.array([found[name] for name in system.names])


def off(found, truth, factors):
    """Largest error relative to the value that would explain the whole torque."""
    R = np.vstack(factors.factors)
    size = np.linalg.norm(R[:, -1]) / np.linalg.norm(R[:, :-1], axis=0)
    return float((np.abs(found - truth) / np.maximum(size, np.abs(truth))).max())


# --- simulation -----------------------------------------------------------------------------------


def test_the_motion_is_that_of_simulate_and_steps_converge_with_order_four():
    arm = ROBOTS["rx90"]
    arm = arm.with_drive(replace(arm.drive, Fc=np.zeros(6)))
    q_ref, v_ref = motion(arm, 0.2, 1e-2)
    control = tuned_controller(arm, q_ref, 4.0, period=1e-2, feed_forward=False)
    logs = [simulated_log(arm, control, q_ref, v_ref, 1e-2, substeps=s) for s in (1, 2, 16)]
    t = 1e-2 * np.arange(len(q_ref))

    def law(time, q, v):
        return logs[2].tau[min(int(time / 1e-2 + 1e-9), len(t) - 1)]

    exact = rm.simulate(arm, q_ref[0], v_ref[0], law, t, breaks=t[1:-1], rtol=1e-11, atol=1e-12)
    errors = [float(np.abs(log.q - exact.q).max()) for log in logs]
    assert errors[2] < 1e-9
    assert errors[0] / errors[1] > 10.0


def test_controllers_hold_limit_and_integrate():
    arm = ROBOTS["rx90"]
    rest = np.zeros((400, 6))
    control = tuned_controller(arm, rest, 2.0, period=2e-3, feed_forward=False)
    start = np.vstack((rest[:1], rest[1:] + 0.2))
    log = simulated_log(arm, replace(control, period=8e-3), start, rest, 2e-3)
    held = log.tau.reshape(-1, 4, 6)
    assert (held == held[:, :1]).all()
    assert (np.diff(held[:, 0], axis=0) != 0.0).any()
    limited = replace(control, limit=0.3 * np.abs(log.tau).max(axis=0))
    low = simulated_log(arm, limited, start, rest, 2e-3)
    assert (np.abs(low.tau) <= limited.limit).all()
    assert (np.abs(low.tau) == limited.limit).any()
    fine = simulated_log(arm, replace(control, period=1e-3), start, rest, 2e-3)
    assert np.abs(fine.q - simulated_log(arm, control, start, rest, 2e-3).q).max() > 1e-6


# --- methods --------------------------------------------------------------------------------------


def test_a_step_of_instruments_is_the_instrumental_estimate(rng):
    """(Z^T W)^-1 Z^T y from any start, with s^2 (Z^T W)^-1 Z^T Z (W^T Z)^-1.

    The instruments differ much from the regressor, so that no product can stand for another.
    """
    N = 200
    W, Z = rng.normal(size=(N, 1, 3)), rng.normal(size=(N, 1, 3))
    W = 0.3 * W + 0.7 * Z @ rng.normal(size=(3, 3))
    y = W[:, 0] @ [1.0, -2.0, 3.0] + 0.01 * rng.normal(size=N)
    block = Block(np.arange(N) * 1.0, W, y[:, None], np.ones((N, 1), bool), np.ones((N, 1)))
    start, size = np.array([0.9, -2.1, 3.2]), np.array([1.0, 0.5, 2.0])
    found = instrument_step(("a", "b", "c"), start, lambda: [(Z, block)], size)
    z, w = Z[:, 0], W[:, 0]
    np.testing.assert_allclose(found.values, np.linalg.solve(z.T @ w, z.T @ y), rtol=1e-10)
    sigma = np.sqrt(((y - w @ start) ** 2).sum() / (N - 3))
    np.testing.assert_allclose(found.sigma, [sigma], rtol=1e-12)
    back = np.linalg.inv(z.T @ w)
    expected = sigma * np.sqrt(np.diag(back @ (z.T @ z) @ back.T))
    np.testing.assert_allclose(found.standard_errors, expected, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.nightly
def test_instruments_and_didim_recover_exact_parameters(kind):
    arm, control, log, width = recorded(kind)
    if kind == "prismatic":  # two recordings
        arrays = (log.q, log.tau, log.v, log.a, log.q_ref, log.v_ref)
        log = Log(log.dt, *(np.vstack((x, x)) for x in arrays), starts=(0, len(log)))
    system, factors, truth = problem(arm, log, width)
    start = values_of(system, other(arm))
    assert off(start, truth, factors) > 1e-3
    for method in (Instrumental, Didim):
        found = method(control, start, width=width, substeps=1).solve(system, factors)
        assert found.status is EstimateStatus.SOLVED
        assert off(found.values, truth, factors) < 1e-8
        assert found.details.strength > 0.9
    for one in (found, pickle.loads(pickle.dumps(found))):
        loop = one.details.loop
        arrays = one.values, one.details.iid_standard_errors, loop.width, loop.controller.kp
        assert not any(array.flags.writeable for array in arrays)


@pytest.mark.parametrize(
    ("kind", "output"),
    [("prismatic", "both"), pytest.param("tree", "torque", marks=pytest.mark.nightly)],
)
def test_output_error_recovers_exact_parameters(kind, output):
    arm, control, log, width = recorded(kind, 1.2, 4e-3, substeps=2)
    system, factors, truth = problem(arm, log, width)
    start = values_of(system, other(arm, 1.1))
    method = OutputError(control, start, width=width, substeps=2, output=output)
    found = method.solve(system, factors)
    assert found.status is EstimateStatus.SOLVED
    assert off(found.values, truth, factors) < 1e-8
    assert len(found.sigma) == arm.n * (2 if output == "both" else 1)


def test_a_simulation_that_diverges_has_a_status_and_no_numbers(monkeypatch):
    arm, control, log, width = recorded("prismatic", 1.0)
    system, factors, truth = problem(arm, log, width)
    wild = replace(control, kp=-50.0 * control.kp)
    for method, why in (
        (Instrumental(start=-truth), "not positive definite"),
        (Didim(start=-truth), "not positive definite"),
        (OutputError(start=-truth), "not positive definite"),
        (Instrumental(wild, start=truth), "it diverges"),
    ):
        found = method.solve(system, factors)
        assert found.status is EstimateStatus.UNSTABLE
        for numbers in (found.values, found.standard_errors, found.covariance, found.sigma):
            assert np.isnan(numbers).all()
        assert why in found.notes[-1]
    good = Instrumental(control, truth, width=width).solve(system, factors)
    assert np.isfinite(hausman_test(system, good).p)
    with pytest.raises(InvalidValueError, match="expected instrumental variables"):
        hausman_test(system, Wls().solve(system, factors))
    monkeypatch.setattr(method_module, "_SINGULAR", 1.0)  # the motion of `good` is refused
    for each in (found, good):
        verdict = hausman_test(system, each)
        assert np.isnan(verdict.p)
        assert not verdict.biased
        assert "not tested" in verdict.sentence


def test_a_log_without_references_or_controller_is_followed_with_a_note():
    arm, _, log, width = recorded("prismatic", 2.0)
    system, factors, truth = problem(arm, Log(log.dt, log.q, log.tau, log.v, log.a), width)
    found = Instrumental(start=values_of(system, other(arm))).solve(system, factors)
    assert found.status is EstimateStatus.SOLVED
    # instruments of another controller and wider friction at rest are consistent too
    assert off(found.values, truth, factors) < 1e-8
    notes = " ".join(found.notes)
    assert "no references" in notes
    assert "controller is unknown" in notes


def test_mistakes_are_named():
    arm, control, log, width = recorded("prismatic", 0.4)
    system, _, truth = problem(arm, log, width)
    with pytest.raises(ShapeError, match="4 joints, got 2"):
        closed_loop(system, truth, Controller([1.0, 1.0], 1.0))
    with pytest.raises(InvalidValueError, match="multiple or a whole part"):
        closed_loop(system, truth, replace(control, period=0.003))
    curved = rm.friction.ViscousFriction(np.ones(arm.n))
    rest = rm.base_parameters(arm, drive=("Ia",), friction=curved)
    with pytest.raises(InvalidValueError, match="friction: expected that of the drives"):
        closed_loop(equations(rest, log, system.processing), np.ones(len(rest)), control)
    with pytest.raises(InvalidValueError, match="simulation diverges"):
        simulated_log(arm, replace(control, kd=1e9), log.q_ref, log.v_ref, log.dt)


# --- joints that friction stops within a sample ---------------------------------------------------


def stiff_robot(inertia, Fv, Fc):
    """Two links, the second of so little inertia that its friction stops it at once."""
    bodies = InertialParameters.from_com(
        [1.0, 0.01], [[0.3, 0.0, 0.0], [0.0, 0.0, 0.0]], [0.05 * np.eye(3), inertia * np.eye(3)]
    )
    drive = DriveParameters(Ia=np.zeros(2), Fv=[2.0, Fv], Fc=[1.0, Fc], offset=np.zeros(2))
    return rm.load("planar_2r").with_inertia(bodies).with_drive(drive)


def stiff_problem(arm, seconds, dt, decimation=1):
    """Log of exact torques on a motion without tracking errors, and its problem."""
    q, v = motion(arm, seconds, dt, 2)
    a = central_differences(v, dt)
    log = Log(dt, q, rm.idm(arm, q, v, a), v, a, q, v)
    return log, *problem(arm, log, 0.02, decimation)


@pytest.mark.parametrize(
    ("inertia", "Fv", "Fc", "dt"), [(2e-4, 2.0, 1.0, 1e-3), (0.01, 10.0, 1.0, 5e-3)]
)
def test_stiff_joints_are_integrated_in_more_steps(inertia, Fv, Fc, dt):
    log, system, factors, truth = stiff_problem(stiff_robot(inertia, Fv, Fc), 4.0, dt)
    found = Instrumental(start=truth).solve(system, factors)
    loop = found.details.loop
    assert dt / loop.substeps * Fv / inertia < 2.0
    assert (loop.width < 0.2 * np.abs(log.v).max(axis=0)).all()
    assert found.status is EstimateStatus.SOLVED
    assert off(found.values, truth, factors) < 1e-8
    rough = closed_loop(system, truth, substeps=1)
    assert rough.substeps == 1
    assert "joint_2 is stiff" in " ".join(rough.notes)


# --- noise of the positions: least squares are biased and the test says so, the others are not ----

PERIOD, WIDTH = 2e-3, 0.01


def studied(count, position, decimation):
    """Of so many noisy logs: verdicts of the test, and errors of the least squares that it tests in
    their standard errors.
    """
    model = two_links(Ia=[0.1, 0.05], Fv=[1.0, 0.5], Fc=[0.8, 0.4], offset=[0.1, -0.1])
    q, v = swinging(model, 0, round(3.0 / PERIOD), PERIOD, 5, 2.0, 1.55)[:2]
    control = tuned_controller(model, q, 8.0, period=PERIOD, feed_forward=False)
    exact = simulated_log(model, control, q, v, PERIOD, width=WIDTH)
    base = rm.base_parameters(model, drive=True)
    truth, rng = base.values(model), np.random.default_rng(1)
    method = Instrumental(control, start=1.1 * truth, lags=0, width=WIDTH)
    verdicts, off = [], []
    for _ in range(count):
        e = position * rng.normal(size=exact.q.shape)
        de = central_differences(e, PERIOD)
        log = replace(
            exact, q=exact.q + e, tau=exact.tau + 0.5 * rng.normal(size=e.shape),
            v=exact.v + de, a=exact.a + central_differences(de, PERIOD),
        )  # fmt: skip
        system = equations(base, log, raw(log, decimation, 0.05))
        found = method.solve(system, reduce_equations(system))
        verdict = hausman_test(system, found, lags=0)
        off.append((found.values + verdict.effect - truth) / verdict.least_squares_errors)
        verdicts.append(verdict)
    return verdicts, np.array(off)


def test_the_test_names_parameters_whose_bias_matters_and_no_others():
    verdicts, off = studied(6, 3e-5, 1)
    bias = np.abs(off.mean(axis=0))
    named = np.mean([verdict.biased_parameters for verdict in verdicts], axis=0)
    assert (bias > 2.0).sum() >= 3
    assert (named[bias > 2.0] == 1.0).all()
    assert (bias < 0.5).sum() >= 3
    assert (named[bias < 0.5] == 0.0).all()
    first = verdicts[0]
    named = [x for x, bad in zip(first.names, first.biased_parameters, strict=True) if bad]
    assert first.p < 1e-3
    assert all(f"{name} (" in first.sentence for name in named)


@pytest.mark.nightly
@pytest.mark.parametrize(("position", "decimation"), [(0.0, 10), (3e-6, 1), (3e-5, 10)])
def test_noise_whose_bias_does_not_matter_is_not_rejected(position, decimation):
    verdicts, off = studied(10, position, decimation)
    assert np.abs(off.mean(axis=0)).max() < 0.7  # half a standard error, and what ten logs tell
    assert np.mean([verdict.biased for verdict in verdicts]) <= 0.1
