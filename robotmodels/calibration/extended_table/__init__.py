"""Base, links and tools as rows of one table: what may deviate and what it moves (1.4.2, 1.4.3)."""
