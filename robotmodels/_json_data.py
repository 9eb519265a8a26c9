"""Data of JSON files: lists, numbers, text and mappings."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np


def json_data(value: Any) -> Any:
    """Content of a JSON file: null for numbers that are not finite, names of enumerations.

    Objects of other types, such as robots, are represented by their name.
    """
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, np.ndarray | np.generic):
        return json_data(value.tolist())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, dict):
        return {str(key): json_data(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [json_data(part) for part in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: json_data(getattr(value, field.name)) for field in fields(value)}
    return str(getattr(value, "name", value))
