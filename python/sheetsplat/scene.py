"""Scenes: what a picture shows and how."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

from . import _native as native
from . import _words as words
from ._checks import finite, names, paths, refused
from ._loading import loading
from ._settings import Settings, Side, completed
from .errors import FileError, SceneError
from .volume import Origin, Volume, _memory

__all__ = ["Scene"]


class Scene:
    """Everything that determines a picture, in the vocabulary of scene files.

    Parameters
    ----------
    source : str, path, mapping or Scene, optional
        The text of a scene file (anything with a line break or ``=``), the path of one, or a mapping, which is
        another way to write `settings`. Without it, every setting has its default.
    **settings
        Settings over those of `source`: the tables of a scene file as dictionaries (``camera={"up": [0, 1, 0]}``),
        and ``preset``. A key may also be a path: ``{"camera.up": [0, 1, 0]}``. Numbers, lists, tuples and NumPy
        arrays are all allowed where a scene file has numbers. Beside them words, each of which is some of these keys:

        cmap, colormap : name, colour map of matplotlib, or colours
            ``transfer.colormap``, or ``transfer.color`` over `clim`; over the visible values without it.
        clim : two numbers; vmin, vmax : number
            The values over which `cmap` and `opacity` lie. Without `opacity`, ``transfer.opacity`` rises from 0 to 1.
        opacity : ``"sigmoid"``, ``"linear"``, ``"linear_r"``, numbers, or pairs of a value and its opacity
            ``transfer.opacity``, over `clim`; over all values without it.
        background : colour
            ``image.background``.
        size : int or two ints
            ``image.width`` and ``image.height``.
        view, side : name
            ``camera.direction`` and ``camera.up``: a side of the patient (``"front"``, ``"back"``, ``"left"``,
            ``"right"``, ``"top"``, ``"bottom"``), or by the volume's axes ``"iso"``, ``"xy"``, ``"xz"``, ``"yz"``,
            ``"yx"``, ``"zx"``, ``"zy"``, of which the first points right and the second up.
        azimuth, elevation : degrees
            ``camera.direction`` and ``camera.up``: the eye goes to the right and then up, from where it would be.
        zoom : number above 0
            ``camera.height`` (in perspective ``distance``) of the framed picture, divided by this.
        only : str or int
            ``transfer.label`` with ``visible = false`` for all labels but this one, given by its name or its number; of a
            label map, ``transfer.iso_ranges``.

    Raises
    ------
    SceneError
        If a key is unknown or a value is not allowed. The error names the key.
    FileError
        If the file cannot be read.

    Examples
    --------
    >>> scene = Scene(camera={"direction": [0, 1, 0]}, image={"width": 64, "height": 64})
    >>> scene.to_dict()["image"]["width"]
    64
    >>> Scene(camera={"up": "north"})
    Traceback (most recent call last):
    ...
    sheetsplat.errors.SceneError: camera.up: found "north" (string), allowed: 3 numbers, each a finite number
    """

    # A scene does not change: to assign a setting would do nothing.
    __slots__ = ("__weakref__", "_bare", "_stated", "_unknown", "_words")
    #: The scene without its words.
    _bare: native.Scene
    _words: dict[str, words.Said]
    #: The scene with the words that are keys without the volume, and the names of the others.
    _stated: native.Scene
    _unknown: list[str]

    @completed
    def __init__(
        self,
        source: str | os.PathLike[str] | Mapping[str, Any] | Scene | None = None,
        /,
        **settings: Unpack[Settings],
    ) -> None:
        words.check_names(settings, words.SETTINGS)
        said, keys = words.split(_flat(settings))
        if isinstance(source, Scene):
            self._keep(source._bare.replaced(keys), words.merged(source._words, said, keys))
            return
        before: dict[str, words.Said] = {}
        text, origin, folder = "", "scene", "."
        if isinstance(source, Mapping):
            words.check_names(source, words.SETTINGS)
            before, stated = words.split(_flat(source))
            before, keys = words.merged(before, said, keys), {**stated, **keys}
            said = {}
        elif isinstance(source, str) and ("\n" in source or "=" in source):
            text = source
        elif isinstance(source, (str, os.PathLike)):
            text, origin, folder = _read(os.path.expanduser(os.fspath(source)))
        elif source is not None:
            raise refused(SceneError, "scene", type(source).__name__, "a text, a path, a mapping or a Scene")
        self._keep(native.Scene(text, origin, folder, keys), words.merged(before, said, ()))

    def _keep(self, bare: native.Scene, said: dict[str, words.Said]) -> None:
        self._bare, self._words = words.plain(bare, said)
        self._stated, self._unknown = words.stated(self._bare, self._words)

    @classmethod
    def _of(cls, checked: native.Scene) -> Scene:
        scene = cls.__new__(cls)
        scene._keep(checked, {})
        return scene

    @classmethod
    def from_picture(
        cls, path: str | os.PathLike[str], *, search: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = ()
    ) -> Scene:
        """The scene of a picture that tells how it was made, with its volume if that came from a file.

        Parameters
        ----------
        path : path
            A PNG or EXR file that `Image.save`, or ``sheetsplat render``, wrote.
        search : path or sequence of path
            Folders in which to look for files that are not in the picture's own folder.

        Returns
        -------
        Scene
            The scene, which draws the same picture by the same backend, without the words beside it.

        Raises
        ------
        FileError
            If the file cannot be read.
        ImageError
            If it holds no scene.
        SceneError
            If a file is missing that the scene names.
        """
        return cls._of(native.scene_of_picture(os.path.expanduser(os.fsdecode(path)), paths(search)))

    @property
    def _native(self) -> native.Scene:
        """The scene, if no word depends on the volume."""
        if self._unknown:
            said = ", ".join(self._unknown)
            found = "a word that depends on the volume" if len(self._unknown) == 1 else "words that depend on the volume"
            raise refused(SceneError, said, found, "a scene for a volume: scene.explicit(volume), or View(volume, ...).scene")
        return self._stated

    def _for(self, volume: Volume, *, all_around: bool = False, annotate: Sequence[str] = ()) -> Scene:
        """The scene with all its words as keys, for a volume."""
        if not self._words:
            return self
        return Scene._of(words.settled(self._bare, self._words, volume, all_around, annotate))

    @property
    def _opening(self) -> native.Scene:
        """The scene that chooses the level of a volume: a magnified picture has smaller pixels, as a larger one has."""
        zoom = self._words["zoom"].value if "zoom" in self._words else 1.0
        if zoom == 1.0:
            return self._stated
        image = tomllib.loads(self._stated.to_toml("."))["image"]
        sizes = {f"image.{key}": min(max(round(image[key] * zoom), 1), 2**31 - 1) for key in ("width", "height")}
        return self._stated.replaced(sizes)

    @completed
    def replace(self, **settings: Unpack[Settings]) -> Scene:
        """The same scene with other settings over it; this one does not change.

        Parameters
        ----------
        **settings
            The settings, as for `Scene`.

        Returns
        -------
        Scene
            The other scene.
        """
        return Scene(self, **settings)

    @property
    def names_volume(self) -> bool:
        """Whether ``volume.path`` or ``volume.builtin`` is stated."""
        return self._stated.names_volume

    def load_volume(
        self,
        *,
        memory: int | str | None = None,
        progress: bool = True,
        index: str | os.PathLike[str] | None = None,
    ) -> Volume:
        """Opens the volume that the scene names.

        Parameters
        ----------
        memory, progress, index
            As for `Volume`.

        Returns
        -------
        Volume
            The volume.
        """
        with loading(None, progress) as bytes_read:
            opened = self._opening.load_volume(_memory(memory), bytes_read, index)
        of_index = None if index is None else os.path.abspath(os.fsdecode(index))
        # With the paths that its relative ones are now.
        return Volume._of(opened, Origin(_restored(*self.__reduce__()[1]), memory, of_index))

    def explicit(
        self, volume: Volume, *, all_around: bool = False, annotate: str | Sequence[str] = ()
    ) -> Scene:
        """The same scene with everything stated that depends on the volume.

        Parameters
        ----------
        volume : Volume
            The volume that determines the transfer function and the camera's position.
        all_around : bool
            Place the camera so that the object stays in the picture at constant size while the camera turns.
        annotate : str or sequence of str
            The words of the views that will draw the scene, as for `View`: the camera leaves room for them.

        Returns
        -------
        Scene
            The scene, which draws the same picture wherever its volume is drawn.
        """
        beside = names(annotate)
        scene = self._for(volume, all_around=all_around, annotate=beside)
        return Scene._of(scene._native.explicit(volume._native, all_around, beside))

    def turned(self, degrees: float) -> Scene:
        """The scene with its camera turned about ``camera.up``.

        Parameters
        ----------
        degrees : float
            The angle, right-handed.

        Returns
        -------
        Scene
            The other scene.
        """
        return Scene._of(self._native.turned(finite("turn", degrees)))

    def seen_from(self, volume: Volume, side: Side) -> Scene:
        """The scene with its camera on a side of the patient.

        Parameters
        ----------
        volume : Volume
            A volume that says how the patient lies.
        side : str
            ``"front"``, ``"back"``, ``"left"``, ``"right"``, ``"top"`` or ``"bottom"``.

        Returns
        -------
        Scene
            The other scene.
        """
        return self.replace(side=side)._for(volume)

    def to_toml(self, folder: str | os.PathLike[str] = ".") -> str:
        """The text of a scene file.

        Parameters
        ----------
        folder : path
            The folder of the file, to which paths in it are relative.

        Returns
        -------
        str
            The text.
        """
        return self._native.to_toml(folder)

    def to_dict(self) -> dict[str, Any]:
        """The settings as nested dictionaries."""
        return tomllib.loads(self.to_toml())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a scene file, whole or not at all.

        Parameters
        ----------
        path : path
            The file. Paths in it are relative to its folder.

        Raises
        ------
        FileError
            If the file cannot be written.
        VolumeError
            If the file is a volume, or labels, that the scene names.
        """
        target = Path(path)
        self._native.check_output(target)
        native.write(target, self.to_toml(target.parent).encode(), [])

    def __reduce__(self) -> Any:
        folder = os.getcwd()
        return _restored, (self._bare.to_toml(folder), folder, self._words)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scene):
            return False
        # Words that are keys already are the same scene as these keys.
        ours, others = (scene._words if scene._unknown else {} for scene in (self, other))
        return self._stated == other._stated and ours == others

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        said = "".join(f" {word.name}={word.value!r}" for word in self._words.values() if word.name in self._unknown)
        return f"<sheetsplat.Scene{said}\n{self._stated.to_toml('.')}>"


def _restored(text: str, folder: str, said: dict[str, words.Said]) -> Scene:
    scene = Scene.__new__(Scene)
    scene._keep(native.Scene(text, "scene", folder, {}), said)
    return scene


def _flat(table: Mapping[Any, Any], path: str = "") -> dict[Any, Any]:
    """Settings by their whole keys, so that those of one table can replace single ones of another."""
    flat: dict[Any, Any] = {}
    for key, value in table.items():
        whole = f"{path}{key}" if isinstance(key, str) else key
        if isinstance(value, Mapping) and isinstance(key, str):
            flat |= _flat(value, f"{whole}.")
        else:
            flat[whole] = value
    return flat


def _read(path: str) -> tuple[str, str, str]:
    try:
        text = Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: found {error.reason}, allowed: text in UTF-8") from error
    except OSError as error:
        raise FileError(error.errno, error.strerror, path) from error
    return text, path, os.path.dirname(path) or "."
