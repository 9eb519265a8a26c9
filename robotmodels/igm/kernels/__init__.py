"""Compiled loops of the inverse models."""
