"""Pictures of robots: `show`, `animate` and `jog` give a `Scene`, `plot_*` a Matplotlib figure.

A scene is a meshcat page that needs no network. Figures need the extra ``plots``; Matplotlib is
imported when the first one is drawn.
"""

from .animate import animate
from .calibration_report import html_report
from .camera import Camera
from .identification_report import identification_html
from .jog import jog
from .motion import Motion
from .plot_calibration_in_space import plot_calibration_in_space
from .plot_calibration_normality import plot_calibration_normality
from .plot_calibration_parameters import plot_calibration_correlations, plot_calibration_parameters
from .plot_calibration_residuals import plot_calibration_residuals
from .plot_dynamics_energy import plot_energy
from .plot_dynamics_maps import plot_inertia_map
from .plot_dynamics_torques import plot_torque_parts
from .plot_ellipsoids import plot_ellipsoids
from .plot_excitation import plot_excitation
from .plot_identification_parameters import (
    plot_identification_correlations,
    plot_identification_parameters,
    plot_identification_standard_errors,
)
from .plot_identification_processing import plot_processing
from .plot_identification_residuals import plot_identification_residuals
from .plot_identification_torques import plot_identification_torques
from .plot_inverse_velocities import plot_inverse_velocities
from .plot_joint_motion import plot_joint_motion
from .plot_joint_path import plot_joint_path
from .plot_pose_path import plot_pose_path
from .plot_profiles import plot_profiles
from .plot_selection import plot_selection
from .plot_singularities import plot_singularities
from .plot_trajectory import plot_trajectory
from .plot_units import Unit
from .scene import Scene
from .show import show

__all__ = [
    "Camera",
    "Motion",
    "Scene",
    "Unit",
    "animate",
    "html_report",
    "identification_html",
    "jog",
    "plot_calibration_correlations",
    "plot_calibration_in_space",
    "plot_calibration_normality",
    "plot_calibration_parameters",
    "plot_calibration_residuals",
    "plot_ellipsoids",
    "plot_energy",
    "plot_excitation",
    "plot_identification_correlations",
    "plot_identification_standard_errors",
    "plot_identification_parameters",
    "plot_identification_residuals",
    "plot_identification_torques",
    "plot_inertia_map",
    "plot_inverse_velocities",
    "plot_joint_motion",
    "plot_joint_path",
    "plot_pose_path",
    "plot_processing",
    "plot_profiles",
    "plot_selection",
    "plot_singularities",
    "plot_torque_parts",
    "plot_trajectory",
    "show",
]
