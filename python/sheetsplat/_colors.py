"""Colour maps by their names in matplotlib, and opacities by their names in PyVista."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from typing import Any

from . import _native as native
from ._checks import refused
from .errors import SceneError

__all__ = ["OPACITIES", "color_map", "colormaps", "opacities", "over"]

#: The palette of the volume's own file, which has no colours before the volume is known.
_FILE = "file"

#: The largest number of colours that are taken of a map: of matplotlib's 256 the first and then every fifth.
_MOST = 52

#: The names of opacities.
OPACITIES = ("sigmoid", "linear", "linear_r")

#: The logistic function 1 / (1 + e⁻ˢ) runs from -10 to 10.
_REACH = 10.0

#: The control points of the logistic function.
_POINTS = 33


def colormaps() -> list[str]:
    """The names of the colour maps that `cmap` takes everywhere; beside them, those of matplotlib where it is installed.

    Returns
    -------
    list of str
        The names; with ``_r`` a map is reversed.

    Examples
    --------
    >>> [name for name in colormaps() if "viridis" in name]
    ['viridis', 'viridis_r']
    """
    return [name + end for name in native.colormaps() for end in ("", "_r") if name != _FILE or not end]


def color_map(word: str, cmap: Any) -> str | list[Any]:
    """The name of a map that scene files have, or evenly spaced colours."""
    if isinstance(cmap, str):
        return _named(word, cmap)
    if callable(cmap):
        return _sampled(word, cmap)
    try:
        colors = list(cmap)
    except TypeError:
        colors = []
    if not colors:
        raise refused(SceneError, word, repr(cmap), "the name of a colour map, one of matplotlib's, or colours")
    return colors


def _named(word: str, name: str) -> str | list[Any]:
    if name in native.colormaps():
        return name
    forward = native.colormap(name.removesuffix("_r"))
    if forward is not None:
        return [list(color) for color in reversed(forward)]
    others: dict[str, Any] = {}
    try:
        import matplotlib

        others = dict(matplotlib.colormaps)
    except ImportError:
        pass
    if name in others:
        return _sampled(word, others[name])
    near = difflib.get_close_matches(name, [*colormaps(), *others], n=1)
    found = f"{name!r} (perhaps {near[0]})" if near else repr(name)
    more = "matplotlib's" if others else "those of matplotlib, which is not installed"
    raise refused(SceneError, word, found, f"{', '.join(colormaps())}, or {more}")


def _sampled(word: str, cmap: Any) -> list[Any]:
    """The colours of a map of matplotlib, without their alpha."""
    import numpy as np

    count = int(getattr(cmap, "N", _MOST))
    try:
        places = np.linspace(0, count - 1, min(count, _MOST)).round().astype(int)
        colors = np.asarray(cmap(places if hasattr(cmap, "N") else places / (count - 1)), dtype=float)
    except Exception as error:
        # Whatever a function raises that is no colour map.
        raise refused(SceneError, word, f"{type(error).__name__}: {error}", "a colour map of matplotlib") from error
    if colors.ndim != 2 or colors.shape[1] not in (3, 4):
        raise refused(SceneError, word, f"colours of the shape {colors.shape}", "a colour map of matplotlib")
    return [[float(part) for part in color] for color in colors[:, :3].clip(0, 1)]


def opacities(word: str, opacity: Any) -> list[Any]:
    """Evenly spaced opacities, or control points, each a list of a value and its opacity."""
    if isinstance(opacity, str):
        if opacity not in OPACITIES:
            near = difflib.get_close_matches(opacity, OPACITIES, n=1)
            found = f"{opacity!r} (perhaps {near[0]})" if near else repr(opacity)
            raise refused(SceneError, word, found, _ALLOWED)
        return _curve(opacity)
    try:
        points = [[float(part) for part in point] if hasattr(point, "__len__") else float(point) for point in opacity]
    except (TypeError, ValueError):
        points = []
    are_even = all(isinstance(point, float) for point in points)
    are_pairs = all(isinstance(point, list) and len(point) == 2 for point in points)
    if not points or not (are_even or are_pairs):
        raise refused(SceneError, word, repr(opacity), _ALLOWED)
    return points


_ALLOWED = f"{', '.join(OPACITIES)}, opacities from 0 to 1 evenly over the values, or pairs of a value and its opacity"


def _curve(name: str) -> list[float]:
    if name == "sigmoid":
        steps = [_REACH * (2 * at / (_POINTS - 1) - 1) for at in range(_POINTS)]
        # In steps of 1 of 255, so that the least values are not drawn at all.
        return [round(255 / (1 + math.exp(-step))) / 255 for step in steps]
    return [0.0, 1.0] if name == "linear" else [1.0, 0.0]


def over(points: Sequence[Any], low: float, high: float) -> list[list[Any]]:
    """Control points: some things evenly over values from `low` to `high`."""
    last = len(points) - 1
    if last == 0 or low == high:
        return [[low, points[-1]]]
    # Halves are used because the range may exceed the largest float.
    return [[2 * (low / 2 + (high / 2 - low / 2) * (at / last)), point] for at, point in enumerate(points)]
