"""What became identifiable, or ceased to be, between two answers."""

from __future__ import annotations

from dataclasses import dataclass

from ..._arrays import Rebuilt
from ...errors import InvalidValueError
from .identifiable import IdentifiableParameters


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiabilityChange(Rebuilt):
    """Two answers to which parameters are identifiable.

    Parameters
    ----------
    gained, lost : tuple of str
        Parameters that only the second answer keeps, and only the first.
    before, after : IdentifiableParameters
        The answers.

    References
    ----------
    Seed book section 1.4.4.2.
    """

    gained: tuple[str, ...]
    lost: tuple[str, ...]
    before: IdentifiableParameters
    after: IdentifiableParameters

    @property
    def is_same(self) -> bool:
        """Whether both keep the same parameters."""
        return not self.gained and not self.lost

    def __str__(self) -> str:
        if self.is_same:
            return f"The same {self.after.count} parameters are identifiable in both."
        parts = []
        if self.gained:
            parts.append(f"{', '.join(self.gained)} became identifiable")
        if self.lost:
            why = [f"{name} ({self.after.reasons[name].value})" for name in self.lost]
            parts.append(f"{', '.join(why)} is no longer estimated")
        low, _ = self.after.gap
        return (
            f"{self.before.count} parameters were identifiable, now {self.after.count}: "
            f"{'; '.join(parts)}. The smallest angle kept is now {low:.1e} (sine): parameters "
            "that small deviations alone make identifiable are badly determined."
        )


def identifiability_change(
    before: IdentifiableParameters, after: IdentifiableParameters
) -> IdentifiabilityChange:
    """Compare what is identifiable, for instance at the nominal robot and at the solution.

    Parameters
    ----------
    before, after : IdentifiableParameters
        Of the same candidates.

    Returns
    -------
    IdentifiabilityChange
        It prints as a sentence.

    Raises
    ------
    InvalidValueError
        Other candidates.

    Examples
    --------
    >>> from robotmodels.calibration.identifiability.structural import identifiable_parameters
    >>> from robotmodels.robots import load
    >>> robot = load("rx90")
    >>> nominal = identifiable_parameters(robot, "position")
    >>> solved = identifiable_parameters(robot, "position", deviation={"d7": 2e-3})
    >>> "theta5" in identifiability_change(nominal, solved).gained
    True
    """
    if before.candidates.names != after.candidates.names:
        raise InvalidValueError(
            "after: expected an answer for the same candidate parameters as before, got "
            f"{len(after.candidates)} against {len(before.candidates)}, or other names."
        )
    order = after.candidates.names
    return IdentifiabilityChange(
        gained=tuple(n for n in order if n in after.names and n not in before.names),
        lost=tuple(n for n in order if n in before.names and n not in after.names),
        before=before,
        after=after,
    )
