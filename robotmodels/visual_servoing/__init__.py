"""Visual servoing (chapter 6): image features, interaction matrices, tasks, pose, simulation."""

__all__: list[str] = []
