"""The robot as calibrated: a model with its deviations, and the errors that no table holds."""
