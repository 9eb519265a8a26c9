"""Whether a real body can have ten inertial parameters, and if not, why.

P. M. Wensing, S. Kim and J.-J. E. Slotine, "Linear matrix inequalities for physically consistent
inertial parameter identification", IEEE RA-L 3(1), 2018, section III.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import RobotModelsWarning

_ROUNDING = 1e-12


class InertiaWarning(RobotModelsWarning):
    """A link has inertial parameters that no body has."""


@dataclass(frozen=True, slots=True)
class LinkFinding:
    """What the consistency check found for one link.

    Parameters
    ----------
    link : int
        Frame number.
    mass : float
        Kilograms.
    principal_moments : tuple of float
        About the centre of mass, ascending, kg m^2 (about the origin when the mass is zero).
    triangle_gap : float
        Sum of the two smaller principal moments less the largest; negative fails.
    smallest_eigenvalue : float
        Of the 4x4 pseudo-inertia matrix, relative to its trace.
    problems : tuple of str
        One sentence each; empty if a real body can have these parameters.

    Examples
    --------
    >>> LinkFinding(1, 2.0, (0.1, 0.1, 0.1), 0.1, 0.05, ()).is_physical
    True
    """

    link: int
    mass: float
    principal_moments: tuple[float, float, float]
    triangle_gap: float
    smallest_eigenvalue: float
    problems: tuple[str, ...]

    @property
    def is_physical(self) -> bool:
        """Whether nothing was found against the link."""
        return not self.problems

    def __str__(self) -> str:
        verdict = f"not physical: {'; '.join(self.problems)}" if self.problems else "physical"
        return f"link {self.link}: {verdict}"


@dataclass(frozen=True, slots=True)
class ConsistencyReport:
    """Physical consistency of a set of inertial parameters, link by link.

    Parameters
    ----------
    links : tuple of LinkFinding
        In table order.

    Examples
    --------
    >>> from robotmodels.inertia import InertialParameters
    >>> InertialParameters.zeros(1).consistency().is_physical
    False
    """

    links: tuple[LinkFinding, ...]

    @property
    def is_physical(self) -> bool:
        """Whether every link is physical."""
        return all(link.is_physical for link in self.links)

    @property
    def not_physical(self) -> str:
        """What is wrong with which link, in one sentence; empty if nothing is."""
        return "; ".join(
            f"link {link.link}: {', '.join(link.problems)}" for link in self.links if link.problems
        )

    def __str__(self) -> str:
        return "\n".join(map(str, self.links))


def link_finding(j: int, row: Array) -> LinkFinding:
    """Check the ten parameters of the link in row j of the table, from 0."""
    # the findings are those of the row divided by its largest entry: nothing overflows
    largest = float(np.abs(row).max()) or 1.0
    XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = (float(v) for v in row / largest)
    tensor = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
    h = np.array([MX, MY, MZ])
    problems = []
    tensor_c = tensor
    if M > 0:
        with np.errstate(over="ignore", invalid="ignore"):
            S = se3.skew(h / np.sqrt(M))
            tensor_c = tensor + S @ S
        if not np.isfinite(tensor_c).all():
            tensor_c = tensor
            problems.append("hardly any mass for its first moments")
    elif M < 0:
        problems.append(f"negative mass {row[9]:g} kg")
    else:
        problems.append("first moments without mass" if h.any() else "no mass")
    moments = np.linalg.eigvalsh(tensor_c)
    scale = max(float(np.abs(moments).max()), float(np.abs(tensor).max()))
    gap = float(moments[0] + moments[1] - moments[2])
    if moments[0] < -_ROUNDING * scale:
        problems.append(f"a principal moment is {moments[0] * largest:.3g} kg m^2")
    if gap < -_ROUNDING * scale:
        problems.append(f"triangle inequality fails by {-gap * largest:.3g} kg m^2")
    pseudo = np.empty((4, 4))
    pseudo[:3, :3] = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    pseudo[:3, 3] = pseudo[3, :3] = h
    pseudo[3, 3] = M
    trace = float(np.abs(np.diag(pseudo)).sum())
    smallest = float(np.linalg.eigvalsh(pseudo)[0] / trace) if trace else 0.0
    if smallest < -_ROUNDING and not problems:
        problems.append(f"the pseudo-inertia has the eigenvalue {smallest:.3g} of its trace")
    a, b, c = (float(v) * largest for v in moments)
    return LinkFinding(j + 1, float(row[9]), (a, b, c), gap * largest, smallest, tuple(problems))
