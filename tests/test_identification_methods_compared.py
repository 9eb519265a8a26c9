"""Methods and forms side by side: every number of the tables is that of a fit."""

import numpy as np
import pytest
from identification_logs import clean_log, odd_robots

from robotmodels.errors import InvalidValueError
from robotmodels.identification import Sequential, choose_processing, fit
from robotmodels.identification.comparison import compare_methods
from robotmodels.identification.forms import EquationForm

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
        MODEL, LOG, ("ols", "wls"), list(EquationForm), TEST, done.append, **OPTIONS
    )
    assert done == [(k + 1) / 8 for k in range(8)]
    assert [row.label for row in found.fits[:3]] == ["ols", "wls", "ols, filtered"]
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
    lines = str(found).splitlines()
    assert len(lines) == (4 + 8) + (4 + len(found.names))
    assert "held-out RMSE 4" in lines[1]
    k = found.names.index("Fv1")
    cells = [cell.strip() for cell in found.parameter_table.splitlines()[3 + k].split("│")]
    value, error = (float(x) for x in cells[3].split("±"))
    assert cells[1] == "Fv1"
    assert abs(value - found.values[1, k]) <= found.standard_errors[1, k] / 10
    assert abs(error / found.standard_errors[1, k] - 1.0) < 0.06


def test_what_does_not_exist_is_listed_with_the_reason():
    found = compare_methods(MODEL, LOG, ("wls", "sequential"), ("power",), **OPTIONS)
    assert [row.result is None for row in found.fits] == [False, True]
    assert isinstance(found.fits[1].method, Sequential)
    assert found.fits[1].refused in found.fit_table
    assert np.isnan(found.values[1]).all()
    assert found.fits[1].rmse is None
    assert "in-sample RMSE 1" in found.fit_table
    assert "sequential" not in found.parameter_table


def test_mistakes_are_raised():
    with pytest.raises(InvalidValueError, match="method: expected one of"):
        compare_methods(MODEL, LOG, ("guess",))
    with pytest.raises(InvalidValueError, match="at least one"):
        compare_methods(MODEL, LOG, ())
    with pytest.raises(InvalidValueError, match="decimation"):
        compare_methods(MODEL, LOG, ("ols",), processing={"decimation": -1})
