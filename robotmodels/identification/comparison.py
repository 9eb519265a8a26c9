"""Comparison of methods and forms on the same log."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array
from .._arrays.tasks import Progress, Workers
from .._choices import chosen
from ..errors import InvalidValueError, RobotModelsWarning
from ..logs import Log
from ..model import RobotModel
from ..table_text import boxed, number_text
from .fit import fit
from .forms import EquationForm
from .method_names import method_of
from .methods.base import Method
from .result import IdentificationResult


class ComparedFit(NamedTuple):
    """Fit by one method and form of equations; result None and the reason where it was refused."""

    method: Method
    form: EquationForm
    result: IdentificationResult | None
    seconds: float
    refused: str = ""

    @property
    def label(self) -> str:
        """Short name of method and form."""
        name = self.method.name
        return name if self.form is EquationForm.TORQUE else f"{name}, {self.form.name.lower()}"

    @property
    def rmse(self) -> Array | None:
        """Error of predicted torques by joint, on the held-out log if there is one, N m or N."""
        if self.result is None:
            return None
        return (self.result.validation.held_out or self.result.validation.in_sample).rmse


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MethodComparison:
    """Fits of one log by several methods and forms; prints as two tables."""

    fits: tuple[ComparedFit, ...]
    held_out: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters that any of the fits has identified, p of them."""
        return tuple(dict.fromkeys(n for row in self.fits if row.result for n in row.result.names))

    @property
    def values(self) -> Array:
        """Their values by each fit, shape (rows, p); NaN where it has not identified them."""
        return self._table("values")

    @property
    def standard_errors(self) -> Array:
        """Their standard errors by each fit, shape (rows, p)."""
        return self._table("standard_errors")

    def _table(self, field: str) -> Array:
        table = np.full((len(self.fits), len(self.names)), np.nan)
        for i, row in enumerate(self.fits):
            if row.result is not None:
                columns = [self.names.index(name) for name in row.result.names]
                table[i, columns] = getattr(row.result, field)
        return table

    @property
    def fit_table(self) -> str:
        """A row for each fit: status, errors, standard errors, condition, time."""
        cells = [_fit_cells(row, "held-out" if self.held_out else "in-sample") for row in self.fits]
        heads = max(cells, key=len)
        columns = [(head, [row.get(head, "") for row in cells]) for head in heads]
        refused = [f"{row.label}: {row.refused}" for row in self.fits if row.refused]
        return "\n".join([boxed(columns), *refused])

    @property
    def parameter_table(self) -> str:
        """A row for each parameter: its value and standard error by each fit."""
        columns = [("parameter", list(self.names))]
        for row, values, errors in zip(self.fits, self.values, self.standard_errors, strict=True):
            if row.result is not None:
                pairs = zip(values.tolist(), errors.tolist(), strict=True)
                columns.append((row.label, [_with_error(x, s) for x, s in pairs]))
        return boxed(columns)

    def __str__(self) -> str:
        return f"{self.fit_table}\n{self.parameter_table}"


def compare_methods(
    model: RobotModel,
    log: Log,
    methods: Iterable[Method | str] = ("ols", "wls", "irls"),
    forms: Iterable[EquationForm | str] = ("torque",),
    test: Log | None = None,
    progress: Progress = None,
    **options: Any,
) -> MethodComparison:
    """Identify a robot by several methods and forms of equations, and compare.

    Parameters
    ----------
    model, log, test, progress
        As for `fit`, the same for all; errors of predicted torques are those on ``test``, if given.
    methods, forms : iterables
        Methods that solve the equations, and forms of the equations; each with each.
    **options
        Other arguments of `fit`.

    Returns
    -------
    MethodComparison
        Prints as tables, with combinations that were refused. ``.fits`` has ``label, result,
        seconds, rmse`` of each; ``.names, .values, .standard_errors`` (rows, p) are the parameters
        side by side.

    References
    ----------
    Q. Leboutet, J. Roux, A. Janot, J. R. Guadarrama-Olvera and G. Cheng, "Inertial parameter
    identification in robotics: a survey", Applied Sciences 11(9), 2021.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> options = {"methods": ("ols", "wls"), "forms": ("torque", "filtered"), "drive": ("Fv",)}
    >>> comparison = compare_methods(*example_log(), **options)
    >>> [row.label for row in comparison.fits]
    ['ols', 'wls', 'ols, filtered', 'wls, filtered']
    """
    every_form = [chosen(EquationForm, form, "forms") for form in forms]
    pairs = list(product(every_form, [method_of(method) for method in methods]))
    if not pairs:
        raise InvalidValueError("methods, forms: expected at least one of each, got none.")
    rows: list[ComparedFit] = []
    last: InvalidValueError | None = None
    work = Workers(progress=progress)
    for k, (form, method) in enumerate(pairs):
        start = perf_counter()
        result, why = None, ""
        try:
            with warnings.catch_warnings():  # the table has their status
                warnings.simplefilter("ignore", RobotModelsWarning)
                result = fit(model, log, method, form=form, test=test, **options)
        except InvalidValueError as error:
            last, why = error, str(error)
        rows.append(ComparedFit(method, form, result, perf_counter() - start, why))
        work.done((k + 1) / len(pairs))
    if last is not None and all(row.result is None for row in rows):
        raise last
    return MethodComparison(tuple(rows), test is not None)


def _fit_cells(row: ComparedFit, word: str) -> dict[str, str]:
    """Columns of the table of fits for one of them."""
    if (result := row.result) is None or row.rmse is None:
        return {"method": row.label, "status": "refused", "seconds": number_text(row.seconds, 3)}
    parts = result.validation.in_sample.filtered_relative
    parts = parts[np.isfinite(parts)]
    residual = 100.0 * np.sqrt(np.mean(parts**2)) if len(parts) else np.nan
    k = int(np.argmax(result.relative_errors))
    largest = f"{100.0 * result.relative_errors[k]:.3g} ({result.names[k]})"
    largest = "-" if np.isnan(result.relative_errors[k]) else largest
    return {
        "method": row.label,
        "status": result.status.name.lower().replace("_", " "),
        "parameters": str(len(result.names)),
        "residual %": number_text(residual, 3),
        **{f"{word} RMSE {j + 1}": number_text(e, 3) for j, e in enumerate(row.rmse.tolist())},
        "largest standard error %": largest,
        "condition": number_text(result.condition, 3),
        "scaled": number_text(result.scaled_condition, 3),
        "seconds": number_text(row.seconds, 3),
    }


def _with_error(value: float, error: float) -> str:
    """A value to the second digit of its standard error."""
    if np.isnan(value) or not 0.0 < error < np.inf:
        return "-" if np.isnan(value) else f"{value:.4g} ± {error:.2g}"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{digits}f} ± {error:.{digits}f}"
