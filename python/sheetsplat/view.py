"""Pictures of a volume: one, or many of a view."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Unpack

from . import _native as native
from . import _stores as stores
from . import _words as words
from ._checks import finite, names, refused, whole
from ._settings import Arguments, Backend, Settings, completed
from .errors import SceneError
from .image import Image
from .part import Part, merge
from .scene import Scene
from .volume import Volume, _open, _spacing

__all__ = ["View", "info", "render"]

_SCENE_FILE = ".toml"


class View:
    """A view of a volume for any number of pictures.

    The volume is read once, and a change computes again only what depends on it: on the CPU another transfer function,
    clip plane, kernel or classification classifies the voxels again, and nothing else does; on the GPU everything but
    the camera. Pictures are drawn without holding Python's lock, so that views in several threads draw at once; threads
    that share a view take turns.

    Parameters
    ----------
    source : array, image of SimpleITK or nibabel, path, Volume or Scene
        What is drawn: anything that `Volume` takes, or a scene (or the path of a scene file) that names its volume.
    spacing, labels
        As for `Volume`.
    scene : Scene, mapping, str or path, optional
        How it is drawn: a scene, or what `Scene` takes. A volume that it names is ignored.
    backend : str
        ``"cpu"`` needs no driver and gives the same bytes on every machine; ``"gpu"``; ``"auto"``, a GPU if there is
        one; or ``"reference"``, slow and in 64 bits.
    adapter : str, optional
        Part of the name of the GPU.
    memory : int or str, optional
        As for `Volume`. Of a store with several levels the coarsest is drawn whose voxels are no larger than a pixel.
    progress : bool
        Show a bar while a path is read for more than a second, if tqdm is installed.
    index : str or path, optional
        As for `Volume`.
    annotate : str or sequence of str
        Words beside every picture, which then takes less of the image: ``"scale"``, a bar of a round length;
        ``"colors"``, the colour of each value, for each channel; ``"legend"``, the colour of each label or channel;
        ``"sides"``, the sides of the patient (R, L, A, P, S, I).
    light : str or path, optional
        Light sheets that `save_light` or ``sheetsplat light`` has made of the same scene: the same pictures, sooner.
    **settings
        Settings over those of `scene`, and words for some of them, as for `Scene`: `cmap`, `clim`, `opacity`,
        `background`, `size`, `view`, `azimuth`, `elevation`, `zoom`, `only`.

    Examples
    --------
    >>> view = View("builtin:head:16", image={"width": 32, "height": 32})
    >>> front = view.render()
    >>> view.set(camera={"direction": [1, 0, 0]})
    >>> side = view.render()
    >>> front.width, side.stats["voxels_total"]
    (32, 2560)
    """

    # Settings are changed by `set`: to assign one would do nothing.
    __slots__ = ("__weakref__", "_annotate", "_inputs", "_native", "_scene", "_stated", "_volume")

    #: The scene as it was stated, with its words, and as it is drawn, with all of them as keys.
    _stated: Scene
    _scene: Scene

    @completed
    def __init__(
        self,
        source: Any,
        *,
        spacing: float | Sequence[float] | None = None,
        labels: Any = None,
        scene: Scene | Mapping[str, Any] | str | os.PathLike[str] | None = None,
        backend: Backend = "cpu",
        adapter: str | None = None,
        memory: int | str | None = None,
        progress: bool = True,
        index: str | os.PathLike[str] | None = None,
        annotate: str | Sequence[str] = (),
        light: str | os.PathLike[str] | None = None,
        **settings: Unpack[Settings],
    ) -> None:
        words.check_names(settings, words.ARGUMENTS)
        volume, self._stated = _what_and_how(source, spacing, labels, scene, settings, memory, progress, index)
        self._volume, self._annotate = volume, names(annotate)
        self._scene = self._stated._for(volume, annotate=self._annotate)
        self._native = native.View(
            volume._native, self._scene._native, backend, adapter, self._annotate, light, volume._named()
        )
        self._inputs = [volume._native.inputs]

    @property
    def volume(self) -> Volume:
        """The volume."""
        return self._volume

    @property
    def scene(self) -> Scene:
        """The settings, with all words as the keys that they are for the volume. Assigning other ones changes the next picture."""
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        drawn = scene._for(self._volume, annotate=self._annotate)
        self._native.set_scene(drawn._native)
        self._stated, self._scene = scene, drawn

    def _with(self, **settings: Unpack[Settings]) -> Scene:
        """The scene as it was stated, with other settings over it."""
        words.check_names(settings, words.SETTINGS)
        return self._stated.replace(**settings)

    @property
    def backend(self) -> str:
        """The backend that draws: ``"cpu"``, ``"gpu"`` or ``"reference"``."""
        return self._native.backend

    @completed
    def set(self, **settings: Unpack[Settings]) -> None:
        """Changes settings. If one is not allowed, nothing changes.

        Parameters
        ----------
        **settings
            Settings over those of the view, as for `Scene`.

        Raises
        ------
        SceneError
            If a key is unknown, a value is not allowed, or the backend does not draw it.
        """
        self.scene = self._with(**settings)

    def save_light(self, path: str | os.PathLike[str]) -> None:
        """Saves the view's light sheets, for `View` with ``light``, and ``sheetsplat render --light``.

        Parameters
        ----------
        path : path
            ``.npz``.

        Raises
        ------
        SceneError
            If the view has neither occlusion nor a shadow, or nothing keeps light off.
        """
        self._native.save_light(path, self._inputs)

    @completed
    def render(self, **settings: Unpack[Settings]) -> Image:
        """Draws a picture.

        Parameters
        ----------
        **settings
            Settings that are changed before, as by `set`, and stay.

        Returns
        -------
        Image
            The picture, with its `stats`.

        Raises
        ------
        SceneError
            If a setting is not allowed.
        RenderError
            If the picture needs more than the GPU allows.
        DeviceError
            If the GPU fails.
        """
        if settings:
            self.set(**settings)
        array, stats, made_on, provenance = self._native.draw()
        return Image._of(array, json.loads(stats), made_on, self._inputs, provenance)

    def to_html(self, path: str | os.PathLike[str]) -> None:
        """Saves a page of one file, in which the volume turns in a browser of 2023 or later, without a network.

        The page has the library for the CPU in it, which takes 0.9 MB, and the volume with its labels. Words beside the
        picture (`annotate`) are left out.

        Parameters
        ----------
        path : path
            The file, ``.html``.

        Raises
        ------
        FileError
            If the package was made without the page's files, or the file cannot be written.
        VolumeError
            If the volume is streamed, or has more than 134 million values.
        """
        from ._page import page

        start = self._stated.explicit(self._volume, all_around=True)
        text = page(self._volume, start, self.render()._repr_png_())
        native.write(os.path.expanduser(os.fspath(path)), text.encode(), self._inputs)

    def part(
        self,
        *,
        slabs: tuple[int, int] | None = None,
        region: tuple[int, int, int, int] | None = None,
    ) -> Part:
        """Draws a part of the picture, which `merge` puts together with the others.

        Parameters
        ----------
        slabs : tuple of int, optional
            The first slab and the one after the last, from front to back as ``splatting.slab_width`` cuts the volume;
            they may reach beyond the scene's. All slabs without it.
        region : tuple of int, optional
            The first column, the first row, the width and the height of the part's pixels. All pixels without it.

        Examples
        --------
        >>> view = View("builtin:head:16", image={"width": 32, "height": 32}, splatting={"opacity_threshold": 1})
        >>> upper, lower = view.part(region=(0, 0, 32, 16)), view.part(region=(0, 16, 32, 16))
        >>> merge([lower, upper])
        <sheetsplat.Image of 32×32 pixels>
        """
        if slabs is not None:
            first, end = _several("slabs", slabs, 2, -(2**31), 2**31 - 1)
            slabs = first, end
        if region is not None:
            x, y, width, height = _several("region", region, 4, 0, 2**32 - 1)
            region = x, y, width, height
        drawn, stats = self._native.draw_part(slabs, region)
        return Part._of(drawn, json.loads(stats), self._inputs)

    def split(self, count: int) -> list[dict[str, Any]]:
        """Parts of about equal work, as keyword arguments for `part`.

        Parameters
        ----------
        count : int
            The number of parts.

        Returns
        -------
        list of dict
            `slabs` and `region` of each part.

        Examples
        --------
        >>> view = View("builtin:head:16", image={"width": 32, "height": 32}, splatting={"opacity_threshold": 1})
        >>> merge(view.part(**piece) for piece in view.split(4))
        <sheetsplat.Image of 32×32 pixels>
        """
        count = whole("count", count, 1, 2**31 - 1)
        pieces = native.split(self._volume._native, self._scene._native, count)
        return [{"slabs": slabs, "region": region} for slabs, region in pieces]

    def orbit(
        self, *, count: int = 120, turn: float = 360.0, frames: range | None = None
    ) -> Iterator[Image]:
        """Draws a turntable, one picture at each step of the iterator.

        Parameters
        ----------
        count : int
            The number of pictures of the whole turn.
        turn : float
            Degrees over all pictures, right-handed about ``camera.up``.
        frames : range, optional
            Draw only these of the `count` pictures.

        Yields
        ------
        Image
            The pictures in their order.
        """
        frames, turn = _frames(count, frames), finite("turn", turn)
        start = self._stated.explicit(self._volume, all_around=True, annotate=self._annotate)
        return self._turns(start, frames, turn / count)

    def _turns(self, start: Scene, frames: range, step: float) -> Iterator[Image]:
        for frame in frames:
            self.scene = start.turned(step * frame)
            yield self.render()

    def __repr__(self) -> str:
        return f"<sheetsplat.View of {self._volume!r} by {self.backend}>"


def _what_and_how(
    source: Any,
    spacing: float | Sequence[float] | None,
    labels: Any,
    scene: Scene | Mapping[str, Any] | str | os.PathLike[str] | None,
    settings: Settings,
    memory: int | str | None,
    progress: bool,
    index: str | os.PathLike[str] | None = None,
) -> tuple[Volume, Scene]:
    if isinstance(source, Scene) or _is_scene_file(source):
        _check_single(scene)
        source = look = Scene(source, **settings)
    else:
        look = Scene(scene, **settings)
        if any(key == "volume" or key.startswith("volume.") for key in settings):
            allowed = "no such key: `source`, `spacing` and `labels`"
            raise refused(SceneError, "volume", "a volume beside the source", allowed)
    return _opened(source, look, spacing, labels, memory, progress, index), look


def _check_single(scene: object) -> None:
    """Checks that no scene is given beside a source that is one."""
    if scene is not None:
        raise refused(SceneError, "scene", "a scene beside a source that is one", "either `scene` or such a source")


def _opened(
    source: Any,
    look: Scene,
    spacing: float | Sequence[float] | None,
    labels: Any,
    memory: int | str | None,
    progress: bool,
    index: str | os.PathLike[str] | None = None,
) -> Volume:
    """The volume that a scene names, or another source's for a scene that may choose its level."""
    place = None if isinstance(source, Scene) else stores.located(source)
    if place is not None:
        steps = None if spacing is None else _spacing(spacing)
        return _open(place, memory, progress, [None, None, None], look._opening, steps, labels, index)
    if isinstance(source, Scene):
        volume = source.load_volume(memory=memory, progress=progress, index=index)
    elif isinstance(source, Volume):
        volume = source
    else:
        return Volume(source, spacing=spacing, labels=labels, memory=memory)
    if spacing is not None or labels is not None:
        volume = Volume(volume, spacing=spacing, labels=labels, memory=memory)
    return volume


def _is_scene_file(source: Any) -> bool:
    return isinstance(source, (str, os.PathLike)) and os.fsdecode(source).lower().endswith(_SCENE_FILE)


def _several(key: str, numbers: Any, count: int, low: int, high: int) -> list[int]:
    """Some whole numbers within bounds."""
    try:
        given = list(numbers)
    except TypeError:
        given = []
    if len(given) != count:
        raise refused(SceneError, key, repr(numbers), f"{count} whole numbers")
    return [whole(key, number, low, high) for number in given]


def _frames(count: int, frames: range | None) -> range:
    count = whole("count", count, 1, 2**31 - 1)
    if frames is None:
        return range(count)
    if not isinstance(frames, range) or any(not 0 <= frame < count for end in (frames[:1], frames[-1:]) for frame in end):
        raise refused(SceneError, "frames", repr(frames), f"a range within range(0, {count})")
    return frames


@completed
def render(source: Any, **arguments: Unpack[Arguments]) -> Image:
    """Draws one picture.

    Parameters
    ----------
    source
        What is drawn: an array ``[z, y, x]``, an image of SimpleITK or nibabel, a path, a `Volume` or a `Scene`.
    **arguments
        As for `View`: `spacing`, `labels`, `scene`, `backend`, `adapter`, `memory`, `progress`, `index`, `annotate`,
        `light`, and settings or words as for `Scene`: `preset`, `cmap`, `clim`, `opacity`, `size`, `view`, ...

    Returns
    -------
    Image
        The picture, with its `stats`.

    Examples
    --------
    >>> import numpy as np
    >>> z, y, x = np.ogrid[-1:1:24j, -1:1:24j, -1:1:24j]
    >>> ball = 100 * (x * x + y * y + z * z < 0.5)
    >>> image = render(ball, image={"width": 64, "height": 64})
    >>> np.asarray(image).shape
    (64, 64, 4)
    """
    return View(source, **arguments).render()


def info(
    source: Any, *, spacing: float | Sequence[float] | None = None, memory: int | str | None = None, progress: bool = True
) -> dict[str, Any]:
    """Facts about a volume, as `Volume.info`.

    Parameters
    ----------
    source
        The volume, as for `View`.
    spacing, memory, progress
        As for `Volume`.

    Returns
    -------
    dict
        The facts, by the names of ``sheetsplat info --json``.

    Examples
    --------
    >>> info("builtin:cube:8")["shape"]
    [8, 8, 8]
    """
    return _what_and_how(source, spacing, None, None, {}, memory, progress)[0].info()
