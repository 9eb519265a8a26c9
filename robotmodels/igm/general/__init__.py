"""Every posture of a general six-joint arm, up to 16, by Raghavan and Roth's elimination.

The method needs no special axes, and is the worse the more special they are: with a spherical
wrist or three parallel axes its equations become dependent. Pieper's and Paul's methods serve
those arms; `GeneralSolver.reliable` says whether this one may.

Which of the joints plays which part in the elimination is free: any joint may be the one that
drops out, its two neighbours to one side the pair that is eliminated linearly, and of the other
three an outer one gives the eigenvalues. That makes 24 representations of one robot, equal in
theory and far from it in rounding. `prepare_general` tries them all on random postures and keeps
the best ones.

The way of a pose: `arm` > `postures` > `search`, which takes it through the compiled steps:
`_lines` > `_eigenproblem` (and NumPy's eigenvalues) > `_roots` > `_newton`, and where doubts are
left > `_folds` > `_valleys`.

References
----------
M. Raghavan and B. Roth, "Inverse kinematics of the general 6R manipulator and related linkages",
J. Mechanical Design 115(3):502-508, 1993.
D. Manocha and J. F. Canny, "Efficient inverse kinematics for general 6R manipulators", IEEE
Trans. Robotics and Automation 10(5):648-657, 1994.
"""

from .arm import GeneralArm
from .postures import general_postures, on_infinite_family
from .prepare import prepare_general
from .representation import Representation
from .solver import GeneralSolver

__all__ = [
    "GeneralArm",
    "GeneralSolver",
    "Representation",
    "general_postures",
    "on_infinite_family",
    "prepare_general",
]
