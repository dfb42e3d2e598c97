"""Parts of pictures, which many processes and machines draw and one puts together."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

from . import _native as native
from .image import Image

__all__ = ["Part", "merge"]


class Part:
    """Some slabs, some pixels, or both, of a picture (`View.part`). Parts can be pickled and sent.

    Attributes
    ----------
    stats : dict
        Counts and times of drawing it; empty for a part from a file.
    """

    __slots__ = ("__weakref__", "_inputs", "_native", "stats")
    stats: dict[str, Any]
    _native: native.Part
    #: What this process read for it, none of which it may replace.
    _inputs: Sequence[native.Inputs]

    def __init__(self) -> None:
        raise TypeError("parts are made by View.part and Part.open")

    @classmethod
    def _of(cls, drawn: native.Part, stats: dict[str, Any], inputs: Sequence[native.Inputs] = ()) -> Part:
        part = cls.__new__(cls)
        part._native, part.stats, part._inputs = drawn, stats, inputs
        return part

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Part:
        """Opens a part that `save` or ``sheetsplat render`` wrote.

        Parameters
        ----------
        path : path
            An EXR or NPZ file.
        """
        return cls._of(native.Part.open(path), {})

    @classmethod
    def join(cls, parts: Iterable[Part]) -> Part:
        """Merges parts of the same pixels, whose slabs follow one another, into one part.

        `merge` takes it for them. It merges neighbours in pairs, again and again: whoever joins the same pairs gets
        the same bytes.

        Parameters
        ----------
        parts : iterable of Part
            The parts, in any order.

        Raises
        ------
        MergeError
            If there is none, or they are not of one picture and region, overlap, or leave out slabs between them.
        """
        parts = list(parts)
        return cls._of(native.Part.join([part._native for part in parts]), {}, _inputs(parts))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Saves the part as a file that ``sheetsplat merge`` takes, too.

        Parameters
        ----------
        path : path
            ``.exr`` or ``.npz``.

        Raises
        ------
        VolumeError
            If the file is one that this process read for the part, whatever its name; then nothing changes.
        """
        self._native.save(path, self._inputs)

    @property
    def slabs(self) -> tuple[int, int]:
        """The first slab and the one after the last, of those that the scene has."""
        (first, end), (least, most) = self._native.piece[0], self._native.scene_slabs
        return max(first, least), min(end, most)

    @property
    def region(self) -> tuple[int, int, int, int]:
        """The first column, the first row, the width and the height of its pixels."""
        return self._native.piece[1]

    def __reduce__(self) -> Any:
        return _restored, (self._native.name, self._native.to_bytes(), self.stats)

    def __repr__(self) -> str:
        return f"<sheetsplat.Part: slabs {self.slabs}, region {self.region}>"


def _restored(name: str, data: bytes, stats: dict[str, Any]) -> Part:
    return Part._of(native.Part.from_bytes(name, data), stats)


def _inputs(parts: list[Part]) -> list[native.Inputs]:
    return [inputs for part in parts for inputs in part._inputs]


def merge(parts: Iterable[Part]) -> Image:
    """Puts all parts of a picture together, in any order.

    The picture is that of the whole scene: to rounding with ``splatting.opacity_threshold = 1``, and with a threshold T
    to 1 - T of the picture without culling.

    Parameters
    ----------
    parts : iterable of Part
        All parts.

    Returns
    -------
    Image
        The picture.

    Raises
    ------
    MergeError
        If the parts are not of one scene, leave out slabs or pixels, or overlap.
    """
    parts = list(parts)
    return Image._of(native.merge([part._native for part in parts]), {}, None, _inputs(parts))
