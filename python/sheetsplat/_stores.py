"""Volumes where other libraries keep them: open files, groups of zarr, mappings of fsspec, and nodes of ome_zarr."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from ._checks import volume_refused as refused
from ._checks import whole
from .errors import VolumeError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Place", "image_of", "located"]

#: The keys that mark a Zarr store in a mapping.
_MARKS = ("zarr.json", ".zgroup", ".zarray")


class Place(NamedTuple):
    """A volume that the library's own readers open."""

    path: str
    #: The file itself, of which the path is then only the name.
    content: bytes | None = None


def located(source: Any) -> Place | None:
    """The place of a path, an open file, or a store on a disk or at an address; `None` if a source is none of these."""
    if isinstance(source, (str, os.PathLike)):
        return Place(os.path.expanduser(os.fsdecode(source)))
    if callable(getattr(source, "read", None)) and not hasattr(source, "shape"):
        return _of_file(source)
    if _is_group(source):
        # A store on a disk has a root; one of fsspec a file system and a path.
        within = _image_within(source)
        if within is None:
            return None
        store = source.store
        root = getattr(store, "root", None)
        if isinstance(root, (str, os.PathLike)) and os.path.isdir(root):
            return Place(os.path.join(os.fsdecode(root), within))
        return _of_file_system(getattr(store, "fs", None), getattr(store, "path", None), within)
    if isinstance(source, Mapping):
        return _of_file_system(getattr(source, "fs", None), getattr(source, "root", None), "")
    return None


def _of_file(file: Any) -> Place:
    raw = getattr(file, "raw", file)
    name = getattr(file, "name", None) or getattr(file, "path", None)
    name = name if isinstance(name, str) else "file"
    if isinstance(file, io.BufferedReader) and isinstance(raw, io.FileIO) and os.path.isfile(name):
        # A header may name other files beside it.
        return Place(name)
    try:
        content = file.read()
    except Exception as error:
        # Whatever a file of another library raises.
        raise refused("file", f"{type(error).__name__}: {error}", "an open file that can be read") from error
    if not isinstance(content, bytes):
        allowed = "a file that is open in binary mode, as open(name, 'rb') does"
        raise refused("file", f"{type(content).__name__} in {name}", allowed)
    return Place(os.path.basename(name), content)


def _of_file_system(system: Any, path: Any, within: str) -> Place | None:
    """The place in a file system of fsspec, if it is a folder of this machine or at an address."""
    names = getattr(system, "protocol", ())
    names = (names,) if isinstance(names, str) else tuple(names)
    if not isinstance(path, str) or not {"file", "local", "http", "https"} & {*names}:
        return None
    return Place("/".join(part for part in (path.rstrip("/"), within) if part))


def _image_within(group: Any) -> str | None:
    """The path within a store of a group's image, or of its only array; `None` if it has neither."""
    attributes, path = dict(group.attrs), str(getattr(group, "path", "")).strip("/")
    stated = attributes.get("ome", attributes)
    if "multiscales" in stated or "bioformats2raw.layout" in stated:
        return path
    members = [name for name, _ in group.arrays()]
    return f"{path}/{members[0]}".strip("/") if len(members) == 1 else None


def _is_group(source: Any) -> bool:
    """Whether a source is a group of zarr."""
    return hasattr(source, "store") and callable(getattr(source, "arrays", None)) and hasattr(source, "attrs")


def image_of(source: Any, level: int | None) -> Any:
    """The array of a group, a mapping or a node, with names of its axes where it states them; any other source as it is."""
    if isinstance(source, Mapping):
        if not any(mark in source for mark in _MARKS):
            names = ", ".join(map(str, [*source][:5])) or "nothing"
            raise refused("source", f"a mapping with {names}", "the keys of a Zarr store, such as zarr.json; or one of these arrays")
        import zarr

        try:
            source = zarr.open(source, mode="r")
        except Exception as error:
            # Whatever zarr or a file system raises.
            raise refused("source", f"{type(error).__name__}: {error}", "a Zarr store that zarr opens") from error
    metadata = getattr(source, "metadata", None)
    if isinstance(metadata, Mapping) and isinstance(getattr(source, "data", None), list):
        # A node of ome_zarr.
        return _levels(list(source.data), metadata.get("axes"), metadata.get("coordinateTransformations"), level)
    return _of_group(source, level) if _is_group(source) else source


def _of_group(group: Any, level: int | None) -> Any:
    attributes = dict(group.attrs)
    stated = attributes.get("ome", attributes).get("multiscales")
    if stated:
        sets = stated[0].get("datasets", [])
        arrays = [group[one["path"]] for one in sets]
        return _levels(arrays, stated[0].get("axes"), [one.get("coordinateTransformations") for one in sets], level)
    members = dict(group.arrays())
    if len(members) != 1:
        found = f"a group with {', '.join(sorted(members)) or 'no array'}"
        raise refused("source", found, "an array of a group, one of OME-Zarr, or one with a single array")
    return next(iter(members.values()))


def _levels(arrays: list[Any], axes: Any, transformations: Any, level: int | None) -> Any:
    """One of several resolutions, the finest without a number."""
    number = 0 if level is None else whole("level", level, 0, 2**32 - 1, VolumeError)
    if number >= len(arrays):
        raise refused("level", str(number), f"0 to {len(arrays) - 1}" if arrays else "an image with a level")
    if not axes:
        return arrays[number]
    facts = [{"name": axis} if isinstance(axis, str) else axis for axis in axes]
    names, units = [axis["name"] for axis in facts], [axis.get("unit") for axis in facts]
    steps = (transformations or [None] * len(arrays))[number] or []
    scale = next((step["scale"] for step in steps if step.get("type") == "scale"), [1.0] * len(names))
    return Named(arrays[number], tuple(names), tuple(zip(scale, units, strict=True)))


class _Coordinates:
    """Evenly spaced coordinates of a dim, and their unit."""

    def __init__(self, size: int, step: float, unit: str | None) -> None:
        self._size, self._step = size, step
        self.attrs = {} if unit is None else {"units": unit}

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        import numpy as np

        return np.arange(self._size, dtype=dtype or float) * self._step


class Named:
    """An array whose dims have names, steps and units, as much as is read of an array of xarray."""

    def __init__(self, data: Any, dims: tuple[str, ...], steps: tuple[tuple[float, str | None], ...]) -> None:
        if len(dims) != len(data.shape):
            raise refused("axes", f"{', '.join(dims)} of {len(data.shape)} dimensions", "a name for each dimension")
        self.data, self.dims, self._steps = data, dims, steps
        self.shape, self.dtype = tuple(data.shape), data.dtype

    @property
    def coords(self) -> dict[str, _Coordinates]:
        """The coordinates of each dim."""
        sizes = zip(self.dims, self.shape, self._steps, strict=True)
        return {dim: _Coordinates(size, step, unit) for dim, size, (step, unit) in sizes}

    def isel(self, places: Mapping[str, Any]) -> Named:
        """Without the dims of which one place is chosen."""
        if not places:
            return self
        chosen = self.data[tuple(places.get(dim, slice(None)) for dim in self.dims)]
        left = [at for at, dim in enumerate(self.dims) if not isinstance(places.get(dim), int)]
        return Named(chosen, tuple(self.dims[at] for at in left), tuple(self._steps[at] for at in left))

    def transpose(self, *dims: str) -> Named:
        """With its dims in another order."""
        order = [self.dims.index(dim) for dim in dims]
        if order == [*range(len(order))]:
            return self
        import numpy as np

        return Named(np.asarray(self.data).transpose(order), dims, tuple(self._steps[at] for at in order))
