"""A live picture for notebooks: the kernel draws it, the browser shows it and sends what the pointer does.

Only this module needs ``anywidget``.
"""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Unpack

try:
    import anywidget
    import traitlets
except ImportError as error:
    raise ImportError("sheetsplat.Widget needs anywidget: pip install 'sheetsplat[jupyter]'") from error

from . import _native as native
from . import _words as words
from ._settings import Backend, Settings, completed
from .errors import SceneError, SheetsplatError
from .image import Image
from .painter import Painter
from .scene import Scene
from .view import View
from .volume import Volume

__all__ = ["Widget"]

#: Degrees that a drag over the picture's height turns the camera.
_TURN = 180.0

#: The largest elevation of the camera in degrees: at 90 the screen has no up.
_MOST_ELEVATION = 89.0

#: The least and the largest magnification.
_ZOOMS = (0.01, 1000.0)


class Widget(anywidget.AnyWidget):  # type: ignore[misc]
    """A picture in a notebook that follows the pointer. Needs ``pip install 'sheetsplat[jupyter]'``.

    Dragging turns the camera, with Shift or another button it moves the centre; the wheel or two fingers zoom; a double
    click returns to the camera that Python stated last. The arrow keys, with or without Shift, +, - and Home do the
    same. While the picture changes it is drawn with fewer pixels if whole pictures take long. Where widgets cannot be
    shown, such as in a notebook on a web page, the picture of the moment when the cell ran takes its place.

    Parameters
    ----------
    source, spacing, labels, scene, backend, adapter, **settings
        As for `View`. The object keeps its size in all directions, as in a turntable.

    Attributes
    ----------
    azimuth : float
        Degrees by which the camera has turned right-handed about ``camera.up``. This and the next three are traits,
        which can be observed, linked and set.
    elevation : float
        Degrees of the eye over the plane perpendicular to ``camera.up``, from -89 to 89.
    zoom : float
        The magnification, from 0.01 to 1000; 1 for the camera that Python stated last.
    center : tuple of three floats
        The world point at the picture's centre.

    Examples
    --------
    >>> widget = Widget("builtin:head:16", preset="ct-bone", image={"width": 32, "height": 32})
    >>> widget.azimuth = 30
    >>> widget.set(preset="ct-skin")
    >>> widget.image
    <sheetsplat.Image of 32×32 pixels>
    >>> widget.scene.to_dict()["preset"]
    'ct-skin'
    """

    # Texts, because anywidget watches files, and would keep every widget as long as its file.
    _esm = Path(__file__).with_name("widget.js").read_text(encoding="utf-8")
    _css = Path(__file__).with_name("widget.css").read_text(encoding="utf-8")

    azimuth = traitlets.Float(0.0).tag(sync=True)
    elevation = traitlets.Float(0.0).tag(sync=True)
    zoom = traitlets.Float(1.0).tag(sync=True)
    center = traitlets.Tuple(traitlets.Float(), traitlets.Float(), traitlets.Float()).tag(sync=True)

    #: What the browser shows: a PNG, rough or whole; the whole one's width and height; and what went wrong.
    _png = traitlets.Bytes(b"").tag(sync=True)
    _size = traitlets.Tuple(traitlets.Int(), traitlets.Int()).tag(sync=True)
    _problem = traitlets.Unicode("").tag(sync=True)

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
        **settings: Unpack[Settings],
    ) -> None:
        view = View(
            source,
            spacing=spacing,
            labels=labels,
            scene=scene,
            backend=backend,
            adapter=adapter,
            **settings,
        )
        self._volume, self._backend = view.volume, view.backend
        self._painter = Painter(view, self._show, self._fail)
        #: The scene as Python stated it.
        self._stated = view._stated
        #: The same with everything stated that depends on the volume, and the camera that the traits start from.
        self._home = self._stated.explicit(view.volume, all_around=True)
        self._is_placing = False
        #: Whether the browser keeps its next message back until a picture comes.
        self._is_awaited = False
        elevation, center = native.elevation_and_center(self._home._native)
        super().__init__(elevation=elevation, center=center, _size=_size(self._home))
        self.observe(self._camera_changed, ["azimuth", "elevation", "zoom", "center"])
        self.on_msg(self._receive)
        self._ask()

    @property
    def volume(self) -> Volume:
        """The volume."""
        return self._volume

    @property
    def backend(self) -> str:
        """The backend that draws: ``"cpu"``, ``"gpu"`` or ``"reference"``."""
        return self._backend

    @property
    def scene(self) -> Scene:
        """The settings with the camera of now: `render` draws the same picture by them.

        Assigning other ones changes the picture, and the camera to what they state.
        """
        return Scene._of(native.with_camera(self._stated._for(self._volume)._native, self._placed()._native))

    @scene.setter
    def scene(self, scene: Scene) -> None:
        self._state(scene, keeps_camera=False)

    @property
    def image(self) -> Image:
        """The whole picture of the scene; waits until it is drawn, and raises what kept it from being drawn."""
        return self._painter.whole()

    @completed
    def set(self, **settings: Unpack[Settings]) -> None:
        """Changes settings. If one is not allowed, nothing changes.

        The camera stays where it is, unless a setting of the camera is among them: then it is where the settings state
        it.

        Parameters
        ----------
        **settings
            Settings over those of the widget, as for `Scene`.
        """
        states_camera = any(key.split(".")[0] == "camera" or key in words.OF_CAMERA for key in settings)
        self._state(self._stated.replace(**settings), keeps_camera=not states_camera)

    def _state(self, stated: Scene, *, keeps_camera: bool) -> None:
        home = stated.explicit(self._volume, all_around=True)
        if keeps_camera:
            home = Scene._of(native.with_camera(home._native, self._home._native))
        self._painter.prepare(home)
        self._stated, self._home, self._size = stated, home, _size(home)
        if keeps_camera:
            self._ask()
        else:
            self._go_home()

    def _go_home(self) -> None:
        elevation, center = native.elevation_and_center(self._home._native)
        with self._placing():
            self.azimuth, self.elevation, self.zoom, self.center = 0.0, elevation, 1.0, center

    @contextmanager
    def _placing(self) -> Iterator[None]:
        """Asks for one picture after several changes of the camera."""
        self._is_placing = True
        try:
            yield
        finally:
            self._is_placing = False
            self._ask()

    def _camera_changed(self, change: object) -> None:
        if not self._is_placing:
            self._ask()

    def _placed(self) -> Scene:
        """The scene with everything stated, and the camera where the traits place it."""
        home = self._home._native
        return Scene._of(native.placed(home, self.azimuth, self.elevation, self.zoom, self.center))

    def _ask(self) -> None:
        self._painter.ask(self._placed())

    @traitlets.validate("azimuth")
    def _check_azimuth(self, proposal: dict[str, Any]) -> float:
        return _checked("azimuth", proposal["value"], -math.inf, math.inf)

    @traitlets.validate("elevation")
    def _check_elevation(self, proposal: dict[str, Any]) -> float:
        # A scene may state a steeper camera, which is kept until it is turned.
        most = max(_MOST_ELEVATION, abs(native.elevation_and_center(self._home._native)[0]))
        return _checked("elevation", proposal["value"], -most, most)

    @traitlets.validate("zoom")
    def _check_zoom(self, proposal: dict[str, Any]) -> float:
        return _checked("zoom", proposal["value"], *_ZOOMS)

    @traitlets.validate("center")
    def _check_center(self, proposal: dict[str, Any]) -> tuple[float, ...]:
        return tuple(_checked("center", value, -math.inf, math.inf) for value in proposal["value"])

    def _receive(self, _: object, content: dict[str, Any], buffers: object) -> None:
        """Moves the camera by what pointer and keys have done since the last message, in heights of the picture."""
        self._is_awaited = True
        try:
            self._move(content["home"], content["orbit"], content["pan"], content["zoom"])
        except Exception as error:
            # It has no caller to be raised to.
            self._fail(error)

    def _move(self, is_home: bool, orbit: Sequence[float], pan: Sequence[float], zoom: float) -> None:
        if is_home:
            self._go_home()
        with self._placing():
            # Within the range of a slider from -180 to 180.
            self.azimuth = math.remainder(self.azimuth - orbit[0] * _TURN, 360.0)
            if orbit[1] != 0:
                elevation = self.elevation + orbit[1] * _TURN
                self.elevation = min(max(elevation, -_MOST_ELEVATION), _MOST_ELEVATION)
            self.zoom = min(max(self.zoom / zoom, _ZOOMS[0]), _ZOOMS[1])
            if any(pan):
                self.center = native.panned(self._placed()._native, self._volume._native, *pan)

    def _show(self, image: Image) -> None:
        self._png, self._problem = image._repr_png_(), ""
        self._answer()

    def _fail(self, error: Exception) -> None:
        self._problem = str(error) or type(error).__name__
        self._answer()

    def _answer(self) -> None:
        """Asks the browser for its next message once a picture is on its way, so that a slow line bears one at a time."""
        if self._is_awaited:
            self._is_awaited = False
            self.send({"kind": "drawn"})

    def _repr_mimebundle_(self, **arguments: Any) -> Any:
        bundle = super()._repr_mimebundle_(**arguments)
        # The widget itself shows what kept the picture from being drawn.
        with suppress(SheetsplatError):
            bundle[0]["image/png"] = base64.b64encode(self.image._repr_png_()).decode()
        return bundle

    def __repr__(self) -> str:
        return f"<sheetsplat.Widget of {self._volume!r} by {self._backend}>"


def _size(scene: Scene) -> tuple[int, int]:
    image = scene.to_dict()["image"]
    return image["width"], image["height"]


def _checked(name: str, value: float, low: float, high: float) -> float:
    if math.isfinite(value) and low <= value <= high:
        return value
    allowed = "a finite number" if math.isinf(high) else f"{low:g} to {high:g}"
    raise SceneError(f"{name}: found {value:g}, allowed: {allowed}", name, f"{value:g}", allowed)
