"""Pictures of robots: `show`, `animate` and `jog` give a `Scene`, `plot_*` a Matplotlib figure.

A scene is a meshcat page that needs no network. Figures need the extra ``plots``; Matplotlib is
imported when the first one is drawn.

Every ``plot_*`` returns a `matplotlib.figure.Figure` that shows itself in a notebook
(``.savefig("arm.pdf")`` writes it), and raises `InvalidValueError` or `ShapeError` for arguments
that do not fit, `MissingExtraError` without Matplotlib. ``title`` is a text over the figure,
``size`` its width and height in inches, shape (2,).
"""

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
