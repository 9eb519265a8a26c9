"""A fit whose torques are predicted badly is called poor by `fit`, its notes and its report."""

import warnings
from functools import cache

import numpy as np
import pytest
from identification_logs import swinging

import robotmodels as rm
from robotmodels.errors import InvalidValueError, RobotModelsWarning
from robotmodels.estimation.estimate import EstimateStatus
from robotmodels.identification import (
    Log,
    consistent_robot,
    fit,
    identify_payload,
    predicted_torque,
    report,
    validate,
    write_result,
)

DT = 5e-3
FITS = [
    *((method, "torque") for method in ("ols", "irls", "robust", "tls", "ridge", "recursive")),
    *(("wls", form) for form in ("torque", "filtered", "power", "energy")),
    *(("sequential", form) for form in ("torque", "filtered")),
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
@pytest.mark.nightly
def test_every_method_and_form_warns_of_a_log_that_it_cannot_explain_alone(method, form):
    options = {"form": form, "drive": ("Ia", "Fv", "Fc"), "test": log_of(seed=1)}
    found, sentences = noticed(arm(), log_of(), method, **options)
    assert sentences == []
    assert found.estimate.status is EstimateStatus.SOLVED
    assert not any("Poor prediction" in note for note in found.notes)
    swapped = log_of(lambda q, v, tau: tau[:, ::-1])
    found, sentences = noticed(arm(), swapped, method, form=form, checked=False)
    status = found.estimate.status
    assert status is not EstimateStatus.SOLVED
    assert len(sentences) == 1
    assert found.notes[0] == sentences[0]
    verdict = plain(report(found)).split(" * ")[1]
    if status is EstimateStatus.UNSTABLE:
        assert sentences[0].startswith(status.sentence)
        assert verdict.startswith(status.sentence)
    else:
        assert sentences[0].startswith("Poor prediction. Unexplained part of the torque on the log")
        assert verdict == sentences[0]


def test_the_sentence_names_joints_parts_and_the_log():
    wrong = log_of(lambda q, v, tau: tau * [1.0, -1.0])
    found, (sentence,) = noticed(arm(), log_of(), test=wrong, checked=False)
    assert found.estimate.status is EstimateStatus.POOR_PREDICTION
    assert "on the held-out log: joint_2 (200 %)" in sentence
    assert "joint_1" not in sentence
    assert "worse than predicting zero torque: joint_2." in sentence
    assert "do not generalise" in sentence
    # the same log fitted, which no parameters explain
    _, (sentence,) = noticed(arm(), wrong, checked=False)
    assert "on the log: joint_" in sentence
    assert "signs" in sentence


def test_noise_and_ripple_that_no_model_explains_are_no_poor_prediction():
    rng = np.random.default_rng(0)
    t = DT * np.arange(len(moved()[0]))[:, None]

    def rippled(q, v, tau):
        return tau + 0.9 * tau.std(axis=0) * np.sin(2.0 * np.pi * 80.0 * t)

    def noisy(q, v, tau):
        return tau + [0.0, 4.0 * tau[:, 1].std()] * rng.normal(size=tau.shape)

    for change in (rippled, noisy):
        found, sentences = noticed(
            arm(), log_of(change), test=log_of(change, seed=1), checked=False
        )
        assert sentences == []
        assert found.estimate.status is EstimateStatus.SOLVED
        assert found.validation.held_out.relative.max() > 0.35
    found, (sentence,) = noticed(
        arm(), log_of(lambda q, v, tau: 9.0 * rng.normal(size=tau.shape)), checked=False
    )
    assert found.estimate.status is EstimateStatus.POOR_PREDICTION
    assert "all joints together" in sentence


# --- a simulated robot that diverged --------------------------------------------------------


@cache
def diverged():
    log = log_of(lambda q, v, tau: -tau)  # its masses are negative
    return noticed(arm(), log, "iv", test=log_of(seed=1), checked=False)


def test_a_robot_that_diverged_has_no_numbers_that_look_like_results(tmp_path):
    found, sentences = diverged()
    assert found.estimate.status is EstimateStatus.UNSTABLE
    assert sentences == [found.notes[0]]
    assert "start=" in sentences[0]
    white, errors = found.details.iid_standard_errors, found.validation
    for numbers in (found.values, found.standard_errors, found.covariance, white,
                    errors.in_sample.rmse, errors.held_out.filtered_relative):  # fmt: skip
        assert np.isnan(numbers).all()
    assert "diverged" in repr(found)
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
