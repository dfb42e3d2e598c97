"""Scenes: what a picture shows and how."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from . import _native as native
from ._checks import finite, names, refused
from ._loading import loading
from .errors import FileError, SceneError
from .volume import Volume, _memory

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
        arrays are all allowed where a scene file has numbers.

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
    __slots__ = ("__weakref__", "_native")
    _native: native.Scene

    def __init__(
        self, source: str | os.PathLike[str] | Mapping[str, Any] | Scene | None = None, /, **settings: Any
    ) -> None:
        if isinstance(source, Scene):
            self._native = source._native.replaced(settings)
            return
        if source is None or isinstance(source, Mapping):
            text, origin, folder = "", "scene", "."
            settings = {**_flat(source or {}), **_flat(settings)}
        elif isinstance(source, str) and ("\n" in source or "=" in source):
            text, origin, folder = source, "scene", "."
        elif isinstance(source, (str, os.PathLike)):
            text, origin, folder = _read(os.fspath(source))
        else:
            raise refused(SceneError, "scene", type(source).__name__, "a text, a path, a mapping or a Scene")
        self._native = native.Scene(text, origin, folder, settings)

    @classmethod
    def _of(cls, checked: native.Scene) -> Scene:
        scene = cls.__new__(cls)
        scene._native = checked
        return scene

    def replace(self, **settings: Any) -> Scene:
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
        return self._native.names_volume

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
            return Volume._of(self._native.load_volume(_memory(memory), bytes_read, index))

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
        return Scene._of(self._native.explicit(volume._native, all_around, names(annotate)))

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

    def seen_from(self, volume: Volume, side: str) -> Scene:
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
        return Scene._of(self._native.seen_from(volume._native, side))

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
        return _restored, (self.to_toml(folder), folder)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self._native == other._native

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<sheetsplat.Scene\n{self.to_toml()}>"


def _restored(text: str, folder: str) -> Scene:
    return Scene._of(native.Scene(text, "scene", folder, {}))


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
