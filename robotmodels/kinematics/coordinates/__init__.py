"""Operational coordinates: forms of a pose as numbers, and their rates."""
