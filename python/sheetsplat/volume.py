"""Volumes from arrays, images of other libraries, and files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from . import _native as native
from ._checks import whole
from ._loading import loading
from .errors import VolumeError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Volume"]

_BUILTIN = "builtin:"

#: Converts the directions of LPS, which ITK uses, to RAS.
_RAS_FROM_LPS = (-1.0, -1.0, 1.0)


class Volume:
    """A scalar volume on a rectilinear grid, shared by all pictures of it.

    Parameters
    ----------
    source : array, SimpleITK or nibabel image, path or Volume
        An array ``[z, y, x]`` of any integer or floating-point type, with any strides, or anything with ``__array__``
        (xarray, dask, zarr, torch on the CPU). Its values are copied as ``float32``; NaN and infinite ones, and those
        beyond the range of ``float32``, are holes, which are not drawn. An image of SimpleITK or nibabel, which also gives spacing and orientation. A path of a volume file or
        of a folder of slices. Or ``"builtin:NAME"``.
    spacing : float or three floats, optional
        World units between voxels, in the order of an array's axes: z, y, x. Replaces the source's own.
    labels : array, optional
        The segment of each voxel, whole numbers from 0 to 65535, of the same shape.
    channel_axis : int, optional
        The axis of an array of four dimensions along which channels follow one another; the others are z, y, x.
    memory : int or str, optional
        Bytes that the values (4 for each voxel of each channel) and labels (2 for each voxel) may take, such as
        ``"2GiB"``; three quarters of the machine's without it. An array that takes more is refused before it is copied; a
        volume of a path that takes more, and can be read by boxes, is streamed: read while it is drawn.
    progress : bool
        Show a bar while a path is read for more than a second, if tqdm is installed.
    index : str or path, optional
        The ranges of the values in a path's chunks, made by ``sheetsplat index``: of a volume that is streamed, chunks are not
        read whose values cannot be seen.
    channel, time, level : int, optional
        The channel, the time and the level of a path that holds several, counted from 0: all channels, the first time
        and the finest level without them.

    Examples
    --------
    >>> import numpy as np
    >>> volume = Volume(np.arange(24, dtype=np.int16).reshape(2, 3, 4), spacing=(2, 1, 1))
    >>> volume.shape, volume.spacing
    ((2, 3, 4), (2.0, 1.0, 1.0))
    """

    _native: native.Volume

    def __init__(
        self,
        source: Any,
        *,
        spacing: float | Sequence[float] | None = None,
        labels: Any = None,
        channel_axis: int | None = None,
        memory: int | str | None = None,
        progress: bool = True,
        channel: int | None = None,
        time: int | None = None,
        level: int | None = None,
        index: str | os.PathLike[str] | None = None,
    ) -> None:
        steps = None if spacing is None else _spacing(spacing)
        limit = _memory(memory)
        if channel_axis is None and isinstance(source, (str, os.PathLike)):
            self._native = _open(source, memory, progress, [channel, time, level], None, steps, labels, index)
            return
        if channel_axis is None and isinstance(source, Volume):
            tags = None if labels is None else _array(labels, "labels", [], limit)
            self._native = source._native
            if steps is not None or tags is not None:
                self._native = self._native.replaced(steps, tags, limit)
            return
        axes: list[list[float]] | None = None
        own_spacing, origin = (1.0, 1.0, 1.0), [0.0, 0.0, 0.0]
        if channel_axis is not None:
            channels = _channels(source, channel_axis, limit)
        else:
            array, own_spacing, axes, origin = _converted(source, limit)
            channels = [array]
        tags = None if labels is None else _array(labels, "labels", [_bytes(values) for values in channels], limit)
        self._native = native.Volume.from_arrays(channels, steps or own_spacing, tags, axes, origin, limit)

    @classmethod
    def _of(cls, shared: native.Volume) -> Volume:
        volume = cls.__new__(cls)
        volume._native = shared
        return volume

    @property
    def shape(self) -> tuple[int, int, int]:
        """The number of voxels along z, y and x."""
        z, y, x = self._native.shape
        return z, y, x

    @property
    def spacing(self) -> tuple[float, float, float]:
        """World units between voxels along z, y and x."""
        z, y, x = self._native.spacing
        return z, y, x

    @property
    def nbytes(self) -> int:
        """The bytes of memory that the values of all channels take, in the fewest bits that hold them; if the volume is streamed, those of a sample."""
        return self._native.nbytes

    @property
    def channels(self) -> int:
        """The number of channels."""
        return self._native.channels

    @property
    def unit(self) -> str | None:
        """The name of the world unit, if the file states it."""
        return self._native.unit

    @property
    def holes(self) -> int:
        """The number of voxels whose values are NaN or infinite; in a sample of the values if the volume is streamed."""
        return self._native.holes

    @property
    def streamed(self) -> bool:
        """Whether the volume is read while it is drawn, as it does not fit into memory."""
        return self._native.streamed

    @property
    def level(self) -> int:
        """The level that is drawn, 0 for the finest."""
        return self._native.level

    @property
    def values(self) -> NDArray[np.float32]:
        """A copy of the values, ``[z, y, x]``, of the first channel if there are several; holes are NaN."""
        return self._native.values(0)

    def values_of(self, channel: int) -> NDArray[np.float32]:
        """A copy of the values of a channel, ``[z, y, x]``; holes are NaN.

        Parameters
        ----------
        channel : int
            Its number, from 0.
        """
        return self._native.values(whole("channel", channel, 0, self.channels - 1, VolumeError))

    def info(self) -> dict[str, Any]:
        """Facts about the volume: its grid, the distribution of its values, and the preset that suits it.

        Of a volume that is streamed the distribution is that of a sample of the values.

        Returns
        -------
        dict
            The facts, by the names of ``sheetsplat info --json``; sizes and spacings are in the order z, y, x.
        """
        return self._native.info()

    def __repr__(self) -> str:
        z, y, x = self.shape
        return f"<sheetsplat.Volume of {z}×{y}×{x} voxels, spacing {self.spacing}>"


def _open(
    path: str | os.PathLike[str],
    memory: int | str | None,
    progress: bool,
    selection: list[int | None],
    scene: native.Scene | None,
    spacing: tuple[float, float, float] | None = None,
    labels: Any = None,
    index: str | os.PathLike[str] | None = None,
) -> native.Volume:
    name, limit = os.fsdecode(path), _memory(memory)
    selection = [
        None if number is None else whole(key, number, 0, 2**32 - 1, VolumeError)
        for key, number in zip(("channel", "time", "level"), selection, strict=True)
    ]
    tags = None if labels is None else _array(labels, "labels", [], limit)
    if name.startswith(_BUILTIN):
        progress = False
    with loading(name, progress) as bytes_read:
        return native.Volume.open(name, limit, selection, scene, bytes_read, (spacing, tags), index)


def _memory(memory: int | str | None) -> str | None:
    return None if memory is None else str(memory)


def _spacing(spacing: Any) -> tuple[float, float, float]:
    try:
        numbers = [float(number) for number in (spacing if hasattr(spacing, "__len__") else [spacing] * 3)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 3:
        raise _refused("spacing", repr(spacing), "a number, or three numbers z, y, x")
    return numbers[0], numbers[1], numbers[2]


def _refused(field: str, found: str, allowed: str) -> VolumeError:
    return VolumeError(f"array: {field}: found {found}, allowed: {allowed}", field, found, allowed)


def _numpy(source: Any, name: str, allowed: str) -> NDArray[Any]:
    """The array of NumPy that a source is, holds or computes, whatever errors that raises."""
    import numpy as np

    try:
        return np.asarray(source)
    except Exception as error:
        # A list of other shapes, a tensor on a GPU or with gradients, a file that was removed, a task that failed.
        raise _refused(name, f"{type(error).__name__}: {error}", allowed) from error


def _bytes(source: Any) -> int:
    """The bytes that each value of an array, in whatever form it has, takes in a volume: as many as it has if it is an integer of at most two, else four."""
    dtype = getattr(source, "dtype", None)
    # Other libraries than NumPy tell the type by its name alone.
    is_integer = getattr(dtype, "kind", None) in ("i", "u", "b") or "int" in str(dtype) or str(dtype).endswith("bool")
    size = getattr(dtype, "itemsize", 4)
    return size if is_integer and size <= 2 else 4


def _array(source: Any, name: str, channels: list[int], limit: str | None) -> NDArray[Any]:
    """The array `[z, y, x]`, in whatever form it has.

    It is one of several channels, of which each value takes some bytes, or labels beside some, which must fit into a number of bytes together.
    """
    import numpy as np

    if name == "array" and not hasattr(source, "__array__") and not isinstance(source, (list, tuple)):
        allowed = "an array, an image of SimpleITK or nibabel, a path, or a Volume"
        raise _refused("source", f"{type(source).__name__}", allowed)
    shape = getattr(source, "shape", None)
    if isinstance(shape, tuple) and len(shape) == 3 and all(isinstance(size, int) and size >= 0 for size in shape):
        # Before a source that is no array yet, such as one of Zarr or Dask, fills the memory.
        native.check_sizes(list(shape), channels, name == "labels", limit)
    array = _numpy(source, name, "three dimensions z, y, x")
    if array.ndim != 3:
        shape = "×".join(map(str, array.shape)) or "a single number"
        field = "shape" if name == "array" else name
        raise _refused(field, f"{array.ndim} dimensions ({shape})", "three dimensions z, y, x")
    kind = array.dtype.kind
    if kind == "b":
        return array.view(np.uint8)
    if kind not in "iuf":
        raise _refused("dtype", str(array.dtype), "integers or floating-point numbers")
    if not array.dtype.isnative:
        return array
    # `long` and `long long` may be types of equal size that NumPy tells apart.
    return array.view(np.dtype(f"{kind}{array.dtype.itemsize}")) if kind in "iu" else array


def _channels(source: Any, axis: int, limit: str | None) -> list[NDArray[Any]]:
    """The channels of an array of four dimensions."""
    import numpy as np

    shape = getattr(source, "shape", None)
    if isinstance(shape, tuple) and len(shape) == 4 and -4 <= axis < 4 and shape[axis] > 0:
        sizes = list(shape)
        count = sizes.pop(axis)
        native.check_sizes(sizes, [_bytes(source)] * count, False, limit)
    array = _numpy(source, "array", "four dimensions") if hasattr(source, "__array__") else None
    if array is None or array.ndim != 4 or not -4 <= axis < 4:
        found = type(source).__name__ if array is None else f"{array.ndim} dimensions with channel_axis={axis}"
        raise _refused("shape", found, "an array of four dimensions, of which channel_axis is one")
    if array.shape[axis] == 0:
        raise _refused("shape", "no channel", "at least one")
    count = array.shape[axis]
    return [_array(channel, "array", [_bytes(array)] * count, limit) for channel in np.moveaxis(array, axis, 0)]


_Converted = tuple["NDArray[Any]", tuple[float, float, float], "list[list[float]] | None", "list[float]"]


def _converted(source: Any, limit: str | None) -> _Converted:
    if hasattr(source, "GetSpacing") and hasattr(source, "GetDirection"):
        return _of_itk(source, limit)
    if hasattr(source, "affine") and hasattr(source, "dataobj"):
        return _of_nibabel(source, limit)
    return _array(source, "array", [_bytes(source)], limit), (1.0, 1.0, 1.0), None, [0.0, 0.0, 0.0]


def _of_itk(image: Any, limit: str | None) -> _Converted:
    """An image of SimpleITK, whose vectors are in the order x, y, z and whose directions are in LPS."""
    import SimpleITK

    spacing = image.GetSpacing()
    values = SimpleITK.GetArrayViewFromImage(image)
    array = _array(values, "array", [_bytes(values)], limit)
    if len(spacing) != 3:
        raise _refused("spacing", repr(spacing), "an image of three dimensions")
    rows = image.GetDirection()
    axes = [[sign * rows[3 * row + column] for row, sign in enumerate(_RAS_FROM_LPS)] for column in range(3)]
    origin = [sign * place for sign, place in zip(_RAS_FROM_LPS, image.GetOrigin(), strict=True)]
    return array, (spacing[2], spacing[1], spacing[0]), axes, origin


def _of_nibabel(image: Any, limit: str | None) -> _Converted:
    """An image of nibabel, whose axes are x, y, z and whose affine leads to RAS."""
    import numpy as np

    array = _numpy(image.dataobj, "array", "an image that can be read")
    if array.ndim == 4 and array.shape[3] == 1:
        array = array[..., 0]
    affine = image.affine
    if affine is None:
        return _array(array.T, "array", [_bytes(array)], limit), (1.0, 1.0, 1.0), None, [0.0, 0.0, 0.0]
    steps = np.asarray(affine, dtype=float)
    lengths = np.linalg.norm(steps[:3, :3], axis=0)
    if not (np.isfinite(steps).all() and (lengths > 0).all()):
        raise _refused("affine", repr(affine), "finite axes of positive length")
    axes = (steps[:3, :3] / lengths).T.tolist()
    x, y, z = (float(length) for length in lengths)
    return _array(array.T, "array", [_bytes(array)], limit), (z, y, x), axes, steps[:3, 3].tolist()
