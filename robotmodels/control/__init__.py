"""Control in free and constrained space (chapter 5): laws as values, and their simulation."""

__all__: list[str] = []
