"""Help of functions and classes, completed from the docstrings of their file and package.

Members of a family share one docstring at the head of their file; `help` shows it with each.
"""

from __future__ import annotations

import inspect
import re
import sys
from enum import Enum
from typing import Any

from ._outcomes import Result

_TITLE = re.compile(r"\n([A-Z]\w+(?: \w+)?)\n-{3,}\n")
_ENTRY = re.compile(r"^([\w*][\w*, ]*)( :.*|)$((?:\n(?:    .*|(?=\n    )))*)", re.MULTILINE)
_LAST = ("References", "Examples")


def documented(thing: Any) -> Any:
    """A function or class whose docstring has the sections of its file that it lacks itself.

    Parameters come from the file and the package, but only those of its own arguments; examples
    only if they call it. Classes of results are left as they are: their fields are their own.
    """
    module = getattr(thing, "__module__", None) or ""
    package = ".".join(module.split(".")[:2])
    head, common = (getattr(sys.modules.get(x), "__doc__", "") or "" for x in (module, package))
    is_class = inspect.isclass(thing)
    result = is_class and issubclass(thing, Result | Enum | Exception)
    if result or not (is_class or inspect.isfunction(thing)) or not thing.__doc__:
        return thing
    own, shared = _sections(thing.__doc__), _sections(head)
    if f"{thing.__name__}(" not in shared.get("Examples", ""):
        shared.pop("Examples", None)
    if is_class:
        shared.pop("Returns", None)
    texts = [x.get("Parameters", "") for x in (own, shared, _sections(common))]
    text = shared | own | {"Parameters": _parameters(thing, texts)}
    between = [title for title in text if title not in ("", "Parameters", *_LAST)]
    titles = [title for title in ("Parameters", *between, *_LAST) if text.get(title)]
    parts = [f"{title}\n{'-' * len(title)}\n{text[title].strip()}" for title in titles]
    thing.__doc__ = "\n\n".join((text[""].strip(), *parts)) + "\n"
    return thing


def document(package: str) -> None:
    """Complete the docstrings of the names in ``__all__`` that the package has imported."""
    names = vars(sys.modules[package])
    for name in names["__all__"]:
        if name in names:
            documented(names[name])


def _sections(text: str) -> dict[str, str]:
    """Sections of a docstring by title; the text before the first one has the title ""."""
    first, *rest = _TITLE.split("\n" + inspect.cleandoc(text))
    return {"": first, **dict(zip(rest[::2], rest[1::2], strict=True))}


def _parameters(thing: Any, texts: list[str]) -> str:
    """Entries of the arguments, each from the first text that has one."""
    entries, missing = [texts[0].strip()], list(inspect.signature(thing).parameters)
    for text in texts:
        found = _ENTRY.findall(text.strip())
        for names, kind, rest in found if text is not texts[0] else ():
            here = [name for name in missing if name in _split(names)]
            if here:  # an entry without a type lists arguments of several functions
                entries.append((names + kind if kind else ", ".join(here)) + rest.rstrip())
        known = {name for names, _, _ in found for name in _split(names)}
        missing = [name for name in missing if name not in known]
    return "\n".join(entries).strip()


def _split(names: str) -> list[str]:
    """Names of arguments, without the stars of ``*args`` and ``**kwargs``."""
    return names.replace("*", "").split(", ")
