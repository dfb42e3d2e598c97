"""Many pictures of one volume: turntables and sweeps."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Unpack, overload

from . import _formats as formats
from . import _movies as movies
from . import _native as native
from . import _words as words
from ._checks import refused
from ._settings import Arguments, completed
from .errors import ImageError
from .image import Image
from .scene import Scene
from .view import View, _frames

__all__ = ["orbit", "sweep"]

#: The keyword arguments of turntables, which are told apart from misspelt ones of views.
_OF_ORBITS = ("count", "turn", "frames", "fps")


@overload
def orbit(
    source: Any,
    output: None = None,
    *,
    count: int = 120,
    turn: float = 360.0,
    frames: range | None = None,
    fps: float = 30,
    **arguments: Unpack[Arguments],
) -> Iterator[Image]: ...


@overload
def orbit(
    source: Any,
    output: str | os.PathLike[str],
    *,
    count: int = 120,
    turn: float = 360.0,
    frames: range | None = None,
    fps: float = 30,
    **arguments: Unpack[Arguments],
) -> None: ...


@completed
def orbit(
    source: Any,
    output: str | os.PathLike[str] | None = None,
    *,
    count: int = 120,
    turn: float = 360.0,
    frames: range | None = None,
    fps: float = 30,
    **arguments: Unpack[Arguments],
) -> Iterator[Image] | None:
    """Draws a turntable: an iterator of pictures, or files.

    Parameters
    ----------
    source
        What is drawn, as for `View`.
    output : path, optional
        Numbered pictures (``frame-%04d.png``, ``frame-####.exr``), or a movie (``.gif``, ``.apng``, ``.webp``), which
        needs Pillow. Without it, an iterator of pictures is returned, and each is drawn when it is asked for.
    count, turn, frames
        As for `View.orbit`.
    fps : float
        Pictures per second of a movie.
    **arguments
        As for `View`; `progress` also shows a bar while files are written.

    Yields
    ------
    Image
        The pictures in their order, if no output is given.

    Notes
    -----
    Ctrl-C stops at once: numbered pictures that are complete stay, a movie is not written. A file that is read is never
    written: nothing is drawn then, and a `VolumeError` is raised.
    """
    words.check_names(arguments, [*words.ARGUMENTS, *_OF_ORBITS])
    numbers = _frames(count, frames)
    if output is None:
        return View(source, **arguments).orbit(count=count, turn=turn, frames=frames)
    path = os.path.expanduser(os.fspath(output))
    if movies.is_movie(path):
        paths, save = [path], movies.writer(path, len(numbers), fps)
    else:
        paths, save = _numbered(path, numbers)
    view = View(source, **arguments)
    native.check_outputs(paths, view._inputs)
    save(_shown(view.orbit(count=count, turn=turn, frames=frames), len(numbers), arguments.get("progress", True)))
    return None


def _numbered(output: str, numbers: range) -> tuple[list[str], Callable[[Iterator[Image]], None]]:
    """Numbered files, whose pattern is checked before anything is drawn, and what saves pictures as them."""
    folder, name = os.path.split(output)
    numbered = re.fullmatch(r"([^%#]*)(%d|%0\d{1,2}d|#{1,20})([^%#]*)", name)
    if numbered is None:
        allowed = f"numbered pictures (frame-%04d.png, frame-####.png) or a movie ({', '.join(movies.KINDS)})"
        raise refused(ImageError, "output", output, allowed)
    before, number, after = numbered.groups()
    number = f"%0{len(number)}d" if number.startswith("#") else number
    pattern = os.path.join(folder.replace("%", "%%"), before + number + after)
    formats.check(pattern % 0)
    paths = [pattern % frame for frame in numbers]

    def save(pictures: Iterator[Image]) -> None:
        for path, image in zip(paths, pictures, strict=True):
            image.save(path)

    return paths, save


def _shown(pictures: Iterator[Image], count: int, progress: bool) -> Iterator[Image]:
    if not progress:
        return pictures
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return pictures
    bar: Iterator[Image] = iter(tqdm(pictures, total=count, unit="picture", leave=False))
    return bar


@completed
def sweep(
    source: Any, values: Mapping[str, Sequence[Any]], **arguments: Unpack[Arguments]
) -> Iterator[tuple[dict[str, Any], Image]]:
    """Draws a picture for every combination of values of some settings.

    Parameters
    ----------
    source
        What is drawn, as for `View`.
    values : mapping
        The values of each setting, by its key or word.
    **arguments
        As for `View`.

    Yields
    ------
    tuple of dict and Image
        The settings of a picture, by their keys, and the picture.

    Examples
    --------
    >>> pictures = sweep("builtin:head:16", {"splatting.slab_width": [0.5, 1, 2]}, image={"width": 16, "height": 16})
    >>> [settings["splatting.slab_width"] for settings, image in pictures]
    [0.5, 1, 2]
    """
    view = View(source, **arguments)
    # All scenes are checked before the first is drawn.
    combinations: list[dict[str, Any]]
    combinations = [dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]
    scenes = [(settings, view._with(**settings)) for settings in combinations]
    return _swept(view, scenes)


def _swept(view: View, scenes: list[tuple[dict[str, Any], Scene]]) -> Iterator[tuple[dict[str, Any], Image]]:
    for settings, scene in scenes:
        view.scene = scene
        yield settings, view.render()
