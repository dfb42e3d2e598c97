"""Warnings: all go to the logger ``sheetsplat``, and those that bear on the picture are also Python's warnings."""

from __future__ import annotations

import logging
import os
import sys
import warnings

from .errors import SheetsplatWarning

__all__ = ["give", "warn"]

_LOGGER = logging.getLogger("sheetsplat")
# Python prints the warnings itself; where nobody has set up a log, it would print them twice.
_LOGGER.addHandler(logging.NullHandler())

_PACKAGE = os.path.dirname(__file__) + os.sep


def give(is_error: bool, bears_on_picture: bool, message: str) -> None:
    """Gives a warning at the user's line: the first that lies outside this package."""
    _LOGGER.log(logging.ERROR if is_error else logging.WARNING, "%s", message)
    if not bears_on_picture:
        return
    level, frame = 1, sys._getframe(0)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, SheetsplatWarning, stacklevel=level)


def warn(message: str) -> None:
    """Warns that a picture is another one than might be expected."""
    give(False, True, message)
