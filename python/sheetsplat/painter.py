"""A thread that draws the newest of the scenes that a view is to show: quickly while they change, then whole."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

from . import _native as native
from .image import Image
from .scene import Scene
from .view import View

__all__ = ["Painter"]

#: The seconds of a frame with which a picture follows a pointer smoothly.
_FLUENT = 0.1

#: The seconds without a change after which a rough picture is drawn whole.
_PAUSE = 0.2

#: The largest number of pixels of a whole picture, along a side, that share one of a rough one.
_MOST = 4


class Painter:
    """Draws the newest scene that was asked for; those that a newer one overtakes are never drawn.

    Parameters
    ----------
    view : View
        What draws. Nobody else may use it.
    show : callable
        Gets each picture, rough or whole, in the painter's thread.
    fail : callable
        Gets the error if a scene cannot be drawn, in the painter's thread.
    """

    def __init__(self, view: View, show: Callable[[Image], None], fail: Callable[[Exception], None]) -> None:
        self._view, self._show, self._fail = view, show, fail
        #: Held while the view is used.
        self._drawing = threading.Lock()
        #: Guards all that follows.
        self._changed = threading.Condition()
        self._wanted = view.scene
        #: The whole picture of the scene that is wanted, or why there is none.
        self._result: Image | BaseException | None = None
        #: The number of threads that wait for it.
        self._waiting = 0
        self._is_running = False
        #: How long the last whole picture took.
        self._seconds = 0.0

    def prepare(self, scene: Scene) -> None:
        """Changes what the view shows, so that an error of the settings is raised here; then nothing changes.

        Parameters
        ----------
        scene : Scene
            What it shows.
        """
        with self._drawing:
            self._view.scene = scene

    def ask(self, scene: Scene) -> None:
        """Has a scene drawn, in place of those asked for before.

        Parameters
        ----------
        scene : Scene
            What is drawn.
        """
        with self._changed:
            self._wanted, self._result = scene, None
            self._changed.notify_all()
            if not self._is_running:
                self._is_running = True
                # No daemon: the interpreter waits for its picture at exit, since native code must not outlive Python.
                threading.Thread(target=self._run, name="sheetsplat-painter", daemon=False).start()

    def whole(self) -> Image:
        """Waits for the whole picture of the newest scene, and returns it or raises its error."""
        with self._changed:
            self._waiting += 1
            self._changed.notify_all()
            try:
                self._changed.wait_for(lambda: self._result is not None)
            finally:
                self._waiting -= 1
            result = self._result
        if isinstance(result, Image):
            return result
        assert result is not None
        raise result

    def _run(self) -> None:
        try:
            while self._paint():
                pass
        except BaseException as error:
            # Neither a picture nor an error can be shown any more, as at the end of a kernel. Nobody waits for it forever.
            with self._changed:
                self._is_running, self._result = False, error
                self._changed.notify_all()
            raise

    def _paint(self) -> bool:
        """Draws the newest scene, first roughly if it must be; whether there may be more to draw."""
        with self._changed:
            if self._result is not None:
                self._is_running = False
                return False
            scene, is_awaited = self._wanted, self._waiting > 0
        try:
            step = 1 if is_awaited else self._step(scene)
            if step > 1:
                self._show(self._draw(scene, step))
                with self._changed:
                    self._changed.wait_for(lambda: self._wanted is not scene or self._waiting > 0, _PAUSE)
                    if self._wanted is not scene:
                        return True
            result: Image | Exception = self._draw(scene, 1)
        except Exception as error:
            result = error
        if isinstance(result, Image):
            self._show(result)
        else:
            self._fail(result)
        with self._changed:
            if scene is self._wanted:
                self._result = result
                self._changed.notify_all()
        return True

    def _step(self, scene: Scene) -> int:
        """The number of pixels of the whole picture, along a side, that share one of the next picture."""
        fluent = math.ceil(math.sqrt(self._seconds / _FLUENT))
        # Pixels that are larger than voxels would need wider kernels, for which all voxels are classified again.
        fine = math.floor(1 / native.pixel(scene._native, self._view.volume._native))
        return max(min(fluent, fine, _MOST), 1)

    def _draw(self, scene: Scene, step: int) -> Image:
        if step > 1:
            size = scene.to_dict()["image"]
            scene = scene.replace(image={key: -(-size[key] // step) for key in ("width", "height")})
        with self._drawing:
            begin = time.perf_counter()
            self._view.scene = scene
            image = self._view.render()
            if step == 1:
                self._seconds = time.perf_counter() - begin
        return image
