"""Configurations that show the parameters best."""
