"""Columns of files as the command line names them: by name, or by number from 0."""

from __future__ import annotations


def column(word: str) -> int | str:
    """Column by its number or its name."""
    return int(word) if word.lstrip("-").isdecimal() else word


def columns(words: list[str] | None) -> list[int | str] | None:
    """Columns of an option that may be missing."""
    return None if words is None else [column(word) for word in words]
