"""Methods of identification by name, with options as text."""

from __future__ import annotations

import re
from ast import literal_eval
from dataclasses import fields
from typing import Any

from ..errors import InvalidValueError
from .closed_loop import Didim, Instrumental, OutputError
from .methods.base import Method
from .methods.linear import Irls, Ols, Ridge, Robust, Total, Wls
from .methods.sequential import Recursive, Sequential

_OBJECTS = ("prior", "controller")  # options that are objects and have no text form
_WORDS = {"true": "True", "false": "False", "none": "None"}

_OF_MEASURED_MOTION = (Ols, Wls, Irls, Robust, Total, Ridge, Sequential, Recursive)
_OF_SIMULATED_MOTION = (Instrumental, Didim, OutputError)
METHODS: dict[str, type[Method]] = {
    kind.name: kind for kind in (*_OF_MEASURED_MOTION, *_OF_SIMULATED_MOTION)
}


def method_of(choice: Method | str) -> Method:
    """The method of a name such as "wls", of text such as "robust:loss=tukey", or as given."""
    if isinstance(choice, Method):
        return choice
    if isinstance(choice, type) and issubclass(choice, Method):
        raise InvalidValueError(
            f"method: expected an object, got its class; give {choice.__name__}()."
        )
    name, _, options = choice.partition(":") if isinstance(choice, str) else ("", "", "")
    kind = METHODS.get(name.strip().lower())
    if kind is None:
        raise InvalidValueError(
            f"method: expected one of {', '.join(METHODS)}, or an object such as "
            f"Robust(loss='tukey'), got {choice!r:.60}."
        )
    texts = [text for text in re.split(r",(?=\s*\w+\s*=)", options) if text.strip()]
    return kind(**dict(_option(kind, text) for text in texts))


def _option(kind: type[Method], text: str) -> tuple[str, Any]:
    """An option ``name=value`` of a method."""
    name, _, value = (part.strip() for part in text.partition("="))
    known = [field.name for field in fields(kind) if field.name not in _OBJECTS]
    if name not in known or not value:
        raise InvalidValueError(
            f"method: {kind.name} has the options {', '.join(known)}, given as name=value, got "
            f"{text!r:.60}. From Python, {kind.__name__}(...) accepts robots and arrays too."
        )
    try:
        return name, literal_eval(_WORDS.get(value.lower(), value))
    except (ValueError, SyntaxError):
        return name, value
