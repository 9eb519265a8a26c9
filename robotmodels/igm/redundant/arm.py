"""The redundant arm: joints that take their reference, and what is left of the chain."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..loop import JointChain
from .locked_arms import LockedArms


@dataclass(frozen=True, slots=True, eq=False)
class Redundant:
    """An arm with more joints than its task needs.

    Parameters
    ----------
    chain : JointChain
        The arm, virtual joints among its joints.
    order : tuple of int
        Joints that take the reference, ascending.
    sampled : tuple of int
        Joints by which members of a family are found: the same if the arm without them has a
        family of its own.
    last : tuple of int
        The last joints that may be set, by which members are found as well: what stands at the
        reference may leave few poses in reach, a wrist leaves most. Empty where they are the same
        or have no family without them.
    inner : str
        Method of the joints that are left.
    arms : LockedArms
        Chains prepared so far.
    """

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
