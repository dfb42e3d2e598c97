"""Pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from . import _formats as formats
from . import _native
from ._checks import refused
from .errors import ImageError, SceneError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import DTypeLike, NDArray

__all__ = ["Image"]


class Image:
    """A picture: ``float32``, height × width × 4, RGB premultiplied by alpha.

    ``np.asarray(image)`` is the picture's own memory, without a copy. A picture shows itself in Jupyter.

    Parameters
    ----------
    array : array or Image
        Height × width × 3 or 4, with any strides: floating-point numbers, premultiplied by alpha; or integers with
        straight alpha, as in a PNG: ``uint16`` from 0 to 65535, and integers of any other type from 0 to 255. Three
        channels are opaque.

    Attributes
    ----------
    stats : dict
        Counts and times of the render, by the names that ``sheetsplat render --stats`` writes; empty for a picture
        from elsewhere.

    Examples
    --------
    >>> import numpy as np
    >>> image = Image(np.zeros((48, 64, 3), dtype=np.uint8))
    >>> image.width, image.height, np.asarray(image)[0, 0].tolist()
    (64, 48, [0.0, 0.0, 0.0, 1.0])
    """

    __slots__ = ("__weakref__", "_array", "_inputs", "_made_on", "_provenance", "stats")
    stats: dict[str, Any]
    _array: NDArray[np.float32]
    _made_on: tuple[str, str] | None
    #: The files that were read for it; it may replace none of them.
    _inputs: Sequence[_native.Inputs]
    #: How it was made, if it was drawn in this process.
    _provenance: _native.Provenance | None

    def __init__(self, array: Any) -> None:
        if isinstance(array, Image):
            self._array, self.stats, self._made_on = array._array, array.stats, array._made_on
            self._inputs, self._provenance = array._inputs, array._provenance
            return
        self._array, self.stats, self._made_on, self._inputs = _premultiplied(array), {}, None, ()
        self._provenance = None

    @classmethod
    def _of(
        cls,
        array: NDArray[np.float32],
        stats: dict[str, Any],
        made_on: tuple[str, str] | None,
        inputs: Sequence[_native.Inputs] = (),
        provenance: _native.Provenance | None = None,
    ) -> Image:
        image = cls.__new__(cls)
        image._array, image.stats, image._made_on, image._inputs = array, stats, made_on, inputs
        image._provenance = provenance
        return image

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Image:
        """Opens a PNG, EXR or NPY file.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        Image
            The picture. It knows whether the native backend made it, if the file says so.

        Raises
        ------
        FileError
            If the file cannot be read.
        ImageError
            If it holds no picture.
        """
        array, made_on = _native.open_image(os.path.expanduser(os.fsdecode(path)))
        return cls._of(array, {}, made_on)

    @property
    def width(self) -> int:
        """Pixels per row."""
        return int(self._array.shape[1])

    @property
    def height(self) -> int:
        """The number of rows."""
        return int(self._array.shape[0])

    @property
    def shape(self) -> tuple[int, int, int]:
        """The number of rows, pixels per row, and channels, which are 4."""
        return self.height, self.width, 4

    def __getitem__(self, place: Any) -> Any:
        """The pixels at some rows and columns, as of the array that `numpy.asarray` gives."""
        return self._array[place]

    def __eq__(self, other: object) -> bool:
        import numpy as np

        if not isinstance(other, Image):
            return NotImplemented
        return np.array_equal(self._array, other._array)

    __hash__ = None  # type: ignore[assignment]

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        import numpy as np

        if dtype is not None and np.dtype(dtype) != self._array.dtype:
            if copy is False:
                raise ValueError(f"a copy is needed for {np.dtype(dtype)}")
            return self._array.astype(dtype)
        return self._array.copy() if copy else self._array

    def to_uint8(self) -> NDArray[np.uint8]:
        """The picture as ``uint8`` with straight alpha, as in a PNG."""
        import numpy as np

        color, alpha = self._array[..., :3], self._array[..., 3:]
        straight = np.divide(color, alpha, out=np.zeros_like(color), where=alpha > 0)
        channels = np.concatenate([straight, alpha], axis=2)
        # A half is rounded up, as in the files that `save` writes.
        return np.clip(np.floor(channels * 255 + np.float32(0.5)), 0, 255).astype(np.uint8)

    def to_pil(self) -> Any:
        """The picture as a ``PIL.Image.Image`` of mode RGBA. Needs Pillow."""
        import PIL.Image

        return PIL.Image.fromarray(self.to_uint8())

    def show(self) -> None:
        """Shows the picture: below the cell in a notebook, else in the machine's program for pictures, which needs Pillow."""
        import sys

        # Only what runs in IPython has loaded it.
        shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
        if shell is not None and hasattr(shell, "kernel"):
            from IPython.display import display

            display(self)
        else:
            self.to_pil().show()

    def save(self, path: str | os.PathLike[str], *, depth: int = 8, metadata: bool = True) -> None:
        """Saves the picture by the file's extension.

        A PNG or EXR file of a picture that was drawn in this process tells how: the scene, the version, the backend, and
        hashes of the pixels and of the files that were read, or of the values of a volume from memory that is still there.
        No folder outside its own is named. `sheetsplat.verify` draws it again.

        Parameters
        ----------
        path : path
            ``.png`` (straight alpha), ``.exr`` or ``.npy`` (both ``float32``, premultiplied); and by Pillow ``.jpg`` (of
            opaque pixels), ``.tif`` and ``.webp`` (without loss), of 8 bits with straight alpha.
        depth : {8, 16}
            Bits per channel of a PNG.
        metadata : bool
            Whether the file tells how the picture was made.

        Raises
        ------
        FileError
            If the file cannot be written; then nothing is left of it.
        ImageError
            If the extension is another one.
        VolumeError
            If the file is one that was read for the picture, whatever its name; then nothing changes.
        """
        if depth not in (8, 16):
            raise refused(SceneError, "depth", repr(depth), "8 or 16 bits per channel")
        name = os.path.expanduser(os.fsdecode(path))
        kind = formats.kind_of(name)
        if kind is not None:
            _native.check_outputs([name], self._inputs)
            _native.write(name, formats.encoded(self.to_uint8(), name, kind, depth), self._inputs)
            return
        formats.check(name)
        _native.save(self._array, name, depth, self._inputs, self._provenance if metadata else None)

    def __reduce__(self) -> Any:
        # The files that were read matter in this process alone.
        return Image._of, (self._array, self.stats, self._made_on)

    def _repr_png_(self) -> bytes:
        return _native.encode(self._array, 8)

    def __repr__(self) -> str:
        return f"<sheetsplat.Image of {self.width}×{self.height} pixels>"


def _premultiplied(source: Any) -> NDArray[np.float32]:
    import numpy as np

    try:
        array = np.asarray(source)
    except Exception as error:
        # Whatever a tensor on a GPU, or another library's array, raises.
        found = f"{type(error).__name__}: {error}"
        raise refused(ImageError, "image", found, "an array of height × width × 3 or 4") from error
    if array.ndim != 3 or array.shape[2] not in (3, 4) or 0 in array.shape:
        shape = "×".join(map(str, array.shape))
        raise refused(ImageError, "image", f"the shape {shape}", "height × width × 3 or 4")
    is_straight = array.dtype.kind in "iu"
    if is_straight:
        full = 65535 if array.dtype == np.uint16 else 255
        low, high = int(array.min()), int(array.max())
        if low < 0 or high > full:
            found = f"{array.dtype} from {low} to {high}"
            raise refused(ImageError, "image", found, "uint16, other integers from 0 to 255, or floating-point numbers")
        channels = array.astype(np.float32) / np.float32(full)
    elif array.dtype.kind == "f":
        channels = array.astype(np.float32)
    else:
        raise refused(ImageError, "image", str(array.dtype), "integers or floating-point numbers")
    if channels.shape[2] == 3:
        opaque = np.ones((*channels.shape[:2], 1), dtype=np.float32)
        return np.concatenate([channels, opaque], axis=2)
    if is_straight:
        channels[..., :3] *= channels[..., 3:]
    return np.ascontiguousarray(channels)
