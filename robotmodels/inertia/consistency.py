"""Physical consistency of the inertial parameters of links.

P. M. Wensing, S. Kim and J.-J. E. Slotine, "Linear matrix inequalities for physically consistent
inertial parameter identification", IEEE RA-L 3(1), 2018, section III.

Parameters
----------
link, problems : int, tuple of str
    Frame number; one sentence each, none if the parameters are physically consistent.
links : tuple of LinkFinding
    In table order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import RobotModelsWarning

_ROUNDING = 1e-12


class InertiaWarning(RobotModelsWarning):
    """A link has inertial parameters that are not physically consistent."""


@dataclass(frozen=True, slots=True)
class LinkFinding:
    """Result of the consistency check of one link."""

    link: int
    problems: tuple[str, ...]

    @property
    def is_physical(self) -> bool:
        """Whether the parameters are physically consistent."""
        return not self.problems

    def __str__(self) -> str:
        verdict = f"not physical: {'; '.join(self.problems)}" if self.problems else "physical"
        return f"link {self.link}: {verdict}"


@dataclass(frozen=True, slots=True)
class ConsistencyReport:
    """Physical consistency of a set of inertial parameters."""

    links: tuple[LinkFinding, ...]

    @property
    def is_physical(self) -> bool:
        """Whether every link is physical."""
        return all(link.is_physical for link in self.links)

    @property
    def not_physical(self) -> str:
        """The problems of all links in one sentence; empty if there are none."""
        return "; ".join(
            f"link {link.link}: {', '.join(link.problems)}" for link in self.links if link.problems
        )

    def __str__(self) -> str:
        return "\n".join(map(str, self.links))


def pseudo_inertia(rows: Array) -> Array:
    """Pseudo-inertia matrices (..., 4, 4) of ten parameters; positive semidefinite for bodies."""
    tensor = rows[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    pseudo = np.empty((*rows.shape[:-1], 4, 4))
    half = 0.5 * np.trace(tensor, axis1=-2, axis2=-1)
    pseudo[..., :3, :3] = half[..., None, None] * np.eye(3) - tensor
    pseudo[..., :3, 3] = pseudo[..., 3, :3] = rows[..., 6:9]
    pseudo[..., 3, 3] = rows[..., 9]
    return pseudo


def link_finding(j: int, row: Array) -> LinkFinding:
    """Check the ten parameters of the link in row j of the table, from 0."""
    largest = float(np.abs(row).max()) or 1.0
    scaled = row / largest  # scaled against overflow
    tensor, h, M = scaled[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]], scaled[6:9], float(scaled[9])
    problems, central = [], tensor
    if M > 0:
        with np.errstate(over="ignore", invalid="ignore"):
            S = se3.skew(h / np.sqrt(M))
            central = tensor + S @ S
        if not np.isfinite(central).all():
            central = tensor
            problems.append("too little mass for its first moments")
    else:
        none = "first moments without mass" if h.any() else "no mass"
        problems.append(f"negative mass {row[9]:g} kg" if M < 0 else none)
    moments = np.linalg.eigvalsh(central)
    rounding = _ROUNDING * max(float(np.abs(moments).max()), float(np.abs(tensor).max()))
    gap = float(moments[0] + moments[1] - moments[2])
    if moments[0] < -rounding:
        problems.append(f"a principal moment is {moments[0] * largest:.3g} kg m^2")
    if gap < -rounding:
        problems.append(f"triangle inequality fails by {-gap * largest:.3g} kg m^2")
    pseudo = pseudo_inertia(scaled)
    share = np.linalg.eigvalsh(pseudo)[0] / (np.abs(np.diag(pseudo)).sum() or 1.0)
    if share < -_ROUNDING and not problems:
        problems.append(f"an eigenvalue of the pseudo-inertia is {share:.3g} of its trace")
    return LinkFinding(j + 1, tuple(problems))
