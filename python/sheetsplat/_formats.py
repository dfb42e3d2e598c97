"""Files of pictures that Pillow writes, beside those of the library itself."""

from __future__ import annotations

import io
import os
from typing import TYPE_CHECKING, Any

from . import _native as native
from ._checks import refused
from .errors import ImageError, SceneError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["check", "encoded", "kind_of"]

#: Pillow's names of the formats, by extensions.
_KINDS = {".jpg": "JPEG", ".jpeg": "JPEG", ".tif": "TIFF", ".tiff": "TIFF", ".webp": "WEBP"}

#: Pixels as they are, but for JPEG, whose colours stay within a few of 255.
_OPTIONS: dict[str, dict[str, Any]] = {
    "JPEG": {"quality": 95, "subsampling": 0},
    "TIFF": {"compression": "tiff_adobe_deflate"},
    "WEBP": {"lossless": True, "exact": True},
}


def kind_of(path: str) -> str | None:
    """Pillow's name of a file's format, if Pillow writes it."""
    return _KINDS.get(os.path.splitext(path)[1].lower())


def check(path: str) -> None:
    """Refuses a file that is no picture, before a long render."""
    if kind_of(path) is not None:
        return
    try:
        native.check_format(path)
    except ImageError as error:
        more = f"{', '.join(_KINDS)} (by Pillow)"
        raise ImageError(f"{error}, {more}", error.key, error.found, f"{error.allowed}, {more}") from error


def encoded(pixels: NDArray[np.uint8], path: str, kind: str, depth: int) -> bytes:
    """The bytes of a file of straight 8-bit RGBA."""
    if depth != 8:
        raise refused(SceneError, "depth", str(depth), f"8 bits per channel in {os.path.splitext(path)[1]}")
    try:
        import PIL.Image
    except ImportError as error:
        raise ImportError(f"{path}: this format needs Pillow: pip install 'sheetsplat[movies]'") from error

    if kind == "JPEG":
        least = int(pixels[..., 3].min())
        if least < 255:
            found = f"a pixel with an alpha of {least} of 255"
            raise refused(ImageError, path, found, "opaque pixels, as JPEG has no alpha; or an opaque background, .png or .webp")
        pixels = pixels[..., :3]
    content = io.BytesIO()
    try:
        PIL.Image.fromarray(pixels).save(content, kind, **_OPTIONS[kind])
    except (OSError, ValueError) as error:
        raise ImageError(f"{path}: {error}") from error
    return content.getvalue()
