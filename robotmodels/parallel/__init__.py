"""Parallel robots (chapter 2): geometric models, statics, singularities, workspaces, dynamics."""

__all__: list[str] = []
