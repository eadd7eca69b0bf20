"""Arguments as the native half takes them."""

from __future__ import annotations

import operator
import os

MAX_U64 = 2**64 - 1


def path(given: str | os.PathLike[str] | None) -> str | None:
    """A path as text."""
    return None if given is None else os.fspath(given)


def whole(name: str, value: int) -> int:
    """A whole number that fits 64 bits; `TypeError` for what is no whole number."""
    number = operator.index(value)
    if not 0 <= number <= MAX_U64:
        raise ValueError(f"{name} = {number} is outside 0 to 2**64 - 1")
    return number
