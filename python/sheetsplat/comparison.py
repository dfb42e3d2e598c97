"""Differences between pictures."""

from __future__ import annotations

import os
from typing import Any

from . import _native as native
from ._checks import finite, whole
from .errors import GoldenError
from .image import Image

__all__ = ["Comparison", "compare"]


class Comparison:
    """The differences between two pictures of equal size, which `compare` finds. `str` gives a report of several lines.

    Channels are compared as 8-bit numbers, as in a PNG, but premultiplied by alpha.
    """

    _native: native.Comparison

    def __init__(self) -> None:
        raise TypeError("comparisons are made by compare")

    @classmethod
    def _of(cls, differences: native.Comparison) -> Comparison:
        comparison = cls.__new__(cls)
        comparison._native = differences
        return comparison

    @property
    def passes(self) -> bool:
        """Whether the tolerance allows the differences."""
        return self._native.passes

    @property
    def max(self) -> tuple[int, ...]:
        """The largest difference in each channel, RGBA, 0 to 255."""
        return tuple(self._native.max)

    @property
    def worst(self) -> tuple[int, ...]:
        """The pixel with the largest difference: x and y."""
        return tuple(self._native.worst)

    @property
    def mean(self) -> float:
        """The mean difference per channel, 0 to 255."""
        return self._native.mean

    @property
    def psnr_db(self) -> float:
        """The peak signal-to-noise ratio in dB; infinite for equal pictures."""
        return self._native.psnr_db

    @property
    def outliers(self) -> int:
        """The number of pixels in which a channel differs by more than the tolerance."""
        return self._native.outliers

    def difference_image(self) -> Image:
        """Black for no difference, grey within the tolerance, red to yellow beyond it."""
        return Image._of(self._native.difference_image(), {}, None)

    def __str__(self) -> str:
        return str(self._native)


def compare(actual: Any, expected: Any, *, per_channel: int = 3, outliers: float = 0.0) -> Comparison:
    """Compares two pictures.

    Parameters
    ----------
    actual, expected : Image, array or path
        Pictures of equal size.
    per_channel : int
        The steps of 255 by which a channel may differ, at most 16.
    outliers : float
        The fraction of pixels that may differ by more, at most 0.01.

    Returns
    -------
    Comparison
        The differences, and whether the tolerance allows them.

    Raises
    ------
    GoldenError
        If the tolerance would allow visible differences.
    ImageError
        If the pictures are not of one size, or something is no picture.

    Examples
    --------
    >>> import numpy as np
    >>> black, white = np.zeros((4, 4, 3)), np.ones((4, 4, 3))
    >>> compare(black, black).passes, compare(black, white).max
    (True, (255, 255, 255, 0))
    """
    tolerance = _tolerance(per_channel, outliers)
    pictures = [_picture(picture)._array for picture in (actual, expected)]
    return Comparison._of(native.compare(pictures[0], pictures[1], *tolerance))


def _tolerance(per_channel: int, outliers: float) -> tuple[int, float]:
    """A tolerance as the native part takes it, which also refuses what is lax."""
    steps = whole("tolerance per channel", per_channel, 0, 16, GoldenError)
    return steps, finite("share of outliers", outliers, GoldenError)


def _picture(picture: Any) -> Image:
    return Image.open(picture) if isinstance(picture, (str, os.PathLike)) else Image(picture)
