"""Values and labels of volumes from arrays, images of other libraries, and whatever has ``__array__``."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _named as named
from . import _native as native
from ._checks import volume_refused as refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Source", "array", "labels_of", "read"]

#: Converts the directions of LPS, which ITK uses, to RAS.
_RAS_FROM_LPS = (-1.0, -1.0, 1.0)

#: The units of NIfTI by nibabel's names. Where an image states none, its affine leads to millimetres.
_NIFTI_UNITS = {"meter": "m", "mm": "mm", "micron": "µm"}


class Source(NamedTuple):
    """What a source gives a volume."""

    #: Arrays `[z, y, x]`.
    channels: list[NDArray[Any]]
    #: The samples that are holes because they are masked.
    masked: int
    #: Along z, y and x.
    spacing: tuple[float, float, float] = (1.0, 1.0, 1.0)
    #: The directions of x, y and z in RAS.
    axes: list[list[float]] | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    unit: str | None = None
    #: Brings labels into the order of the channels.
    arrange: Callable[[NDArray[Any]], NDArray[Any]] | None = None


def read(
    source: Any,
    channel_axis: int | None,
    selection: dict[str, int | None],
    is_spaced: bool,
    limit: str | None,
) -> Source:
    """What a source gives a volume; its spacing is not looked at if another one is stated."""
    if named.is_named(source):
        return _of_named(source, channel_axis, selection, is_spaced, limit)
    for key, number in selection.items():
        if number is not None:
            allowed = "a path, or for channel and time a DataArray of xarray with such a dim"
            raise refused(key, f"{number} beside {type(source).__name__}", allowed)
    if channel_axis is not None:
        channels, masked = _channels(source, channel_axis, limit)
        return Source(channels, masked)
    if hasattr(source, "GetSpacing") and hasattr(source, "GetDirection"):
        return _of_itk(source, limit)
    if hasattr(source, "affine") and hasattr(source, "dataobj"):
        return _of_nibabel(source, limit)
    values, masked = array(source, "array", [_bytes(source)], limit)
    return Source([values], masked)


def labels_of(labels: Any, source: Source | None, limit: str | None) -> NDArray[Any] | None:
    """Labels `[z, y, x]`, for the voxels of a source if there is one."""
    if labels is None:
        return None
    channels = [] if source is None else [_bytes(values) for values in source.channels]
    if named.is_named(labels):
        arranged = named.arranged(labels, None, 0, 0, True)
        return array(arranged.channels[0], "labels", channels, limit)[0]
    tags = array(labels, "labels", channels, limit)[0]
    return tags if source is None or source.arrange is None else source.arrange(tags)


def _numpy(source: Any, name: str, allowed: str) -> NDArray[Any]:
    """The array of NumPy, maybe a masked one, that a source is, holds or computes, whatever errors that raises."""
    import numpy as np

    try:
        # Dask's own conversion to an array of NumPy loses masks.
        values = np.asanyarray(source.compute() if callable(getattr(source, "compute", None)) else source)
    except Exception as error:
        # A list of other shapes, a tensor on a GPU or with gradients, a file that was removed, a task that failed.
        raise refused(name, f"{type(error).__name__}: {error}", allowed) from error
    return values if isinstance(values, np.ma.MaskedArray) else np.asarray(values)


def _unmasked(values: NDArray[Any], name: str) -> tuple[NDArray[Any], int]:
    """An array whose masked values are NaN, and their number."""
    import numpy as np

    if not isinstance(values, np.ma.MaskedArray):
        return values, 0
    mask = np.ma.getmaskarray(values)
    masked = int(np.count_nonzero(mask))
    if masked == 0:
        return np.asarray(values), 0
    if name == "labels":
        raise refused(name, f"{masked} masked ones", "labels without a mask: labels.filled(0) has label 0 there")
    numbers = np.array(values.data, dtype=values.dtype if values.dtype.kind == "f" else np.float32)
    numbers[mask] = np.nan
    return numbers, masked


def _bytes(source: Any) -> int:
    """The bytes that each value of an array, in whatever form it has, takes in a volume: as many as it has if it is an integer of at most two, else four."""
    dtype = getattr(source, "dtype", None)
    # Other libraries than NumPy tell the type by its name alone.
    is_integer = getattr(dtype, "kind", None) in ("i", "u", "b") or "int" in str(dtype) or str(dtype).endswith("bool")
    size = getattr(dtype, "itemsize", 4)
    return size if is_integer and size <= 2 else 4


def array(source: Any, name: str, channels: list[int], limit: str | None) -> tuple[NDArray[Any], int]:
    """The array `[z, y, x]`, in whatever form it has, and the number of its masked values.

    It is one of several channels, of which each value takes some bytes, or labels beside some, which must fit into a number of bytes together.
    """
    import numpy as np

    if name == "array" and not hasattr(source, "__array__") and not isinstance(source, (list, tuple)):
        allowed = "an array, an image of SimpleITK or nibabel, a path, or a Volume"
        raise refused("source", f"{type(source).__name__}", allowed)
    shape = getattr(source, "shape", None)
    if isinstance(shape, tuple) and len(shape) == 3 and all(isinstance(size, int) and size >= 0 for size in shape):
        # Before a source that is no array yet, such as one of Zarr or Dask, fills the memory.
        native.check_sizes(list(shape), channels, name == "labels", limit)
    values = _numpy(source, name, "three dimensions z, y, x")
    if values.ndim != 3:
        shape = "×".join(map(str, values.shape)) or "a single number"
        field = "shape" if name == "array" else name
        raise refused(field, f"{values.ndim} dimensions ({shape})", "three dimensions z, y, x")
    kind = values.dtype.kind
    if kind not in "biuf":
        raise refused("dtype", str(values.dtype), "integers or floating-point numbers")
    values, masked = _unmasked(values, name)
    if values.dtype.kind == "b":
        return values.view(np.uint8), masked
    if values.dtype.kind == "f" or not values.dtype.isnative:
        return values, masked
    # `long` and `long long` may be types of equal size that NumPy tells apart.
    return values.view(np.dtype(f"{kind}{values.dtype.itemsize}")), masked


def _several(sources: list[Any], bytes_each: int, limit: str | None) -> tuple[list[NDArray[Any]], int]:
    """Channels `[z, y, x]`, and the number of their masked values."""
    read = [array(channel, "array", [bytes_each] * len(sources), limit) for channel in sources]
    return [values for values, _ in read], sum(masked for _, masked in read)


def _channels(source: Any, axis: int, limit: str | None) -> tuple[list[NDArray[Any]], int]:
    """The channels of an array of four dimensions."""
    import numpy as np

    shape = getattr(source, "shape", None)
    if isinstance(shape, tuple) and len(shape) == 4 and -4 <= axis < 4 and shape[axis] > 0:
        sizes = list(shape)
        count = sizes.pop(axis)
        native.check_sizes(sizes, [_bytes(source)] * count, False, limit)
    values = _numpy(source, "array", "four dimensions") if hasattr(source, "__array__") else None
    if values is None or values.ndim != 4 or not -4 <= axis < 4:
        found = type(source).__name__ if values is None else f"{values.ndim} dimensions with channel_axis={axis}"
        raise refused("shape", found, "an array of four dimensions, of which channel_axis is one")
    if values.shape[axis] == 0:
        raise refused("shape", "no channel", "at least one")
    return _several(list(np.moveaxis(values, axis, 0)), _bytes(values), limit)


def _of_named(
    source: Any, channel_axis: int | None, selection: dict[str, int | None], is_spaced: bool, limit: str | None
) -> Source:
    """An array whose dims have names."""
    if selection["level"] is not None:
        raise refused("level", f"{selection['level']} beside {type(source).__name__}", "a path of a store with levels")
    of = named.arranged(source, channel_axis, selection["channel"], selection["time"], is_spaced)
    channels, masked = _several(of.channels, _bytes(source), limit)
    return Source(channels, masked, of.spacing, unit=of.unit, arrange=of.like)


def _of_itk(image: Any, limit: str | None) -> Source:
    """An image of SimpleITK, whose vectors are in the order x, y, z and whose directions are in LPS."""
    import SimpleITK

    spacing = image.GetSpacing()
    view = SimpleITK.GetArrayViewFromImage(image)
    values, masked = array(view, "array", [_bytes(view)], limit)
    if len(spacing) != 3:
        raise refused("spacing", repr(spacing), "an image of three dimensions")
    rows = image.GetDirection()
    axes = [[sign * rows[3 * row + column] for row, sign in enumerate(_RAS_FROM_LPS)] for column in range(3)]
    x, y, z = (sign * place for sign, place in zip(_RAS_FROM_LPS, image.GetOrigin(), strict=True))
    return Source([values], masked, (spacing[2], spacing[1], spacing[0]), axes, (x, y, z), "mm")


def _of_nibabel(image: Any, limit: str | None) -> Source:
    """An image of nibabel, whose axes are x, y, z and whose affine leads to RAS."""
    import numpy as np

    stored = _numpy(image.dataobj, "array", "an image that can be read")
    if stored.ndim == 4 and stored.shape[3] == 1:
        stored = stored[..., 0]
    values, masked = array(stored.T, "array", [_bytes(stored)], limit)
    if image.affine is None:
        return Source([values], masked)
    steps = np.asarray(image.affine, dtype=float)
    lengths = np.linalg.norm(steps[:3, :3], axis=0)
    if not (np.isfinite(steps).all() and (lengths > 0).all()):
        raise refused("affine", repr(image.affine), "finite axes of positive length")
    units = getattr(getattr(image, "header", None), "get_xyzt_units", lambda: ("mm", "sec"))()
    axes = (steps[:3, :3] / lengths).T.tolist()
    x, y, z = (float(length) for length in lengths)
    first = tuple(float(place) for place in steps[:3, 3])
    return Source([values], masked, (z, y, x), axes, (first[0], first[1], first[2]), _NIFTI_UNITS.get(units[0], "mm"))
