"""Turntables as GIF, APNG and WebP files, by Pillow."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from . import _native as native
from ._checks import finite, refused
from .errors import ImageError, SceneError

if TYPE_CHECKING:
    from .image import Image

__all__ = ["KINDS", "is_movie", "writer"]

#: Pillow's names of the formats, by extensions.
KINDS = {".gif": "GIF", ".apng": "PNG", ".webp": "WEBP"}


def is_movie(output: str) -> bool:
    """Whether a path is that of a movie."""
    return output.lower().endswith(tuple(KINDS))


def writer(output: str, count: int, fps: float) -> Callable[[Iterator[Image]], None]:
    """What writes the pictures of a movie into a file. All that can be checked is checked before a picture is drawn."""
    import PIL.Image

    rate = finite("fps", fps)
    if not 0 < rate <= 1000:
        raise refused(SceneError, "fps", repr(fps), "more than 0 and at most 1000 pictures per second")
    if count == 0:
        raise refused(SceneError, "frames", "no picture", "at least one picture in a movie")
    kind = KINDS[os.path.splitext(output)[1].lower()]
    PIL.Image.init()
    if kind not in PIL.Image.SAVE_ALL:
        raise refused(ImageError, "output", output, "a movie that this Pillow writes")

    def write(pictures: Iterator[Image]) -> None:
        # Pictures of 8 bits take a quarter of the memory.
        inputs: Sequence[native.Inputs] = ()
        frames = []
        for picture in pictures:
            inputs = picture._inputs
            frames.append(picture.to_pil())
        first, *others = frames
        movie = io.BytesIO()
        try:
            first.save(movie, kind, save_all=True, append_images=others, duration=1000 / rate, loop=0)
        except (OSError, ValueError) as error:
            raise ImageError(f"{output}: {error}") from error
        native.write(output, movie.getvalue(), inputs)

    return write
