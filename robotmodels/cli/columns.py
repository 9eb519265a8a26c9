"""Columns of files as the command line names them: by name, or by number from 0."""

from __future__ import annotations


def column(word: str) -> int | str:
    """A column by number where the word is one, else by name.

    Parameters
    ----------
    word : str
        As it was given.

    Returns
    -------
    int or str
        Number or name.

    Examples
    --------
    >>> column("3"), column("-1"), column("q1")
    (3, -1, 'q1')
    """
    return int(word) if word.lstrip("-").isdecimal() else word


def columns(words: list[str] | None) -> list[int | str] | None:
    """Columns of an option that may be missing.

    Parameters
    ----------
    words : list of str or None
        As they were given.

    Returns
    -------
    list of (int or str), or None
        Numbers and names.

    Examples
    --------
    >>> columns(["0", "y"])
    [0, 'y']
    """
    return None if words is None else [column(word) for word in words]
