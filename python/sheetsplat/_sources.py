"""Values and labels of volumes from arrays, images of other libraries, and whatever has ``__array__``."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from . import _named as named
from . import _native as native
from . import _stacks as stacks
from . import _stores as stores
from ._checks import volume_refused as refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Labels", "Source", "array", "labels_of", "numbered", "read"]

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
    #: In place of channels.
    colors: stacks.Colors | None = None


def read(
    source: Any,
    channel_axis: int | None,
    selection: dict[str, int | None],
    is_spaced: bool,
    limit: str | None,
) -> Source:
    """What a source gives a volume; its spacing is not looked at if another one is stated."""
    level = selection["level"]
    if channel_axis is None:
        image = stores.image_of(source, level)
        if image is not source:
            selection, source = {**selection, "level": None}, image
    if named.is_named(source):
        return _of_named(source, channel_axis, selection, is_spaced, limit)
    dimensions = _dimensions(source)
    allowed = {"level": False, "time": dimensions > 3, "channel": dimensions > 3}
    for key, number in selection.items():
        if number is not None and not (allowed[key] and channel_axis is None):
            may_be = "a path, an array with a dimension for it, or a DataArray of xarray with a dim channel or time"
            raise refused(key, f"{number} beside {type(source).__name__}", may_be)
    if channel_axis is not None:
        channels, masked = _channels(source, channel_axis, limit)
        return Source(channels, masked)
    if hasattr(source, "GetSpacing") and hasattr(source, "GetDirection"):
        return _of_itk(source, selection, limit)
    if hasattr(source, "affine") and hasattr(source, "dataobj"):
        return _of_nibabel(source, selection, limit)
    if dimensions in (4, 5):
        return _of_stack(source, selection, limit)
    values, masked = array(source, "array", [_bytes(source)], limit)
    return Source([values], masked)


def _dimensions(source: Any) -> int:
    """The number of dimensions of an array or an image, as far as that is known before it is computed."""
    if hasattr(source, "GetSpacing"):
        components = getattr(source, "GetNumberOfComponentsPerPixel", lambda: 1)()
        return len(source.GetSpacing()) + (components > 1)
    shape = getattr(source, "shape", getattr(getattr(source, "dataobj", None), "shape", None))
    if isinstance(shape, tuple):
        return len(shape)
    rank = 0
    while isinstance(source, (list, tuple)) and source:
        rank, source = rank + 1, source[0]
    return rank


def _of_stack(source: Any, selection: dict[str, int | None], limit: str | None) -> Source:
    """An array of four or five dimensions, of which one time is drawn."""
    import numpy as np

    if isinstance(source, (list, tuple)):
        source = _numpy(source, "array", stacks.ALLOWED)
    if not hasattr(source, "__array__"):
        raise refused("source", type(source).__name__, "an array, an image, a path, an open file, a Zarr store, or a Volume")
    shape = tuple(source.shape)
    if 0 in shape:
        raise refused("sizes", "×".join(map(str, shape)), "sizes of at least 1")
    if stacks.is_colors(shape):
        for key in ("channel", "time"):
            if selection[key]:
                raise refused(key, f"{selection[key]} beside an array of colours", "0, the only one")
        return Source([], 0, colors=_colors_of(source, shape, limit))
    if len(shape) == 5:
        # Only one time of an array that is not computed yet.
        source, shape = source[stacks.time_of(selection["time"], shape[0])], shape[1:]
    elif selection["time"]:
        raise refused("time", f"{selection['time']} beside an array c, z, y, x", "0, or an array t, c, z, y, x")
    if shape[0] > stacks.MOST_CHANNELS:
        allowed = f"at most {stacks.MOST_CHANNELS}, as in files; or channel_axis=0"
        raise refused("channels", f"{shape[0]} along the first of four dimensions c, z, y, x", allowed)
    numbers = stacks.channels_at(shape[0], selection["channel"])
    native.check_sizes([*shape[1:]], [_bytes(source)] * len(numbers), False, limit)
    if isinstance(source, np.ndarray):
        return Source(*_several([source[number] for number in numbers], _bytes(source), limit))
    values = _numpy(source if len(numbers) > 1 else source[numbers[0] : numbers[0] + 1], "array", stacks.ALLOWED)
    return Source(*_several([*values], _bytes(values), limit))


def _colors_of(source: Any, shape: tuple[int, ...], limit: str | None) -> stacks.Colors:
    """The colours of an array `[z, y, x, 3 or 4]`."""
    # While they are made, a voxel's numbers, its luminance and its colour take 28 bytes.
    native.check_sizes([*shape[:3]], [4] * 7, False, limit)
    values = _numpy(source, "array", stacks.ALLOWED)
    _, masked = _unmasked(values, "array")
    if masked:
        raise refused("colours", f"{masked} masked numbers", "colours without a mask, or channels: channel_axis=3")
    return stacks.colors(values)


#: Labels, or places among ascending ids, the first of which is 0, and these ids.
Labels: TypeAlias = "NDArray[Any] | tuple[NDArray[Any], list[int]]"


def numbered(labels: NDArray[Any]) -> Labels:
    """Labels as they are, or if 16 bits do not hold all of them, their places among all and what they stand for."""
    import numpy as np

    if labels.size == 0 or labels.dtype.itemsize <= 2 or not labels.max() > 65535:
        return labels
    wrong = labels < 0
    if labels.dtype.kind == "f":
        wrong |= ~np.isfinite(labels) | (labels != np.floor(labels))
    if wrong.any():
        z, y, x = np.unravel_index(int(wrong.argmax()), labels.shape)
        raise refused(f"labels[{z}, {y}, {x}]", f"{labels[z, y, x]:g}", "whole numbers from 0 on")
    ids, places = np.unique(labels, return_inverse=True)
    # Label 0 is 0 in any case.
    first = int(ids[0] != 0)
    if len(ids) + first > 65536:
        raise refused("labels", f"{len(ids)} different labels", "at most 65536, 0 among them")
    numbers = [0] * first + [int(number) for number in ids]
    return (places.reshape(labels.shape) + first).astype(np.uint16), numbers


def labels_of(labels: Any, source: Source | None, limit: str | None) -> Labels | None:
    """Labels `[z, y, x]`, for the voxels of a source if there is one."""
    if labels is None:
        return None
    channels = [] if source is None else [_bytes(values) for values in source.channels]
    if named.is_named(labels):
        arranged = named.arranged(labels, None, 0, 0, True)
        return numbered(array(arranged.channels[0], "labels", channels, limit)[0])
    tags = array(labels, "labels", channels, limit)[0]
    return numbered(tags if source is None or source.arrange is None else source.arrange(tags))


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
        allowed = "an array, an image of SimpleITK or nibabel, a path, an open file, a Zarr store, or a Volume"
        raise refused("source", f"{type(source).__name__}", allowed)
    shape = getattr(source, "shape", None)
    if isinstance(shape, tuple) and len(shape) == 3 and all(isinstance(size, int) and size >= 0 for size in shape):
        # Before a source that is no array yet, such as one of Zarr or Dask, fills the memory.
        native.check_sizes(list(shape), channels, name == "labels", limit)
    values = _numpy(source, name, "three dimensions z, y, x")
    if values.ndim != 3:
        shape = "×".join(map(str, values.shape)) or "a single number"
        field = "shape" if name == "array" else name
        allowed = stacks.ALLOWED if name == "array" else "three dimensions z, y, x"
        raise refused(field, f"{values.ndim} dimensions ({shape})", allowed)
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


def _of_itk(image: Any, selection: dict[str, int | None], limit: str | None) -> Source:
    """An image of SimpleITK, whose vectors are in the order x, y, z and whose directions are in LPS; a fourth dimension is time."""
    import SimpleITK

    spacing = image.GetSpacing()
    view = SimpleITK.GetArrayViewFromImage(image)
    if len(spacing) not in (3, 4):
        raise refused("spacing", repr(spacing), "an image of three dimensions, or of four with times")
    rank = len(spacing)
    if rank == 4:
        view = view[stacks.time_of(selection["time"], view.shape[0])]
    elif selection["time"]:
        raise refused("time", f"{selection['time']} beside an image of three dimensions", "0, or an image of four")
    rows = image.GetDirection()
    axes = [[sign * rows[rank * row + column] for row, sign in enumerate(_RAS_FROM_LPS)] for column in range(3)]
    x, y, z = (sign * place for sign, place in zip(_RAS_FROM_LPS, image.GetOrigin()[:3], strict=True))
    lies = {"spacing": (spacing[2], spacing[1], spacing[0]), "axes": axes, "origin": (x, y, z), "unit": "mm"}
    return _of_vectors(view, selection["channel"], view.dtype.itemsize == 1, lies, limit)


def _of_vectors(
    values: NDArray[Any], channel: int | None, may_be_colors: bool, lies: dict[str, Any], limit: str | None
) -> Source:
    """An array `[z, y, x]`, or `[z, y, x, component]`, of which each component is a channel unless they are colours."""
    if values.ndim < 4:
        if channel:
            raise refused("channel", f"{channel} beside an image of single numbers", "0, or an image of vectors")
        read, masked = array(values, "array", [_bytes(values)], limit)
        return Source([read], masked, **lies)
    if may_be_colors and stacks.is_colors(values.shape):
        return Source([], 0, colors=_colors_of(values, values.shape, limit), **lies)
    numbers = stacks.channels_at(values.shape[3], channel)
    channels, masked = _several([values[..., number] for number in numbers], _bytes(values), limit)
    return Source(channels, masked, **lies)


def _of_nibabel(image: Any, selection: dict[str, int | None], limit: str | None) -> Source:
    """An image of nibabel, whose axes are x, y, z, time and component, and whose affine leads to RAS."""
    import numpy as np

    data = image.dataobj
    shape = tuple(data.shape)
    if len(shape) > 5 or len(shape) < 3:
        raise refused("shape", "×".join(map(str, shape)), "x, y, z, and maybe times and components")
    if len(shape) > 3:
        # A file is read where it is sliced.
        data = data[:, :, :, stacks.time_of(selection["time"], shape[3])]
    elif selection["time"]:
        raise refused("time", f"{selection['time']} beside an image of three dimensions", "0, or an image of four")
    stored = _numpy(data, "array", "an image that can be read")
    if stored.dtype.names:
        # RGB24 and RGBA32.
        stored = np.stack([stored[name] for name in stored.dtype.names], axis=-1)
    values = stored.transpose(2, 1, 0, *range(3, stored.ndim))
    is_color = len(shape) < 5 and values.ndim == 4
    lies = _in_patient(image)
    return _of_vectors(values, selection["channel"], is_color, lies, limit)


def _in_patient(image: Any) -> dict[str, Any]:
    """How an image of nibabel lies in the patient."""
    import numpy as np

    if image.affine is None:
        return {}
    steps = np.asarray(image.affine, dtype=float)
    lengths = np.linalg.norm(steps[:3, :3], axis=0)
    if not (np.isfinite(steps).all() and (lengths > 0).all()):
        raise refused("affine", repr(image.affine), "finite axes of positive length")
    units = getattr(getattr(image, "header", None), "get_xyzt_units", lambda: ("mm", "sec"))()
    axes = (steps[:3, :3] / lengths).T.tolist()
    x, y, z = (float(length) for length in lengths)
    origin = tuple(float(place) for place in steps[:3, 3])
    return {"spacing": (z, y, x), "axes": axes, "origin": origin, "unit": _NIFTI_UNITS.get(units[0], "mm")}
