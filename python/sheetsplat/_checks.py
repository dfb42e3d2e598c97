"""Checks of arguments, whose errors name the argument, what was found and what is allowed."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Sequence
from typing import Any

from .errors import SceneError, VolumeError, _Refused

__all__ = ["finite", "names", "paths", "refused", "volume_refused", "whole"]


def refused(kind: type[_Refused], key: str, found: object, allowed: str) -> _Refused:
    """The error for an argument."""
    return kind(f"{key}: found {found}, allowed: {allowed}", key, str(found), allowed)


def volume_refused(field: str, found: str, allowed: str) -> VolumeError:
    """The error for an array that is no volume."""
    return VolumeError(f"array: {field}: found {found}, allowed: {allowed}", field, found, allowed)


def whole(key: str, value: Any, low: int, high: int, kind: type[_Refused] = SceneError) -> int:
    """A whole number within bounds."""
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or not low <= number <= high:
        raise refused(kind, key, repr(value), f"a whole number from {low} to {high}")
    return number


def finite(key: str, value: Any, kind: type[_Refused] = SceneError) -> float:
    """A finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise refused(kind, key, repr(value), "a finite number")
    return number


def names(annotate: str | Sequence[str]) -> list[str]:
    """The names of annotations: several, or one text with commas."""
    given: Any = annotate.split(",") if isinstance(annotate, str) else annotate
    try:
        texts = list(given)
    except TypeError:
        texts = [None]
    if not all(isinstance(text, str) for text in texts):
        raise refused(SceneError, "annotate", repr(annotate), "names of annotations")
    return texts


def paths(search: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> list[str]:
    """Folders: one, or several."""
    given: Any = [search] if isinstance(search, (str, os.PathLike)) else search
    try:
        return [os.path.expanduser(os.fsdecode(path)) for path in given]
    except TypeError as error:
        raise refused(SceneError, "search", repr(search), "folders") from error
