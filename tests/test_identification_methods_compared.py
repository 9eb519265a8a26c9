"""Methods and forms side by side: every number of the tables is that of a fit."""

import numpy as np
from identification_logs import clean_log, odd_robots

from robotmodels.identification import choose_processing, fit
from robotmodels.identification.comparison import compare_methods

MODEL = odd_robots()["serial"]
LOG = clean_log(MODEL, np.random.default_rng(3), 0.2, samples=2000, dt=4e-3)
TEST = clean_log(MODEL, np.random.default_rng(4), 0.2, samples=1000, dt=4e-3)
OPTIONS = {
    "processing": choose_processing(LOG, filtered=False, decimation=5, edges=0.0, dead_band=0.01),
    "checked": False,
}


def test_rows_are_the_fits():
    done = []
    found = compare_methods(
        MODEL, LOG, ("ols", "wls"), ("torque", "power"), TEST, done.append, **OPTIONS
    )
    assert done == [(k + 1) / 4 for k in range(4)]
    assert [row.label for row in found.fits[:3]] == ["ols", "wls", "ols, power"]
    for k, row in enumerate(found.fits):
        again = fit(MODEL, LOG, row.method, form=row.form, test=TEST, **OPTIONS)
        assert row.seconds > 0.0
        assert row.refused == ""
        np.testing.assert_array_equal(row.rmse, again.validation.held_out.rmse)
        at = [found.names.index(name) for name in again.names]
        np.testing.assert_array_equal(found.values[k, at], again.values)
        np.testing.assert_array_equal(found.standard_errors[k, at], again.standard_errors)
        # torques that were noisy by 0.2 N m; a quarter of the equations tell less
        assert (row.rmse < (0.25 if row.form.by_joint else 0.6)).all()
    assert "held-out RMSE 4" in str(found)


def test_what_does_not_exist_is_listed_with_the_reason():
    found = compare_methods(MODEL, LOG, ("wls", "sequential"), ("power",), **OPTIONS)
    assert [row.result is None for row in found.fits] == [False, True]
    assert found.fits[1].refused in found.fit_table
    assert np.isnan(found.values[1]).all()
    assert found.fits[1].rmse is None
