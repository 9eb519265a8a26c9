"""The verdict of a report: what matters of an identification, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...table_text import ReportSection
from ..validation import poor_prediction
from .parameters import kind_names, percent
from .residuals import ResidualDiagnostics
from .weak_parameters import NOT_SEEN, not_seen, understatement, wrong_signs

if TYPE_CHECKING:
    from ..result import IdentificationResult

_MORE = 1.5
"""Errors on data kept aside, relative to those on the log, from which they are named."""
_GOOD_CONDITION = 100.0


def verdict(result: IdentificationResult, found: ResidualDiagnostics) -> ReportSection:
    """What became of the fit, how well it predicts, and what it does not show."""
    estimate = result.estimate
    sentences = [
        f"{estimate.status.sentence} {_capital(estimate.method.value)} of "
        f"{len(result.names)} parameters on {result.reduction.rows} equations "
        f"({result.system.form.value})"
        + (f", {estimate.iterations} iterations." if estimate.iterations > 1 else "."),
        _prediction(result),
    ]
    sentences = [*doubts(result), *sentences]
    weak = not_seen(estimate)
    if weak:
        sentences.append(
            f"{len(weak)} of {len(result.names)} parameters are not seen (relative deviation above "
            f"{100.0 * NOT_SEEN:.0f} %), the least first: {', '.join(weak)}."
        )
    else:
        sentences.append(
            "All parameters are seen: no relative deviation is above "
            f"{100.0 * NOT_SEEN:.0f} % (largest {_largest_percent(result)})."
        )
    if result.unseen:
        sentences.append(f"The log does not tell apart: {', '.join(result.unseen)}.")
    if result.not_essential:
        sentences.append(f"Left out as not essential: {', '.join(result.not_essential)}.")
    sentences.append(_excitation(result))
    sentences.append(_whiteness(result, found))
    sentences += [sign.sentence for sign in wrong_signs(result.base, estimate)]
    return ReportSection("Verdict", tuple(f"* {sentence}" for sentence in sentences))


def without_values(result: IdentificationResult) -> ReportSection:
    """The verdict on a fit whose simulated robot ran away."""
    estimate = result.estimate
    method = _capital(estimate.method.value)
    return ReportSection("Verdict", (f"* {estimate.status.sentence} Method: {method}.",))


def doubts(result: IdentificationResult) -> tuple[str, ...]:
    """What comes before all else: the joints whose torques are predicted badly."""
    doubt = poor_prediction(result.model, result.system.processing, result.fitted, result.held_out)
    return (doubt,) if doubt else ()


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _largest_percent(result: IdentificationResult) -> str:
    k = int(np.argmax(result.relative_deviations))
    return f"{percent(result.relative_deviations[k])}, {result.names[k]}"


def _prediction(result: IdentificationResult) -> str:
    own, aside = result.fitted, result.held_out
    names = result.model.table.joint_names
    text = (
        f"Predicted torques differ from those of the log by {_span(own.relative)} of their size, "
        f"joint by joint (filtered alike: {_span(own.filtered_relative)})"
    )
    if aside is None:
        return (
            f"{text}. No log was kept aside: how well other motion is predicted is not "
            "known; give test= (--test)."
        )
    text += (
        f"; from those kept aside by {_span(aside.relative)} "
        f"(filtered alike: {_span(aside.filtered_relative)})."
    )
    more = [
        f"{name} ({100 * own.relative[j]:.3g} -> {100 * aside.relative[j]:.3g} %)"
        for j, name in enumerate(names)
        if aside.rmse[j] > _MORE * own.rmse[j] and aside.relative[j] > _MORE * own.relative[j]
    ]
    if doubts(result):
        return text
    if more:
        return (
            f"{text} Some err by much more there than on the log: {', '.join(more)}; a log that "
            "excites these joints more would carry over better."
        )
    return f"{text} The parameters carry over to motion that was not fitted."


def _span(values: Array) -> str:
    if not np.isfinite(values).any():
        return "-"
    low, high = 100.0 * float(np.nanmin(values)), 100.0 * float(np.nanmax(values))
    return f"{low:.3g} %" if len(values) == 1 else f"{low:.3g} to {high:.3g} %"


def _excitation(result: IdentificationResult) -> str:
    whole, scaled = result.condition, result.condition_scaled
    text = (
        f"The condition number of the regressor is {whole:.3g} as it is and {scaled:.3g} with "
        "columns of length one: "
    )
    if scaled > _GOOD_CONDITION:
        return (
            f"{text}above {_GOOD_CONDITION:.0f}, the motion hardly tells some parameters apart; an "
            "exciting trajectory would."
        )
    text += "the motion tells the parameters apart"
    if not_seen(result.estimate) and whole > _GOOD_CONDITION:
        return f"{text}; those that are not seen act little on the torques."
    return f"{text}."


def _whiteness(result: IdentificationResult, found: ResidualDiagnostics) -> str:
    factor = understatement(result)
    factor = factor[np.isfinite(factor)]
    names = kind_names(result)
    coloured = [names[j] for j, test in enumerate(found.whiteness) if not test.passed]
    if not coloured:
        text = "The residuals are white."
    elif len(coloured) == len(names):
        text = "The residuals are correlated in time."
    else:
        text = f"The residuals of {', '.join(coloured)} are correlated in time."
    if not factor.size:
        return text
    if not result.lags:
        return f"{text} The deviations hold for white residuals."
    middle = float(np.median(factor))
    way = "smaller" if middle >= 1.0 else "larger"
    return (
        f"{text} The deviations here take correlation over {result.lags} equations into account; "
        f"those for white residuals, which are usually published, are {way} by a factor of "
        f"{max(middle, 1.0 / max(middle, 1e-9)):.2g} (median)."
    )
