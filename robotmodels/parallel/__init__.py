"""Parallel robots (chapter 2): geometric models, statics, singularities, workspaces, dynamics."""

from .assembly import AssemblyModes, AssemblyStatus, assembly_modes
from .direct import PlatformPoses, PoseStatus, dgm
from .families import delta, five_bar, gough, gough_symmetric, planar_3rpr, planar_3rrr
from .legs import LegSolutions, LegStatus, igm
from .robot import Family, ParallelRobot
