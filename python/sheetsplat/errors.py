"""Exceptions of this package, each of which is a `ValueError` or an `OSError`, too, and its warning."""

from __future__ import annotations

__all__ = [
    "DeviceError",
    "FileError",
    "GoldenError",
    "ImageError",
    "MergeError",
    "RenderError",
    "SceneError",
    "SheetsplatError",
    "SheetsplatWarning",
    "VolumeError",
]


class SheetsplatError(Exception):
    """Any error of this package."""


class _Refused(SheetsplatError, ValueError):
    """A value that is not allowed.

    Attributes
    ----------
    key : str or None
        The setting or field, as in ``camera.up``, if one is wrong.
    found : str or None
        What was found there.
    allowed : str or None
        What is allowed there.
    """

    def __init__(
        self,
        message: str,
        key: str | None = None,
        found: str | None = None,
        allowed: str | None = None,
    ) -> None:
        super().__init__(message)
        self.key = key
        self.found = found
        self.allowed = allowed


class SceneError(_Refused):
    """A setting is unknown, has the wrong type or is out of range."""


class VolumeError(_Refused):
    """An array or a volume file is not a volume."""


class RenderError(_Refused):
    """A picture exceeds a limit of the backend."""


class ImageError(_Refused):
    """An array or a file is not a picture, or pictures cannot be compared."""


class MergeError(_Refused):
    """Parts are not those of one picture: of other scenes, overlapping, or with gaps."""


class GoldenError(_Refused):
    """A golden's name, tolerance or list of names to bless is invalid."""


class FileError(SheetsplatError, OSError):
    """A file cannot be read or written; ``errno`` and ``filename`` are the operating system's."""


class DeviceError(SheetsplatError, OSError):
    """There is no GPU, it failed, or the operating system starts no threads."""


class SheetsplatWarning(UserWarning):
    """A picture is another one than might be expected: of the first of several times, of axes that were made orthogonal, with holes."""
