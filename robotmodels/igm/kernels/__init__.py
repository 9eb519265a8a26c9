"""Compiled functions of the inverse models."""
