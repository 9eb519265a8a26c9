"""Methods and forms side by side on the same log."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from time import perf_counter
from typing import Any

import numpy as np

from .._arrays import Array
from .._choices import chosen
from ..errors import InvalidValueError, RobotModelsWarning
from ..logs import Log
from ..model import RobotModel
from ..table_text import boxed
from .equations import EquationForm
from .fit import fit
from .methods.estimate import Method
from .result import IdentificationResult


@dataclass(frozen=True, slots=True, eq=False)
class ComparedFit:
    """One method on one form of the equations.

    Parameters
    ----------
    method : Method
        How the equations were solved.
    form : EquationForm
        What they balance.
    result : IdentificationResult or None
        What it gave; None where it was refused.
    seconds : float
        Time it took.
    refused : str
        Why it was refused; empty where it was not.
    """

    method: Method
    form: EquationForm
    result: IdentificationResult | None
    seconds: float
    refused: str = ""

    @property
    def label(self) -> str:
        """Short name of method and form."""
        own = self.method.name.lower()
        return own if self.form is EquationForm.TORQUE else f"{own}, {self.form.name.lower()}"

    @property
    def residual(self) -> float:
        """Residual torque relative to the torque, both filtered; NaN where refused."""
        if self.result is None:
            return np.nan
        parts = self.result.fitted.filtered_relative
        parts = parts[np.isfinite(parts)]
        return float(np.sqrt(np.mean(parts**2))) if len(parts) else np.nan

    @property
    def rmse(self) -> Array | None:
        """Error of predicted torques by joint, on the log kept aside if there is one, N m or N."""
        if self.result is None:
            return None
        held = self.result.held_out
        return (self.result.fitted if held is None else held).rmse


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MethodComparison:
    """What methods and forms make of the same log; prints as two tables.

    Parameters
    ----------
    fits : tuple of ComparedFit
        In the order asked for; those refused among them.
    held_out : bool
        Whether errors of predicted torques are on a log that was kept aside.
    """

    fits: tuple[ComparedFit, ...]
    held_out: bool

    def __len__(self) -> int:
        return len(self.fits)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters that any of the fits has identified, p of them."""
        found: dict[str, None] = {}
        for row in self.fits:
            if row.result is not None:
                found |= dict.fromkeys(row.result.names)
        return tuple(found)

    @property
    def values(self) -> Array:
        """Their values by each fit, shape (rows, p); NaN where one has not identified it."""
        return self._gathered("values")

    @property
    def deviations(self) -> Array:
        """Their standard deviations by each fit, shape (rows, p)."""
        return self._gathered("deviations")

    @property
    def fit_table(self) -> str:
        """A row for each fit: how it ended, errors, deviations, condition, time."""
        done = [row.result for row in self.fits]
        n = next(result.model.n for result in done if result is not None)
        word = "held-out" if self.held_out else "own"
        errors = [row.rmse for row in self.fits]
        columns = [
            ("method", [row.label for row in self.fits]),
            (
                "status",
                [
                    "refused" if r is None else r.estimate.status.name.lower().replace("_", " ")
                    for r in done
                ],
            ),
            ("parameters", ["" if r is None else str(len(r.names)) for r in done]),
            ("residual %", [_number(100.0 * row.residual) for row in self.fits]),
        ]
        for j in range(n):
            cells = ["" if e is None else _number(float(e[j])) for e in errors]
            columns.append((f"{word} RMSE {j + 1}", cells))
        worst = ["" if r is None else _worst(r) for r in done]
        columns += [
            ("largest deviation %", worst),
            ("condition", ["" if r is None else _number(r.condition) for r in done]),
            ("scaled", ["" if r is None else _number(r.condition_scaled) for r in done]),
            ("seconds", [_number(row.seconds) for row in self.fits]),
        ]
        refused = [f"{row.label}: {row.refused}" for row in self.fits if row.refused]
        return "\n".join([boxed(columns), *refused])

    @property
    def parameter_table(self) -> str:
        """A row for each parameter: its value and standard deviation by each fit."""
        columns: list[tuple[str, list[str]]] = [("parameter", list(self.names))]
        values, deviations = self.values, self.deviations
        for k, row in enumerate(self.fits):
            if row.result is not None:
                pairs = zip(values[k].tolist(), deviations[k].tolist(), strict=True)
                columns.append((row.label, [_with_deviation(x, s) for x, s in pairs]))
        return boxed(columns)

    def _gathered(self, field: str) -> Array:
        place = {name: k for k, name in enumerate(self.names)}
        found = np.full((len(self.fits), len(place)), np.nan)
        for i, row in enumerate(self.fits):
            if row.result is not None:
                found[i, [place[name] for name in row.result.names]] = getattr(row.result, field)
        return found

    def __str__(self) -> str:
        return f"{self.fit_table}\n{self.parameter_table}"

    def __repr__(self) -> str:
        words = ", ".join(row.label for row in self.fits)
        return f"<MethodComparison of {len(self.fits)} fits: {words}>"


def compare_methods(
    model: RobotModel,
    log: Log,
    methods: Iterable[Method | str] = (Method.OLS, Method.WLS, Method.IRLS),
    forms: Iterable[EquationForm | str] = (EquationForm.TORQUE,),
    test: Log | None = None,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> MethodComparison:
    """Identify a robot by several methods and forms of equations, and compare.

    Parameters
    ----------
    model : RobotModel
        The robot.
    log : Log
        The log, the same for all.
    methods : iterable of Method or str
        How the equations are solved.
    forms : iterable of EquationForm or str
        What they balance; each method with each form.
    test : Log, optional
        Kept aside; errors of predicted torques are then on it.
    progress : callable, optional
        Called with the fraction done.
    **options
        Whatever else `fit` takes, the same for all.

    Returns
    -------
    MethodComparison
        Prints as tables; a combination that does not exist, such as joint by joint with a power,
        is listed with the reason.

    Raises
    ------
    InvalidValueError, ShapeError
        No method or form; what no combination takes.

    References
    ----------
    Seed book section 1.6; Q. Leboutet, J. Roux, A. Janot, J. R. Guadarrama-Olvera and G. Cheng,
    "Inertial parameter identification in robotics: a survey", Applied Sciences 11(9), 2021.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.identification import Log
    >>> from robotmodels.robots import load
    >>> model, t, w = load("rx90"), 0.01 * np.arange(600)[:, None], np.linspace(1.0, 5.0, 6)
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.01, q, idm(model, q, v, a), v, a)
    >>> found = compare_methods(
    ...     model, log, ("ols", "wls"), ("torque", "filtered"), drive=False, checked=False
    ... )
    >>> [row.label for row in found.fits]
    ['ols', 'wls', 'ols, filtered', 'wls, filtered']
    """
    pairs = list(
        product(
            [chosen(EquationForm, form, "forms") for form in forms],
            [chosen(Method, method, "methods") for method in methods],
        )
    )
    if not pairs:
        raise InvalidValueError("methods, forms: expected at least one of each, got none.")
    rows: list[ComparedFit] = []
    last: InvalidValueError | None = None
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
        if progress is not None:
            progress((k + 1) / len(pairs))
    if last is not None and all(row.result is None for row in rows):
        raise last
    return MethodComparison(tuple(rows), test is not None)


def _worst(result: IdentificationResult) -> str:
    """Largest relative deviation and whose it is."""
    relative = result.relative_deviations
    k = int(np.argmax(relative))
    if np.isnan(relative[k]):
        return "-"
    return f"{_number(100.0 * float(relative[k]))} ({result.names[k]})"


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3g}"


def _with_deviation(value: float, deviation: float) -> str:
    """A value to the second digit of its deviation."""
    if np.isnan(value):
        return "-"
    if not (np.isfinite(deviation) and deviation > 0.0):
        return f"{value:.4g} ± {deviation:.2g}"
    digits = max(0, 1 - int(np.floor(np.log10(deviation))))
    return f"{value:.{digits}f} ± {deviation:.{digits}f}"
