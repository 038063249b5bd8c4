"""What Python expects of a value: equality by content, a hash, and a form for JSON."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


class Value:
    """A dataclass whose fields may be arrays: equal if all fields are, number by number."""

    def __eq__(self, other: object) -> bool:
        """Whether all fields are equal; NaN equals NaN, as a missing taxel does."""
        if type(self) is not type(other):
            return NotImplemented
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return all(_equal(getattr(self, name), getattr(other, name)) for name in names)

    def __hash__(self) -> int:
        """Equal values have equal hashes."""
        return hash(_hashable(self.to_dict()))

    def to_dict(self) -> dict[str, Any]:
        """The fields as lists, numbers and texts, which `json` can write."""
        document: dict[str, Any] = plain(self)
        return document


def plain(value: Any) -> Any:
    """A value without arrays and dataclasses."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_equal, one, other))
    return bool(one == other)


def _hashable(value: Any) -> Any:
    """A plain value as tuples. NaN becomes None, since no NaN has the hash of another."""
    if isinstance(value, dict):
        return tuple((name, _hashable(one)) for name, one in value.items())
    if isinstance(value, list):
        return tuple(map(_hashable, value))
    return None if isinstance(value, float) and value != value else value
