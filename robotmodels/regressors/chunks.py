"""Evaluation of regressors: all samples at once, or a long log in pieces of bounded size."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows
from ..drive import Drives
from ..errors import InvalidValueError
from ..friction import Friction
from ..model import RobotModel, check_model
from .columns import Columns, chosen_columns, energy_blocks, friction_of, standard_blocks


class Form(NamedTuple):
    """A form of the dynamic model: the function that fills in its rows, and their shape.

    ``fill(model, chosen, friction, (q, v, a), *arrays)``, arrays (N, n, c), or (N, c).
    """

    fill: Callable[..., None]
    samples: str  # "qva" or "qv"
    by_joint: bool = True
    stored: bool = False  # has columns of the parameters that store energy alone
    arrays: int = 1
    result: Callable[..., Any] = np.asarray


FORMS: dict[Callable[..., Any], Form] = {}
"""Forms of the regressors with rows for single samples."""


def evaluate(
    form: Form,
    model: RobotModel,
    samples: Sequence[ArrayLike],
    drive: Drives,
    columns: Columns | None,
    friction: Friction | None = None,
) -> Any:
    """The regressor of samples ``q, v`` or ``q, v, a``, each (..., n)."""
    batch, rows = _rows(form, model, samples)
    core, fill = _prepared(form, model, drive, columns, friction)
    out = np.empty((form.arrays, len(rows[0]), *core))
    fill(rows, *out)
    return form.result(*(W.reshape(*batch, *core) for W in out))


def chunked(
    regressor: Callable[..., Any],
    model: RobotModel,
    *samples: ArrayLike,
    size: int = 256,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Iterator[tuple[slice, Any]]:
    """A regressor of a long log, a piece at a time in one reused buffer of bounded size.

    Parameters
    ----------
    regressor : callable
        `torque_regressor`, `power_regressor`, `energy_regressor` or `momentum_regressor`.
    model : RobotModel
        The robot, n joints.
    *samples : array_like, shape (N, n)
        Arguments of the regressor: ``q, v, a``, or ``q, v`` for energy and momentum.
    size : int
        Samples in a piece.
    drive, columns, friction
        As for the regressor; an energy has no friction.

    Yields
    ------
    rows : slice
        Samples of the piece.
    W : ndarray, shape (k, ...), or MomentumRegressors
        Their regressor. The next piece overwrites it: use or copy it before.

    Raises
    ------
    ShapeError, InvalidValueError
        As the regressor, ``size`` below 1, a log without samples, or another regressor.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.regressors import energy_regressor
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> q = np.zeros((1000, 1))
    >>> [h.shape for _, h in chunked(energy_regressor, one, q, q, size=600)]
    [(600, 11), (400, 11)]
    """
    if (form := FORMS.get(regressor)) is None:
        known = ", ".join(known.__name__ for known in FORMS)
        raise InvalidValueError(f"regressor: expected one of {known}, got {regressor!r:.80}.")
    if len(samples) != len(form.samples):
        raise InvalidValueError(
            f"samples: {regressor.__name__} takes {', '.join(form.samples)}, got {len(samples)} "
            "arrays; give drive, columns and friction by name."
        )
    if size < 1:
        raise InvalidValueError(f"size: expected at least one sample in a piece, got {size}.")
    _, rows = _rows(form, model, samples)
    check_log(len(rows[0]), ", ".join(form.samples))
    core, fill = _prepared(form, model, drive, columns, friction)
    buffer = np.empty((form.arrays, min(size, len(rows[0])), *core))
    return _pieces(form, rows, fill, buffer)


def check_log(samples: int, name: str, least: int = 1) -> None:
    """Raise for a log with too few samples; only batches of single calls may be empty."""
    if samples < least:
        wanted = "one sample" if least == 1 else f"{least} samples"
        got = f"has {samples} sample" if samples else "is empty"
        raise InvalidValueError(f"{name}: the log {got}; expected at least {wanted}.")


def _rows(
    form: Form, model: RobotModel, samples: Sequence[ArrayLike]
) -> tuple[tuple[int, ...], list[Array]]:
    """Batch shape and contiguous rows (N, n) of samples."""
    check_model(model)
    pairs = zip(form.samples, samples, strict=True)
    arrays = tuple([as_vector(x, model.n, name) for name, x in pairs])
    return batch_rows(arrays, tuple(form.samples))


def _prepared(
    form: Form,
    model: RobotModel,
    drive: Drives,
    columns: Columns | None,
    friction: Friction | None,
) -> tuple[tuple[int, ...], Callable[..., None]]:
    """Shape of a row of the chosen columns, and the function that fills rows in."""
    blocks = energy_blocks(model, drive) if form.stored else standard_blocks(model, drive, friction)
    chosen = chosen_columns(blocks, columns, model)
    linear = friction_of(model, friction)

    def fill(rows: Sequence[Array], *out: Array) -> None:
        form.fill(model, chosen, linear, rows, *out)

    return (model.n, chosen.count) if form.by_joint else (chosen.count,), fill


def _pieces(
    form: Form, rows: Sequence[Array], fill: Callable[..., None], buffer: Array
) -> Iterator[tuple[slice, Any]]:
    """Fill the buffer ``(arrays, size, ...)`` piece by piece."""
    N, size = len(rows[0]), buffer.shape[1]
    for start in range(0, N, size):
        piece = slice(start, min(start + size, N))
        out = buffer[:, : piece.stop - start]
        fill([x[piece] for x in rows], *out)
        yield piece, form.result(*out)
