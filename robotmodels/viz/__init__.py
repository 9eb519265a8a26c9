"""Pictures of robots: `show`, `animate` and `jog` give a `Scene`, `plot_*` a Matplotlib figure.

A scene is a meshcat page that needs no network: a notebook displays it, and
``.save("arm.html")`` writes it. Figures need the extra ``plots``; Matplotlib is imported when the
first one is drawn. A figure is a `matplotlib.figure.Figure` that a notebook displays, and
``.savefig("arm.pdf")`` writes it. Arguments that do not fit raise `InvalidValueError` or
`ShapeError`, a package that is not installed `MissingExtraError`.

Parameters
----------
**look : title (str), size (array_like, shape (2,))
    Of every figure: a text over it, its width and height in inches.
**options
    Of scenes, as for `show`.
model : RobotModel
    The robot of n joints, whose names and units of joints are used.
names, units : sequences of str, n each, optional
    In place of these; a unit is ``rad``, ``deg``, ``m``, ``mm``, or a `Unit`.
limits : MotionLimits, optional
    Drawn as dashed lines, in the colour of their joint or grey where all joints share them, with
    values beyond them underlaid in red.
degrees : bool
    Whether angles are in degrees instead of radians.
columns : int, optional
    Number of panels in a row.
view : array_like, shape (2,), optional
    Azimuth and elevation from which a scene or axes in space are seen, rad.
height : int
    Pixels of a scene in a notebook.
dark : bool
    Whether the background of a scene is dark.
"""

from .. import _docs
from .calibration import (
    plot_calibration_correlations,
    plot_calibration_in_space,
    plot_calibration_normality,
    plot_calibration_parameters,
    plot_calibration_residuals,
    plot_selection,
)
from .camera import Camera
from .control import animate_control, plot_control, plot_surface
from .dynamics import plot_energy, plot_inertia_map, plot_torque_parts
from .flexible import plot_frequencies, plot_modes, show_flexible
from .identification import (
    plot_excitation,
    plot_identification_correlations,
    plot_identification_parameters,
    plot_identification_residuals,
    plot_identification_standard_errors,
    plot_identification_torques,
)
from .motion import Motion
from .over_time import Unit
from .parallel import jog_parallel, plot_assembly_modes, plot_platform_workspace, show_parallel
from .performance import plot_aspects, plot_feasible_path, plot_workspace, show_workspace
from .processing import plot_processing
from .report import html_report, identification_html
from .scene import Scene
from .show import animate, jog, show
from .time_optimal import plot_joint_motion, plot_phase_plane, plot_plan
from .trajectories import plot_joint_path, plot_pose_path, plot_profiles, plot_trajectory
from .velocities import plot_ellipsoids, plot_inverse_velocities, plot_singularities
from .visual_servoing import plot_servo, show_servo

__all__ = [
    "Camera",
    "Motion",
    "Scene",
    "Unit",
    "animate",
    "animate_control",
    "html_report",
    "identification_html",
    "jog",
    "jog_parallel",
    "plot_aspects",
    "plot_assembly_modes",
    "plot_calibration_correlations",
    "plot_calibration_in_space",
    "plot_calibration_normality",
    "plot_calibration_parameters",
    "plot_calibration_residuals",
    "plot_control",
    "plot_ellipsoids",
    "plot_energy",
    "plot_excitation",
    "plot_feasible_path",
    "plot_frequencies",
    "plot_identification_correlations",
    "plot_identification_parameters",
    "plot_identification_residuals",
    "plot_identification_standard_errors",
    "plot_identification_torques",
    "plot_inertia_map",
    "plot_inverse_velocities",
    "plot_joint_motion",
    "plot_joint_path",
    "plot_modes",
    "plot_phase_plane",
    "plot_plan",
    "plot_platform_workspace",
    "plot_pose_path",
    "plot_processing",
    "plot_profiles",
    "plot_selection",
    "plot_servo",
    "plot_singularities",
    "plot_surface",
    "plot_torque_parts",
    "plot_trajectory",
    "plot_workspace",
    "show",
    "show_flexible",
    "show_parallel",
    "show_servo",
    "show_workspace",
]

_docs.document(__name__)
