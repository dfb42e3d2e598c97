"""Volumes from arrays, images of other libraries, and files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from . import _native as native
from . import _sources as sources
from . import _stores as stores
from ._checks import volume_refused, whole
from ._loading import loading
from .errors import VolumeError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Volume"]

_BUILTIN = "builtin:"


@dataclass(frozen=True)
class Origin:
    """From where a volume can be opened again."""

    #: A path or an address, or a scene that names the volume.
    what: Any
    memory: int | str | None
    index: str | None
    #: The channel, the time and the level.
    selection: tuple[int | None, ...] = (None, None, None)
    series: int | str | None = None
    spacing: tuple[float, float, float] | None = None
    #: Whether it has other labels than those that are read there.
    has_labels: bool = False


class Volume:
    """A scalar volume on a rectilinear grid, shared by all pictures of it.

    Parameters
    ----------
    source : array, image, path, open file, Zarr store or Volume
        An array ``[z, y, x]`` of any integer or floating-point type, with any strides, or anything with ``__array__``
        (dask, zarr, torch on the CPU). Its values are copied as ``float32``; NaN, infinite and masked ones, and those
        beyond the range of ``float32``, are holes, which are not drawn. More dimensions are those of NumPy's files:
        ``[z, y, x, 3 or 4]`` are colours, ``[c, z, y, x]`` channels and ``[t, c, z, y, x]`` also times. A ``DataArray`` of
        xarray, whose dims are ordered by their names (z, y and x, or depth, row and column) and whose coordinates give
        spacing and unit. An image of SimpleITK or nibabel, which also gives spacing, orientation and unit. A path of a
        volume file or of a folder of slices, also ``~/head.nrrd``, or a file that is open in binary mode. A group of zarr,
        a mapping of fsspec, or a node of ome_zarr. Or ``"builtin:NAME"``.
    spacing : float or three floats, optional
        World units between voxels, in the order of an array's axes: z, y, x. Replaces the source's own.
    labels : array, optional
        The segment of each voxel, whole numbers from 0 on, at most 65536 different ones, of the same shape, with the same
        order of axes.
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
        The channel, the time and the level of a source that holds several, counted from 0: all channels, the first time
        and the finest level without them.
    series : int or str, optional
        The series of a DICOM folder with several, by its number, counted from 0, or its ``SeriesInstanceUID``: the largest
        without it. ``info()`` lists them.

    Examples
    --------
    >>> import numpy as np
    >>> volume = Volume(np.arange(24, dtype=np.int16).reshape(2, 3, 4), spacing=(2, 1, 1))
    >>> volume.shape, volume.spacing
    ((2, 3, 4), (2.0, 1.0, 1.0))
    >>> volume
    <sheetsplat.Volume of 2×3×4 voxels, spacing (2.0, 1.0, 1.0), values 0 to 23>

    Notes
    -----
    A volume can be pickled: one of a path by that path, which must then lead to the same file, and any other by its values.
    """

    __slots__ = ("__weakref__", "_native", "_origin", "_range")
    _native: native.Volume
    #: From where it can be opened again.
    _origin: Origin | None
    #: The minimum and the maximum of the values, once they are known.
    _range: tuple[float, float] | None

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
        series: int | str | None = None,
    ) -> None:
        steps = None if spacing is None else _spacing(spacing)
        limit = _memory(memory)
        self._origin = self._range = None
        place = stores.located(source) if channel_axis is None else None
        if place is not None:
            opened = _open(place, memory, progress, [channel, time, level], None, steps, labels, index, series)
            self._native, self._origin = opened._native, opened._origin
            return
        if series is not None:
            raise volume_refused("series", repr(series), "nothing, where the source is no path")
        if channel_axis is None and isinstance(source, Volume):
            self._native, self._origin = source._native, source._origin
            if steps is not None or labels is not None:
                self._native = self._native.replaced(steps, sources.labels_of(labels, None, limit), limit)
                if self._origin is not None:
                    has_labels = labels is not None or self._origin.has_labels
                    self._origin = replace(self._origin, spacing=steps or self._origin.spacing, has_labels=has_labels)
            return
        selection = {"channel": channel, "time": time, "level": level}
        read = sources.read(source, channel_axis, selection, steps is not None, limit)
        tags = sources.labels_of(labels, read, limit)
        if read.colors is not None:
            lies = None if read.axes is None else (read.axes, read.origin)
            self._native = native.color_volume(read.colors.numbers, read.colors.kind, steps or read.spacing, lies, read.unit)
            if tags is not None:
                self._native = self._native.replaced(None, tags, limit)
            return
        self._native = native.Volume.from_arrays(
            read.channels, steps or read.spacing, tags, read.axes, read.origin, limit, read.unit, read.masked
        )

    @classmethod
    def _of(cls, shared: native.Volume, origin: Origin | None = None) -> Volume:
        volume = cls.__new__(cls)
        volume._native, volume._origin, volume._range = shared, origin, None
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

    def _ends(self) -> tuple[float, float]:
        """The minimum and the maximum of the values of all channels."""
        if self._range is None:
            self._range = native.value_range(self._native)
        return self._range

    def _named(self) -> native.Scene | None:
        """A scene that names the volume, for the files of its pictures; of one from memory there is none."""
        origin = self._origin
        if origin is None or origin.has_labels:
            return None
        keys: dict[str, Any] = {}
        if origin.spacing is not None:
            keys["volume.spacing"] = list(reversed(origin.spacing))
        if not isinstance(origin.what, str):
            stated: native.Scene = origin.what._bare
            return stated.replaced(keys | {"volume.level": self.level} if self.level > 0 else keys)
        if origin.what.startswith(_BUILTIN):
            keys["volume.builtin"] = origin.what.removeprefix(_BUILTIN)
        else:
            keys["volume.path"] = origin.what
        for key, number in zip(("index", "time", "level"), origin.selection, strict=True):
            if number is not None:
                keys[f"volume.{key}"] = number
        if origin.series is not None:
            keys["volume.series"] = str(origin.series)
        return native.Scene("", "volume", ".", keys)

    def __reduce__(self) -> Any:
        if self._origin is not None:
            labels = native.label_array(self._native) if self._origin.has_labels else None
            return _opened_again, (self._origin, labels)
        if self.streamed:
            raise volume_refused("values", "a volume that is streamed", "one of a path, or in memory")
        values = [self._native.values(number) for number in range(self.channels)]
        colors, labels = native.color_array(self._native), native.label_array(self._native)
        return _made_again, (values, colors, self.spacing, labels, native.placement(self._native), self.unit)

    def __repr__(self) -> str:
        z, y, x = self.shape
        facts = [f"{z}×{y}×{x} voxels", f"spacing {self.spacing}" + (f" {self.unit}" if self.unit else "")]
        if self.channels > 1:
            facts.append(f"{self.channels} channels")
        facts.append("values {:g} to {:g}".format(*self._ends()))
        kept = {"holes": self.holes > 0, "labels": self._native.labelled, "streamed": self.streamed}
        facts += [fact for fact, is_there in kept.items() if is_there]
        if self._origin is not None and isinstance(self._origin.what, str):
            facts.append(f"of {self._origin.what}")
        return f"<sheetsplat.Volume of {', '.join(facts)}>"


def _opened_again(origin: Origin, labels: Any) -> Volume:
    """A volume of another process by its path, or by the scene that names it."""
    if not isinstance(origin.what, str):
        volume: Volume = origin.what.load_volume(memory=origin.memory, index=origin.index, progress=False)
        is_other = origin.spacing is not None or labels is not None
        return Volume(volume, spacing=origin.spacing, labels=labels) if is_other else volume
    channel, time, level = origin.selection
    return Volume(
        origin.what,
        spacing=origin.spacing,
        labels=labels,
        memory=origin.memory,
        progress=False,
        channel=channel,
        time=time,
        level=level,
        index=origin.index,
        series=origin.series,
    )


def _made_again(
    values: list[Any], colors: Any, spacing: tuple[float, float, float], labels: Any, lies: Any, unit: str | None
) -> Volume:
    """A volume of another process by its values, whose holes have been told of there."""
    tags = None if labels is None else sources.numbered(labels)
    axes, origin = (None, (0.0, 0.0, 0.0)) if lies is None else lies
    samples = sum(channel.size for channel in values)
    volume = native.Volume.from_arrays(values, spacing, tags, axes, origin, None, unit, samples)
    return Volume._of(volume if colors is None else native.with_colors(volume, colors))


def _open(
    place: stores.Place,
    memory: int | str | None,
    progress: bool,
    selection: list[int | None],
    scene: native.Scene | None,
    spacing: tuple[float, float, float] | None = None,
    labels: Any = None,
    index: str | os.PathLike[str] | None = None,
    series: int | str | None = None,
) -> Volume:
    name, limit = place.path, _memory(memory)
    selection = [
        None if number is None else whole(key, number, 0, 2**32 - 1, VolumeError)
        for key, number in zip(("channel", "time", "level"), selection, strict=True)
    ]
    if series is not None and not isinstance(series, str):
        series = str(whole("series", series, 0, 2**32 - 1, VolumeError))
    tags = sources.labels_of(labels, None, limit)
    is_builtin = name.startswith(_BUILTIN)
    with loading(name, progress and not is_builtin and place.content is None) as bytes_read:
        opened = native.Volume.open(
            name, limit, selection, scene, bytes_read, (spacing, tags), index, series, place.content
        )
    if place.content is not None:
        return Volume._of(opened)
    # The scene may have chosen the level.
    path = name if is_builtin or "://" in name else os.path.abspath(name)
    level = selection[2] if is_builtin else opened.level
    of_index = None if index is None else os.path.abspath(os.fsdecode(index))
    chosen = (selection[0], selection[1], level)
    return Volume._of(opened, Origin(path, memory, of_index, chosen, series, spacing, labels is not None))


def _memory(memory: int | str | None) -> str | None:
    return None if memory is None else str(memory)


def _spacing(spacing: Any) -> tuple[float, float, float]:
    try:
        numbers = [float(number) for number in (spacing if hasattr(spacing, "__len__") else [spacing] * 3)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 3:
        raise volume_refused("spacing", repr(spacing), "a number, or three numbers z, y, x")
    return numbers[0], numbers[1], numbers[2]
