"""Rank and singular configurations: lost directions, self-motions, the nearest ones."""
