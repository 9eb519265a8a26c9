"""The redundant arm: joints that take their reference, and what is left of the chain."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..loop import JointChain
from .locked_arms import LockedArms


@dataclass(frozen=True, slots=True, eq=False)
class Redundant:
    """An arm with more joints than its task needs."""

    chain: JointChain
    order: tuple[int, ...]
    sampled: tuple[int, ...]
    last: tuple[int, ...]
    inner: str
    arms: LockedArms = field(repr=False)

    @property
    def method(self) -> str:
        """The family in words."""
        numbers = ", ".join(str(j + 1) for j in self.order)
        joints = f"joint{'' if len(self.order) == 1 else 's'} {numbers} at the reference"
        if self.order == self.sampled:
            return f"{joints}; {self.inner}"
        others = ", ".join(str(j + 1) for j in self.sampled)
        return f"{joints}, found from joint{'' if len(self.sampled) == 1 else 's'} {others}; " + (
            self.inner
        )
