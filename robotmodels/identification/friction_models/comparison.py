"""Which friction model a log supports: errors on rows kept aside, and Schwarz' criterion."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ..._choices import chosen
from ...errors import InvalidValueError
from ...logs import Log
from ...minimal_parameters import BaseParameters
from ...model import RobotModel, check_model
from ...table_text import boxed
from ..equations import Equations, equations
from ..preparation.processing import Processing, choose_processing
from ..scale.reduction import Reduction
from .curves import OwnColumns, OwnEquations, chosen_factors, fitted, own_noise
from .load_friction import fit_load_friction
from .stribeck import fit_stribeck, independent_residuals, with_dry_friction

_TRAIN = 0.6


class FrictionForm(Enum):
    """Friction models that are compared; each but the first two has those before it as a case.

    Examples
    --------
    >>> FrictionForm.OFFSET.value
    'viscous, Coulomb, offset'
    """

    VISCOUS = "viscous"
    COULOMB = "Coulomb"
    BOTH = "viscous, Coulomb"
    OFFSET = "viscous, Coulomb, offset"
    ASYMMETRIC = "viscous and Coulomb by direction"
    STRIBECK = "viscous, Coulomb, offset, Stribeck"
    LOAD = "viscous, Coulomb, offset, by load"


_KINDS = {
    FrictionForm.VISCOUS: {"Fv"},
    FrictionForm.COULOMB: {"Fc"},
    FrictionForm.BOTH: {"Fv", "Fc"},
}
_PARAMETERS = {
    FrictionForm.VISCOUS: 1, FrictionForm.COULOMB: 1, FrictionForm.BOTH: 2, FrictionForm.OFFSET: 3,
    FrictionForm.ASYMMETRIC: 4, FrictionForm.STRIBECK: 5, FrictionForm.LOAD: 4,
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class FrictionComparison(Rebuilt):
    """Friction models on one log, a row for each. Read-only.

    Parameters
    ----------
    candidates : tuple of FrictionForm
        The c models.
    fitted : ndarray, shape (c, n)
        Root mean square of the residuals on the rows that were fitted, N m or N.
    held_out : ndarray, shape (c, n)
        On the rows kept aside.
    bic : ndarray, shape (c, n)
        Schwarz' criterion of each joint less that of its best model: 0 is the best, 10 more is
        decisive. It counts the joint's own friction parameters and its independent residuals.
    independent : ndarray, shape (n,)
        Independent residuals, from the correlation of successive ones.
    """

    candidates: tuple[FrictionForm, ...]
    fitted: Array
    held_out: Array
    bic: Array
    independent: Array

    def __post_init__(self) -> None:
        for name in ("fitted", "held_out", "bic", "independent"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def best(self) -> tuple[FrictionForm, ...]:
        """The model of each joint with the least criterion."""
        return tuple(self.candidates[k] for k in self.bic.argmin(axis=0))

    @property
    def best_held_out(self) -> tuple[FrictionForm, ...]:
        """The model of each joint with the least error on the rows kept aside."""
        return tuple(self.candidates[k] for k in self.held_out.argmin(axis=0))

    def __str__(self) -> str:
        n = self.bic.shape[1]
        parts = []
        for title, values, digits in (
            ("error kept aside", self.held_out, ".4g"), ("criterion", self.bic, ".1f"),
        ):  # fmt: skip
            columns = [(title, [form.value for form in self.candidates])]
            columns += [
                (f"joint {j + 1}", [format(x, digits) for x in values[:, j]]) for j in range(n)
            ]
            parts.append(boxed(columns))
        return "\n".join(parts)


def compare_friction(
    model: RobotModel,
    log: Log,
    candidates: Iterable[FrictionForm | str] | None = None,
    *,
    test: Log | None = None,
    base: BaseParameters | None = None,
    processing: Processing | None = None,
) -> FrictionComparison:
    """Compare friction models on the same equations.

    All candidates are fitted with the same base parameters on the same rows; those of a log that
    was kept aside judge them.

    Parameters
    ----------
    model : RobotModel
        The robot.
    log : Log
        Of its joints.
    candidates : iterable of FrictionForm or str, optional
        Default all.
    test : Log, optional
        Kept aside; default the last 40 % of the rows of the log.
    base : BaseParameters, optional
        Default all drive parameters.
    processing : Processing, optional
        Of both; default what the log suggests. A dead band hides slow motion, in which Stribeck's
        curve shows.

    Returns
    -------
    FrictionComparison
        ``print`` shows errors and criteria of each joint.

    Raises
    ------
    InvalidValueError
        No candidates; no Coulomb friction in ``base``; a log that is too short.

    References
    ----------
    G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6(2), 1978; seed book
    sections 1.5.1.4 and 1.6.5.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> table = str(compare_friction(arm, log))
    >>> "viscous, Coulomb" in table
    True
    """
    check_model(model)
    forms = tuple(
        FrictionForm if candidates is None
        else (chosen(FrictionForm, one, "candidates") for one in candidates)
    )  # fmt: skip
    if not forms:
        raise InvalidValueError("candidates: expected at least one friction model.")
    base = with_dry_friction(model, base)
    if test is None:
        cut = int(_TRAIN * len(log))
        log, test = log.rows(0, cut), log.rows(cut, len(log))
    choices = choose_processing(log) if processing is None else processing
    train, aside = equations(base, log, choices), equations(base, test, choices)
    b, n = len(base), model.n
    plain = _reduced(train, None), _reduced(aside, None)
    sigma = own_noise(plain[0])
    counts, other = plain[0].counts, plain[1].counts
    values = fitted(chosen_factors(plain[0], b, _which(n, -1)), sigma).values
    independent = independent_residuals(train, values[:b], sigma, counts)
    sums, far = [], []
    for form in forms:
        one = _judged(form, model, train, aside, plain, sigma)
        sums.append(one[0])
        far.append(one[1])
    rss, held = np.maximum(np.array(sums), 1e-300), np.array(far)
    more = np.array([_PARAMETERS[form] for form in forms])[:, None]
    bic = independent * np.log(rss / np.maximum(counts, 1)) + more * np.log(independent)
    return FrictionComparison(
        forms, np.sqrt(rss / np.maximum(counts, 1)), np.sqrt(held / np.maximum(other, 1)),
        bic - bic.min(axis=0), independent,
    )  # fmt: skip


def _which(n: int, k: int) -> NDArray[np.int64]:
    return np.full((n, 1), k, dtype=np.int64)


def _even(W: Array, v: Array) -> tuple[Array, Array]:
    """What viscous friction by direction adds to viscous friction and an offset."""
    return W, np.abs(v)[:, :, None]


def _reduced(system: Equations, columns: OwnColumns | None) -> Reduction:
    return OwnEquations(system, _even if columns is None else columns, 1).reduced()


def _judged(
    form: FrictionForm, model: RobotModel, train: Equations, aside: Equations,
    plain: tuple[Reduction, Reduction], sigma: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Sums of squared residuals of each joint on the rows fitted and on those kept aside."""
    n, b = model.n, len(train.names)
    if form in (FrictionForm.STRIBECK, FrictionForm.LOAD):
        fit = fit_stribeck if form is FrictionForm.STRIBECK else fit_load_friction
        found = fit(model, train.log, base=train.base, processing=train.processing)
        own = found.Fl if form is FrictionForm.LOAD else found.drop  # type: ignore[union-attr]
        theta = np.concatenate((found.values, own))
        here, there = (
            chosen_factors(_reduced(system, found.columns()), b, _which(n, 0)).sums(theta)
            for system in (train, aside)
        )
        return here, there
    which = _which(n, 0 if form is FrictionForm.ASYMMETRIC else -1)
    here, there = (chosen_factors(one, b, which) for one in plain)
    if form in _KINDS:
        kinds = {"Fv", "Fc", "Fvm", "Fcm", "offset"} - _KINDS[form]
        kinds -= {f"{kind}m" for kind in _KINDS[form]}
        gone = [k for k, name in enumerate(train.names) if name.rstrip("0123456789") in kinds]
        factors = []
        for F in here.factors:
            rows = F.copy()
            rows[:, gone] = 0.0
            factors.append(rows)
        fit_here = Reduction(here.names, tuple(factors), here.counts, here.left_out)
        theta = fitted(fit_here, sigma).values
        return here.sums(theta), there.sums(theta)
    theta = fitted(here, sigma).values
    return here.sums(theta), there.sums(theta)
