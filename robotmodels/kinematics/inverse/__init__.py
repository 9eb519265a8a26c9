"""Inverse kinematic models: joint velocities and accelerations that give a motion."""
