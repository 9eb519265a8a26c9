"""Performance analysis (chapter 3): accessibility, workspaces, aspects, cusps, paths, dexterity."""

__all__: list[str] = []
