"""Parallel robots as kinematic loops."""
from __future__ import annotations
class LoopedPlatform:
    pass
