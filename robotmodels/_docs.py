"""Docstrings of families: the head of a file is part of the help of what the file defines."""

from __future__ import annotations

import inspect
import re
import sys
from enum import Enum
from typing import Any

from ._outcomes import Result

_TITLE = re.compile(r"\n([A-Z]\w+(?: \w+)?)\n-{3,}\n")
_ENTRY = re.compile(r"^([\w*][\w*, ]*)( :.*|)$((?:\n(?:    .*|(?=\n    )))*)", re.MULTILINE)
_ORDER = [
    "Parameters", "Attributes", "Returns", "Yields", "Raises", "Notes", "References", "Examples",
]  # fmt: skip


def documented(thing: Any) -> Any:
    """The function or class, with the sections of the head of its file that it has not itself.

    Of the parameters, also those of its room, the ones that it has; of the examples those that call
    it; nothing to a result.
    """
    module = getattr(thing, "__module__", None) or ""
    room, head = (getattr(sys.modules.get(x), "__doc__", "") or "" for x in (_room(module), module))
    is_class = inspect.isclass(thing)
    result = is_class and issubclass(thing, Result | Enum | Exception)
    if result or not (is_class or inspect.isfunction(thing)) or not thing.__doc__:
        return thing
    own, shared, common = _sections(thing.__doc__), _sections(head), _sections(room)
    if f"{thing.__name__}(" not in shared.get("Examples", ""):
        shared.pop("Examples", None)
    if is_class:
        shared.pop("Returns", None)
    texts = [sections.get("Parameters", "") for sections in (own, shared, common)]
    text = shared | own | {"Parameters": _parameters(thing, texts)}
    titles = [title for title in _ORDER if text.get(title)]
    parts = [f"{title}\n{'-' * len(title)}\n{text[title].strip()}" for title in titles]
    thing.__doc__ = "\n\n".join((text[""].strip(), *parts)) + "\n"
    return thing


def document(room: str) -> None:
    """Complete the docstrings of the names that a package lists and has imported."""
    names = vars(sys.modules[room])
    for name in names["__all__"]:
        if name in names:
            documented(names[name])


def _room(module: str) -> str:
    return ".".join(module.split(".")[:2])


def _sections(text: str) -> dict[str, str]:
    """Sections of a docstring by their titles; what is before the first of them by ""."""
    first, *rest = _TITLE.split("\n" + inspect.cleandoc(text))
    return {"": first, **dict(zip(rest[::2], rest[1::2], strict=True))}


def _parameters(thing: Any, texts: list[str]) -> str:
    """Entries of its arguments, each from the first of the texts that has one."""
    entries, missing = [texts[0].strip()], list(inspect.signature(thing).parameters)
    for text in texts:
        found = _ENTRY.findall(text.strip())
        for names, kind, rest in found if text is not texts[0] else ():
            here = [name for name in missing if name in _split(names)]
            if here:  # without a type: arguments of several functions
                entries.append((names + kind if kind else ", ".join(here)) + rest.rstrip())
        known = {name for names, _, _ in found for name in _split(names)}
        missing = [name for name in missing if name not in known]
    return "\n".join(entries).strip()


def _split(names: str) -> list[str]:
    """Names of arguments, without the stars of those that hold several."""
    return names.replace("*", "").split(", ")
