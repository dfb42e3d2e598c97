"""Arrays whose dims have names and coordinates, as xarray's do."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _native as native
from ._checks import volume_refused as refused
from ._checks import whole
from .errors import VolumeError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Arranged", "arranged", "is_named"]

#: The roles of dims by their names in small letters.
_ROLES = {
    **dict.fromkeys(("z", "depth", "slice", "slices", "plane", "pln"), "z"),
    **dict.fromkeys(("y", "row", "rows", "height"), "y"),
    **dict.fromkeys(("x", "column", "columns", "col", "cols", "width"), "x"),
    **dict.fromkeys(("c", "channel", "channels"), "channel"),
    **dict.fromkeys(("t", "time", "times"), "time"),
}

_SPATIAL = ("z", "y", "x")

_ALLOWED = "z (depth, slice, plane), y (row, height) and x (column, col, width), c (channel) and t (time)"

#: The largest distance of a coordinate from its place among even ones, as a part of their step.
_EVEN = 0.01


class Arranged(NamedTuple):
    """An array in the order of volumes."""

    #: Arrays `[z, y, x]` with ascending coordinates, which are not computed yet.
    channels: list[Any]
    #: Along z, y and x.
    spacing: tuple[float, float, float]
    unit: str | None
    #: Brings an array that has the same dims, without names, into the same order.
    like: Callable[[NDArray[Any]], NDArray[Any]]


def is_named(source: Any) -> bool:
    """Whether the dims of a source have names."""
    methods = ("coords", "isel", "transpose")
    return isinstance(getattr(source, "dims", None), tuple) and all(hasattr(source, name) for name in methods)


def arranged(source: Any, channel_axis: int | None, channel: int | None, time: int | None, is_spaced: bool) -> Arranged:
    """A source in the order z, y, x: one of its channels or all, and one of its times; its spacing is not looked at if another one is stated."""
    dims = _dims(source.dims, channel_axis)
    sizes = dict(zip(source.dims, source.shape, strict=True))
    if "time" in dims:
        number = _number("time", time, dims["time"], sizes)
        if time is None and sizes[dims["time"]] > 1:
            from ._warnings import warn

            warn(f"array: {dims['time']}: {sizes[dims['time']]} times: the first is drawn")
        source = source.isel({dims["time"]: number})
    elif time:
        raise refused("time", f"{time}, and the dims {_listed(source.dims)}", "0, or an array with a dim t or time")
    order = [dims[role] for role in _SPATIAL]
    axes = [_Axis.of(dim, sizes[dim], source.coords, is_spaced) for dim in order]
    flips = {axis.dim: slice(None, None, -1) for axis in axes if axis.is_descending}
    own = [dim for dim in source.dims if dim in order]

    def like(array: NDArray[Any]) -> NDArray[Any]:
        turned = array.transpose([own.index(dim) for dim in order])
        return turned[tuple(flips.get(dim, slice(None)) for dim in order)]

    source = source.isel(flips)
    if "channel" not in dims:
        if channel:
            found = f"{channel}, and the dims {_listed(source.dims)}"
            raise refused("channel", found, "0, or an array with a dim c or channel")
        channels = [source]
    elif channel is None:
        if sizes[dims["channel"]] == 0:
            raise refused(str(dims["channel"]), "no channel", "at least one")
        channels = [source.isel({dims["channel"]: number}) for number in range(sizes[dims["channel"]])]
    else:
        channels = [source.isel({dims["channel"]: _number("channel", channel, dims["channel"], sizes)})]
    z, y, x = _steps(axes)
    unit = _unit(axes, is_spaced)
    ordered = [channel.transpose(*order) for channel in channels]
    # The array under the names may have a mask.
    return Arranged([getattr(channel, "data", channel) for channel in ordered], (z, y, x), unit, like)


def _listed(dims: Any) -> str:
    return ", ".join(map(str, dims))


def _dims(dims: tuple[Any, ...], channel_axis: int | None) -> dict[str, Any]:
    """The dims by their roles."""
    named = list(dims)
    found: dict[str, Any] = {}
    if channel_axis is not None:
        if len(dims) < 4 or not -len(dims) <= channel_axis < len(dims):
            allowed = "an array of four dimensions, of which channel_axis is one"
            raise refused("shape", f"{len(dims)} dimensions with channel_axis={channel_axis}", allowed)
        found["channel"] = named.pop(channel_axis)
    if len(named) == 3 and all(re.fullmatch(r"dim_\d+", str(dim)) for dim in named):
        # xarray's own names of dims that have none.
        return found | dict(zip(_SPATIAL, named, strict=True))
    for dim in named:
        role = _ROLES.get(str(dim).lower())
        if role is None:
            raise refused(str(dim), "a dim of this name", f"the dims {_ALLOWED}; rename it, or choose one place with isel")
        if role in found:
            raise refused(str(dim), f"a second dim for {role}, beside {found[role]}", f"one each of the dims {_ALLOWED}")
        found[role] = dim
    missing = [role for role in _SPATIAL if role not in found]
    if missing:
        raise refused("shape", f"the dims {_listed(dims) or 'of a single number'}, without {_listed(missing)}", f"the dims {_ALLOWED}")
    return found


def _number(key: str, number: int | None, dim: Any, sizes: dict[Any, int]) -> int:
    """The place along a dim."""
    if sizes[dim] == 0:
        raise refused(str(dim), f"no {key}", "at least one")
    if number is None:
        return 0
    number = whole(key, number, 0, 2**32 - 1, VolumeError)
    if number >= sizes[dim]:
        raise refused(key, f"{number} of the dim {dim}", f"0 to {sizes[dim] - 1}")
    return number


class _Axis(NamedTuple):
    """A dim's coordinates."""

    dim: Any
    #: Their distance; none of a single voxel, or where another spacing is stated.
    step: float | None
    is_descending: bool
    #: The symbol of the unit, if it is stated.
    unit: str | None

    @classmethod
    def of(cls, dim: Any, size: int, coords: Any, is_spaced: bool) -> _Axis:
        """The coordinates of a dim; without any, the numbers of its voxels."""
        import numpy as np

        if dim not in coords:
            return cls(dim, None if size == 1 else 1.0, False, None)
        stated = coords[dim]
        name = getattr(stated, "attrs", {}).get("units")
        unit = None if name is None else native.symbol(str(name))
        places = np.asarray(stated)
        if places.dtype.kind not in "iuf":
            raise refused(str(dim), f"coordinates of type {places.dtype}", "numbers")
        if size < 2:
            return cls(dim, None, False, unit)
        places = places.astype(float)
        step = (places[-1] - places[0]) / (size - 1)
        steps = np.diff(places)
        if not (np.isfinite(places).all() and ((steps > 0).all() or (steps < 0).all())):
            at = int(np.argmax(~(steps * np.sign(np.nan_to_num(step)) > 0)))
            found = f"the coordinate {places[at + 1]:g} after {places[at]:g}"
            raise refused(str(dim), found, "finite coordinates that all ascend or all descend")
        off = np.abs(places - (places[0] + step * np.arange(size)))
        if not is_spaced and off.max() > _EVEN * abs(step):
            least, most = np.argmin(np.abs(steps)), np.argmax(np.abs(steps))
            found = " and ".join(
                f"coordinates {abs(steps[at]):g} apart at {places[at]:g}" for at in (int(least), int(most))
            )
            raise refused(str(dim), found, "evenly spaced coordinates, or spacing= where they do not matter")
        return cls(dim, None if is_spaced else abs(float(step)), bool(step < 0), unit)


def _steps(axes: list[_Axis]) -> list[float]:
    """The spacing; along a dim of a single voxel that of the last dim that has more."""
    known = [axis.step for axis in axes if axis.step is not None]
    return [axis.step if axis.step is not None else (known[-1] if known else 1.0) for axis in axes]


def _unit(axes: list[_Axis], is_spaced: bool) -> str | None:
    """The unit that all dims share; none if one states none."""
    last = axes[-1]
    for axis in axes:
        if not is_spaced and axis.unit is not None and last.unit is not None and axis.unit != last.unit:
            raise refused(str(axis.dim), f"the unit {axis.unit}", f"{last.unit}, as along {last.dim}")
    return last.unit if all(axis.unit == last.unit for axis in axes) else None
