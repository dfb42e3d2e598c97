"""Pictures that are drawn again and compared."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from . import _native as native
from ._checks import paths, whole
from .volume import Volume

__all__ = ["Verification", "verify"]


@dataclass(frozen=True)
class Verification:
    """The finding of `verify`, which is true if the picture is the same.

    Parameters
    ----------
    path : str
        The picture.
    reasons : tuple of str
        Why it is not the picture that it says it is; empty if it is.
    version : str
        The version that drew it.
    backend : str
        The backend that drew it.
    deviation : float or None
        The largest difference of the pixels of `oracle` from their evaluation in 64 bits, of 255.
    """

    path: str
    reasons: tuple[str, ...]
    version: str
    backend: str
    deviation: float | None = None

    def __bool__(self) -> bool:
        return not self.reasons

    def __str__(self) -> str:
        verdict = "; ".join(self.reasons) if self.reasons else "the same"
        return f"{self.path}: {verdict}"


def verify(
    path: str | os.PathLike[str],
    volume: Any = None,
    search: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    *,
    oracle: int = 0,
    any_version: bool = False,
) -> Verification:
    """Draws a picture again from the scene in its file, and compares.

    Pictures of the backends ``"cpu"`` and ``"reference"`` are compared bit by bit, those of a GPU on the same adapter
    within 3 of 255.

    Parameters
    ----------
    path : path
        A PNG or EXR file that `Image.save`, or ``sheetsplat render``, wrote.
    volume : Volume, array or path, optional
        The volume that was drawn, if it came from memory.
    search : path or sequence of path
        Folders in which to look for files that are not in the picture's own folder.
    oracle : int
        The number of pixels to evaluate in 64 bits, too.
    any_version : bool
        Accept pictures of other versions whose pixels are the same.

    Returns
    -------
    Verification
        Whether it is the same, and why not.

    Raises
    ------
    FileError
        If the file cannot be read.
    ImageError
        If it cannot be verified: it holds no scene, a file that it names is missing, or it was drawn on another GPU.

    Examples
    --------
    >>> import os, tempfile
    >>> from sheetsplat import render
    >>> folder = tempfile.mkdtemp()
    >>> render("builtin:head:16", size=32).save(os.path.join(folder, "head.png"))
    >>> bool(verify(os.path.join(folder, "head.png")))
    True
    """
    name = os.path.expanduser(os.fsdecode(path))
    pixels = whole("oracle", oracle, 0, 2**32 - 1)
    given = volume if volume is None or isinstance(volume, Volume) else Volume(volume)
    shared = None if given is None else given._native
    reasons, version, backend, deviation = native.verify(name, shared, paths(search), pixels, any_version)
    return Verification(name, tuple(reasons), version, backend, deviation)
