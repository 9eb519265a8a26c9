"""A fit whose torques are predicted badly is called poor by `fit`, its notes and its report."""

import warnings
from functools import cache

import numpy as np
import pytest
from identification_logs import clean_log, swinging
from identities.random_robots import random_model

import robotmodels as rm
from robotmodels.errors import InvalidValueError, RobotModelsWarning
from robotmodels.estimation.estimate import EstimateStatus
from robotmodels.identification import (
    Log,
    compare_methods,
    consistent_robot,
    fit,
    identify_payload,
    predicted_torque,
    report,
    validate,
    write_result,
)

DT = 5e-3
LINEAR = ("ols", "wls", "irls", "robust", "tls", "ridge", "recursive")
FITS = [
    *((method, form) for method in LINEAR for form in ("torque", "filtered", "power", "energy")),
    *((method, form) for method in ("sequential",) for form in ("torque", "filtered")),
    *((method, "torque") for method in ("iv", "didim", "cloe")),
]


@cache
def arm():
    model = rm.load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    bodies = rm.InertialParameters.from_com(
        [3.0, 2.0], [[0.3, 0.02, 0.0], [0.2, 0.01, 0.0]],
        [np.diag([0.02, 0.1, 0.1]), np.diag([0.01, 0.05, 0.05])],
    )  # fmt: skip
    return model.with_inertia(bodies).with_drive(
        rm.DriveParameters(Ia=[0.3, 0.2], Fv=[2.0, 1.0], Fc=[1.0, 0.5])
    )


@cache
def moved(seed=0, seconds=20.0):
    """Motion and torques without noise."""
    rng = np.random.default_rng(seed)
    q, v, a = swinging(arm(), rng, samples=round(seconds / DT), dt=DT, size=0.7)
    return q, v, rm.idm(arm(), q, v, a)


def log_of(change=lambda q, v, tau: tau, seed=0, noise=0.02):
    q, v, tau = moved(seed)
    rng = np.random.default_rng(seed + 100)
    return Log(DT, np.array(q), change(q, v, tau) + noise * rng.normal(size=tau.shape))


def noticed(*args, **options):
    """Result of a fit, and the sentences of its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = fit(*args, **options)
    assert all(one.filename == __file__ for one in caught)  # where the user called `fit`
    assert all(one.category is RobotModelsWarning for one in caught)
    return result, [str(one.message) for one in caught]


def plain(text):
    return " ".join(text.split())


@pytest.mark.parametrize(("method", "form"), FITS)
def test_every_method_and_form_is_silent_on_a_good_log(method, form):
    found, said = noticed(arm(), log_of(), method, form=form, drive=("Ia", "Fv", "Fc"),
                          test=log_of(seed=1))  # fmt: skip
    assert said == []
    assert found.estimate.status is EstimateStatus.SOLVED
    assert not any("Poor prediction" in note for note in found.notes)


@pytest.mark.parametrize(("method", "form"), FITS)
def test_every_method_and_form_warns_of_a_log_that_it_cannot_explain(method, form):
    swapped = log_of(lambda q, v, tau: tau[:, ::-1])
    found, said = noticed(arm(), swapped, method, form=form, checked=False)
    status = found.estimate.status
    assert status is not EstimateStatus.SOLVED
    assert len(said) == 1
    assert found.notes[0] == said[0]
    verdict = plain(report(found)).split(" * ")[1]
    if status is EstimateStatus.UNSTABLE:
        assert said[0].startswith(status.sentence)
        assert verdict.startswith(status.sentence)
    else:
        assert said[0].startswith("Poor prediction. Unexplained part of the torque on the log: ")
        assert verdict == said[0]


def test_the_sentence_names_joints_parts_and_the_log():
    wrong = log_of(lambda q, v, tau: tau * [1.0, -1.0])
    found, said = noticed(arm(), log_of(), test=wrong, checked=False)
    assert found.estimate.status is EstimateStatus.POOR_PREDICTION
    assert "on the held-out log: joint_2 (200 %)" in said[0]
    assert "joint_1" not in said[0]
    assert "worse than predicting zero torque: joint_2." in said[0]
    assert "do not generalise" in said[0]
    # the same log fitted, which no parameters explain
    found, said = noticed(arm(), wrong, checked=False)
    assert "on the log: joint_" in said[0]
    assert "signs" in said[0]


@pytest.mark.parametrize("seed", range(6))
def test_of_random_robots_joints_are_named_from_thirty_per_cent_on(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, 4, drive=True, prismatic=seed % 2 == 1)
    named = []
    for size in (0.05, 0.2, 0.4, 0.8):
        log, other = clean_log(model, rng), clean_log(model, rng)
        joint = int(rng.integers(model.n))

        def loaded(log, size=size, joint=joint):
            """A torque that no parameter explains, such as a forgotten spring."""
            tau, q = np.array(log.tau), log.q[:, joint]
            lost = np.sin(7.0 * q)
            tau[:, joint] += size * lost * np.sqrt(np.mean(tau[:, joint] ** 2) / np.mean(lost**2))
            return Log(log.dt, log.q, tau, log.v, log.a)

        found, said = noticed(model, loaded(log), test=loaded(other), checked=False)
        own, aside = found.validation.in_sample, found.validation.held_out
        text = " ".join(said)
        for j, name in enumerate(model.table.joint_names):
            if own.filtered_relative[j] > 0.31:
                assert f"{name} (" in text.split("; on the held-out log")[0]
            if max(own.filtered_relative[j], aside.filtered_relative[j]) < 0.29:
                assert f"{name} (" not in text
            if aside.relative[j] > 1.05:
                assert name in text.split("zero torque: ")[1]
        kinds = model.table.sigma[model.table.joint_rows]
        for side in (own, aside):
            for kind in set(kinds.tolist()):
                torque = side.rmse[kinds == kind] / side.relative[kinds == kind]
                whole = np.sqrt((side.rmse[kinds == kind] ** 2).sum() / (torque**2).sum())
                assert whole < 0.31 or "all joints together" in text
        poor = found.estimate.status is EstimateStatus.POOR_PREDICTION
        assert poor == bool(said)
        named.append(poor)
    assert not named[0]
    assert named[-1]


def test_noise_and_ripple_that_no_model_explains_are_no_poor_prediction():
    rng = np.random.default_rng(0)
    t = DT * np.arange(len(moved()[0]))[:, None]

    def rippled(q, v, tau):
        return tau + 0.9 * tau.std(axis=0) * np.sin(2.0 * np.pi * 80.0 * t)

    def noisy(q, v, tau):
        return tau + [0.0, 4.0 * tau[:, 1].std()] * rng.normal(size=tau.shape)

    for change in (rippled, noisy):
        found, said = noticed(arm(), log_of(change), test=log_of(change, seed=1), checked=False)
        assert said == []
        assert found.estimate.status is EstimateStatus.SOLVED
        assert found.validation.held_out.relative.max() > 0.35


@pytest.mark.parametrize("seed", range(4))
def test_a_joint_that_rests_is_judged_with_all_joints_together(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, 4 + seed % 3, drive=True, prismatic=False)
    q, v, a = swinging(model, rng)
    for x, value in zip((q, v, a), (0.3, 0.0, 0.0), strict=True):
        x[:, -1] = value
    tau = rm.idm(model, q, v, a)
    noise = rng.normal(size=(2, *q.shape))  # by which parameters of the joint seem to be seen
    torque = tau + 0.01 * np.sqrt(np.mean(tau**2, axis=0)) * noise[1]
    found, said = noticed(model, Log(2e-3, q + 1e-5 * noise[0], torque), checked=False)
    own = found.validation.in_sample
    assert np.isnan(own.filtered_relative[-1])
    assert np.nanmax(own.filtered_relative) < 0.1
    part = own.rmse[-1] / np.linalg.norm(own.rmse / own.relative)
    assert not 0.25 < part < 0.35  # else the noise would decide
    poor = found.estimate.status is EstimateStatus.POOR_PREDICTION
    assert poor == (part > 0.3)
    assert poor == any("all joints together" in sentence for sentence in said)


def test_torques_of_which_nothing_is_explained_are_a_poor_prediction():
    rng = np.random.default_rng(0)
    found, said = noticed(arm(), log_of(lambda q, v, tau: 9.0 * rng.normal(size=tau.shape)),
                          checked=False)  # fmt: skip
    assert found.estimate.status is EstimateStatus.POOR_PREDICTION
    assert "all joints together" in said[0]


def test_tables_of_methods_show_the_status_of_poor_fits_and_do_not_repeat_the_warning():
    swapped = log_of(lambda q, v, tau: tau[:, ::-1])
    found = compare_methods(arm(), swapped, ("wls", "sequential"), checked=False)
    assert found.fit_table.count("poor prediction") == 2


# --- a simulated robot that diverged --------------------------------------------------------


@cache
def ran_away():
    log = log_of(lambda q, v, tau: -tau)  # its masses are negative
    return noticed(arm(), log, "iv", test=log_of(seed=1), checked=False)


def test_a_robot_that_ran_away_has_no_numbers_that_look_like_results():
    found, said = ran_away()
    assert found.estimate.status is EstimateStatus.UNSTABLE
    assert said == [found.notes[0]]
    assert "start=" in said[0]
    white, errors = found.details.iid_standard_errors, found.validation
    for numbers in (found.values, found.standard_errors, found.covariance, white,
                    errors.in_sample.rmse, errors.held_out.filtered_relative):  # fmt: skip
        assert np.isnan(numbers).all()
    assert "diverged" in repr(found)


def test_a_robot_that_ran_away_is_not_predicted_written_drawn_or_made_real(tmp_path):
    found, _ = ran_away()
    q = np.zeros(2)
    for refused in (
        lambda: predicted_torque(found, q, q, q),
        lambda: validate(found, log_of()),
        lambda: consistent_robot(found),
        lambda: write_result(found, tmp_path / "result.json"),
        lambda: write_result(found, tmp_path / "result.urdf"),
        lambda: identify_payload(arm(), log_of(), found),
        lambda: rm.viz.plot_identification_parameters(found),
    ):
        with pytest.raises(InvalidValueError, match="diverged, so that there are no parameters"):
            refused()
    assert not list(tmp_path.iterdir())


def test_the_report_of_a_robot_that_ran_away_says_so_and_shows_no_parameters():
    found, _ = ran_away()
    text = report(found)
    assert plain(text).split(" * ")[1].startswith(found.estimate.status.sentence)
    assert "negative" not in text
    assert "\nParameters\n" not in text
    assert "\nErrors\n" not in text
    assert "cannot be simulated" in text
    assert max(map(len, text.splitlines())) <= 100


def test_tables_show_dashes_for_a_robot_that_ran_away():
    log = log_of(lambda q, v, tau: -tau)
    found = compare_methods(arm(), log, ("wls", "iv"), checked=False)
    rows = found.fit_table.splitlines()
    row = next(line for line in rows if "unstable" in line)
    cells = [cell.strip() for cell in row.split("│")[1:-1]]
    assert cells.count("-") >= 4  # residual, errors of both joints, largest deviation
    assert "nan" not in str(found)
    assert np.isnan(found.values[1]).all()


def test_the_command_line_prints_the_sentence_and_ends_with_its_status(tmp_path, capsys):
    from robotmodels.cli import main

    q, _, tau = moved()
    for name, rows in (("q", q), ("tau", -tau)):
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header="1,2", comments="")
    call = ["identify", "--robot", "planar_2r", "--log", str(tmp_path / "q.csv"), "--torques-from",
            str(tmp_path / "tau.csv"), "--dt", str(DT), "--no-check"]  # fmt: skip
    assert main([*call, "--method", "iv", "--out", str(tmp_path / "out")]) == 1
    out, err = capsys.readouterr()
    assert "diverged" in err
    assert "│" not in out
    assert not (tmp_path / "out" / "result.json").exists()
