"""Flexible robots (chapter 7): elastic links and joints, their dynamics and control."""

__all__: list[str] = []
