"""The widget for notebooks, without a browser: gestures come as the messages that its JavaScript sends."""

import base64
import gc
import subprocess
import sys
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

pytest.importorskip("anywidget", reason="anywidget is not installed")

import sheetsplat
from sheetsplat import painter
from sheetsplat.widget import Widget

SIZE: dict[str, Any] = {"image": {"width": 48, "height": 40}}


def head(**settings: Any) -> Widget:
    return Widget("builtin:head:24", **{**SIZE, **settings})


def send(widget: Widget, **move: Any) -> None:
    """A message of the browser."""
    content = {"home": False, "orbit": [0, 0], "pan": [0, 0], "zoom": 1, **move}
    widget._handle_custom_msg(content, [])


def check_picture(widget: Widget) -> np.ndarray:
    """The picture is that of the scene, byte for byte, in Python, in the browser and in a new process's eyes."""
    image = np.asarray(widget.image)
    np.testing.assert_array_equal(image, np.asarray(sheetsplat.render(widget.volume, scene=widget.scene)))
    text = sheetsplat.Scene(widget.scene.to_toml())
    np.testing.assert_array_equal(image, np.asarray(sheetsplat.render(widget.volume, scene=text)))
    assert widget._png == widget.image._repr_png_() and widget._problem == ""
    assert widget._size == (image.shape[1], image.shape[0])
    return image


def test_the_package_does_not_import_anywidget() -> None:
    code = "import sys, sheetsplat; sys.exit(any(name in sys.modules for name in ('anywidget', 'traitlets', 'ipywidgets')))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
    assert sheetsplat.Widget is Widget and "Widget" in dir(sheetsplat)


def test_without_anywidget_the_error_says_what_to_install() -> None:
    code = "import sys; sys.modules['anywidget'] = None; import sheetsplat; sheetsplat.Widget"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "ImportError: sheetsplat.Widget needs anywidget: pip install 'sheetsplat[jupyter]'" in result.stderr


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"preset": "ct-bone", "camera": {"direction": [0.4, 0.9, -0.2]}},
        {"camera": {"projection": "perspective", "direction": [0, 0, -1], "up": [0, 1, 0]}},
        {"camera": {"direction": [0, 0.001, -1]}},
    ],
)
def test_the_first_picture_is_that_of_a_turntable(settings: dict[str, Any]) -> None:
    widget = head(**settings)
    first = next(sheetsplat.View("builtin:head:24", **SIZE, **settings).orbit(count=4))
    np.testing.assert_array_equal(check_picture(widget), np.asarray(first))
    assert (widget.azimuth, widget.zoom) == (0, 1)


def test_gestures_move_the_camera() -> None:
    widget = head(preset="ct-bone", camera={"direction": [0, 1, -0.5]})
    start, elevation = check_picture(widget), widget.elevation
    assert abs(elevation - np.degrees(np.arctan(0.5))) < 1e-9
    send(widget, orbit=[0.25, 0.1])
    assert abs(widget.azimuth + 45) < 1e-9 and abs(widget.elevation - elevation - 18) < 1e-9
    turned = check_picture(widget)
    assert np.abs(turned - start).max() > 0.1
    # The same direction by hand: right-handed about the z axis.
    direction = widget.scene.to_dict()["camera"]["direction"]
    assert abs(np.degrees(np.arctan2(direction[1], direction[0])) - 45) < 1e-9
    height, center = widget.scene.to_dict()["camera"]["height"], widget.center
    # A quarter of the picture's height, which is ten pixels, to the right.
    send(widget, pan=[0.25, 0])
    np.testing.assert_allclose(check_picture(widget)[:, 10:], turned[:, :-10], atol=1e-4)
    assert abs(np.linalg.norm(np.subtract(widget.center, center)) - height / 4) < 1e-9
    send(widget, zoom=0.5)
    assert widget.zoom == 2 and widget.scene.to_dict()["camera"]["height"] == height / 2
    check_picture(widget)
    send(widget, home=True)
    np.testing.assert_array_equal(check_picture(widget), start)
    assert (widget.azimuth, widget.elevation, widget.zoom) == (0, elevation, 1)


def test_gestures_stop_at_the_limits() -> None:
    widget = head()
    send(widget, orbit=[0, 10], zoom=1e9)
    assert (widget.elevation, widget.zoom) == (89, 0.01)
    check_picture(widget)
    send(widget, orbit=[0, -10], zoom=1e-9)
    assert (widget.elevation, widget.zoom) == (-89, 1000)
    check_picture(widget)


def test_a_camera_steeper_than_the_limit_stays_until_it_is_turned() -> None:
    widget = head(camera={"direction": [0, 0.001, -1]})
    assert 89.9 < widget.elevation < 90
    start = check_picture(widget)
    send(widget, orbit=[0.1, 0])
    widget.azimuth = 0
    np.testing.assert_array_equal(check_picture(widget), start)
    send(widget, orbit=[0, 0.1])
    assert widget.elevation == 89


def test_traits_are_observed_and_set() -> None:
    widget = head()
    start = check_picture(widget)
    seen: list[tuple[str, float]] = []
    widget.observe(lambda change: seen.append((change["name"], change["new"])), ["azimuth", "zoom"])
    send(widget, orbit=[-0.5, 0])
    assert seen == [("azimuth", 90)]
    # A slider's range is not left.
    send(widget, orbit=[-0.6, 0])
    assert seen[1][0] == "azimuth" and abs(seen[1][1] + 162) < 1e-9
    widget.azimuth, widget.zoom = 90, 2
    assert seen[2:] == [("azimuth", 90), ("zoom", 2)]
    picture = check_picture(widget)
    turntable = sheetsplat.View("builtin:head:24", **SIZE)
    turntable.scene = turntable.scene.explicit(turntable.volume, all_around=True).turned(90)
    height = turntable.scene.to_dict()["camera"]["height"]
    other = turntable.render(camera={"height": height / 2})
    assert np.abs(picture - np.asarray(other)).max() < 1e-5 and np.abs(picture - start).max() > 0.1
    for name, value, words in [
        ("azimuth", float("nan"), "azimuth: found nan, allowed: a finite number"),
        ("elevation", 90, "elevation: found 90, allowed: -89 to 89"),
        ("zoom", 0, "zoom: found 0, allowed: 0.01 to 1000"),
        ("center", (0, float("inf"), 0), "center: found inf"),
    ]:
        old = getattr(widget, name)
        with pytest.raises(sheetsplat.SceneError, match=words) as error:
            setattr(widget, name, value)
        assert error.value.key == name and getattr(widget, name) == old
    np.testing.assert_array_equal(check_picture(widget), picture)


def test_settings_keep_the_camera_unless_they_state_it() -> None:
    widget = head(preset="ct-bone")
    send(widget, orbit=[0.1, 0.1], zoom=0.8)
    moved = widget.scene.to_dict()["camera"]
    widget.set(preset="ct-skin", image={"width": 40})
    assert widget.scene.to_dict()["camera"] == moved
    assert check_picture(widget).shape == (40, 40, 4)
    widget.set(**{"camera.direction": [1, 0, 0]})
    assert (widget.azimuth, widget.elevation, widget.zoom) == (0, 0, 1)
    assert widget.scene.to_dict()["camera"]["direction"] == [1, 0, 0]
    check_picture(widget)
    widget.set(camera={"projection": "perspective"})
    assert widget.scene.to_dict()["camera"]["projection"] == "perspective"
    check_picture(widget)
    kept = widget.scene
    send(widget, orbit=[0.1, 0.1], zoom=0.8)
    widget.scene = kept
    assert widget.scene == kept and widget.azimuth == 0
    check_picture(widget)


def test_settings_that_are_not_allowed_change_nothing() -> None:
    values = np.random.default_rng(2).normal(size=(8, 9, 10))
    widget = Widget(values, spacing=(2, 1, 1), **SIZE)
    start, scene = check_picture(widget), widget.scene
    for settings, key in [
        ({"preset": "ct-bones"}, "preset"),
        ({"camera": {"up": [0, 0, 0]}}, "camera.up"),
        # Only the volume can tell, and only the backend.
        ({"preset": "labels"}, "preset"),
        ({"image": {"width": 40000}}, "image.width"),
    ]:
        with pytest.raises(sheetsplat.SceneError) as error:
            widget.set(**settings)
        assert error.value.key == key
        assert widget.scene == scene
    np.testing.assert_array_equal(check_picture(widget), start)
    with pytest.raises(sheetsplat.FileError, match="missing.nrrd"):
        Widget("missing.nrrd")


def test_what_fails_only_while_drawing_is_shown_and_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    widget = head()
    start = check_picture(widget)

    def render(view: sheetsplat.View) -> sheetsplat.Image:
        raise sheetsplat.RenderError("the device is lost")

    with monkeypatch.context() as patch:
        patch.setattr(sheetsplat.View, "render", render)
        send(widget, orbit=[0.1, 0])
        with pytest.raises(sheetsplat.RenderError, match="the device is lost"):
            widget.image
        assert widget._problem == "the device is lost"
        assert "image/png" not in widget._repr_mimebundle_()[0]
    send(widget, orbit=[-0.1, 0])
    np.testing.assert_array_equal(check_picture(widget), start)
    # What is wrong with a message has nobody else to be told, and the browser may go on.
    answers: list[Any] = []
    monkeypatch.setattr(widget, "send", lambda content, buffers=None: answers.append(content))
    send(widget, orbit="left")
    assert widget._problem != "" and answers == [{"kind": "drawn"}]
    send(widget, orbit=[0.1, 0])
    check_picture(widget)


def test_the_still_picture_stands_beside_the_widget() -> None:
    widget = head()
    widget.azimuth = 20
    data, _ = widget._repr_mimebundle_()
    assert data["application/vnd.jupyter.widget-view+json"]["model_id"] == widget.model_id
    assert base64.b64decode(data["image/png"]) == sheetsplat.render(widget.volume, scene=widget.scene)._repr_png_()
    assert data["text/plain"] == repr(widget) and "15×24×24" in repr(widget)


def test_a_closed_widget_is_forgotten() -> None:
    widget = head()
    widget.image
    known, volume = weakref.ref(widget), weakref.ref(widget.volume)
    widget.close()
    del widget
    deadline = time.monotonic() + 60
    # The thread that drew may not have ended yet.
    while known() is not None and time.monotonic() < deadline:
        gc.collect()
    assert known() is None and volume() is None


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_picture_that_nobody_takes_leaves_no_one_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    widget = head()
    start = check_picture(widget)

    def show(image: sheetsplat.Image) -> None:
        raise RuntimeError("the kernel is gone")

    with monkeypatch.context() as patch:
        patch.setattr(widget._painter, "_show", show)
        widget.azimuth = 10
        with pytest.raises(RuntimeError, match="the kernel is gone"):
            widget.image
    widget.azimuth = 0
    np.testing.assert_array_equal(check_picture(widget), start)


class SlowView(sheetsplat.View):
    """A view whose pictures wait until they are let through."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.drawn: list[sheetsplat.Scene] = []
        self.begun, self.gate = threading.Semaphore(0), threading.Semaphore(0)

    def render(self, **settings: Any) -> sheetsplat.Image:
        self.begun.release()
        assert self.gate.acquire(timeout=60)
        self.drawn.append(self.scene)
        return super().render(**settings)


def slow(monkeypatch: pytest.MonkeyPatch) -> tuple[Widget, SlowView]:
    monkeypatch.setattr("sheetsplat.widget.View", SlowView)
    # Four pixels to a voxel.
    widget = head(image={"width": 192, "height": 160})
    view = widget._painter._view
    assert isinstance(view, SlowView) and view.begun.acquire(timeout=60)
    return widget, view


def test_only_the_newest_of_many_changes_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    # No picture takes too long.
    monkeypatch.setattr(painter, "_FLUENT", 1e9)
    widget, view = slow(monkeypatch)
    answers: list[Any] = []
    monkeypatch.setattr(widget, "send", lambda content, buffers=None: answers.append(content))
    for _ in range(50):
        send(widget, orbit=[0.01, 0])
    # All are taken while the first picture is still drawn, and none is answered before a picture.
    assert answers == [] and view.drawn == [] and widget._png == b""
    view.gate.release(2)
    check_picture(widget)
    assert len(view.drawn) == 2 and answers == [{"kind": "drawn"}]
    assert abs(widget.azimuth + 90) < 1e-9
    assert view.drawn[1].to_dict()["camera"] == widget.scene.to_dict()["camera"]


def wait_for(pictures: list[int], count: int) -> None:
    deadline = time.monotonic() + 60
    while len(pictures) < count and time.monotonic() < deadline:
        time.sleep(0.01)
    assert len(pictures) == count


def test_while_the_picture_changes_it_is_rough_if_whole_ones_take_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(painter, "_FLUENT", 0.02)
    monkeypatch.setattr(painter, "_PAUSE", 0.05)
    widget, view = slow(monkeypatch)
    widths: list[int] = []
    widget.observe(lambda change: widths.append(int.from_bytes(change["new"][16:20], "big")), "_png")
    # The first picture takes more than six times as long as is fluent, so that a rough one has a ninth of the pixels or fewer.
    time.sleep(0.13)
    view.gate.release(3)
    send(widget, orbit=[0.1, 0])
    wait_for(widths, 3)
    assert widths in ([192, 64, 192], [192, 48, 192])
    assert [scene.to_dict()["image"]["width"] for scene in view.drawn] == widths
    assert np.asarray(widget.image).shape == (160, 192, 4)


def test_rough_pictures_do_not_minify_the_volume(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(painter, "_FLUENT", 1e-9)
    monkeypatch.setattr(painter, "_PAUSE", 0.05)
    widget, view = slow(monkeypatch)
    widths: list[int] = []
    widget.observe(lambda change: widths.append(int.from_bytes(change["new"][16:20], "big")), "_png")
    view.gate.release(1)
    wait_for(widths, 1)
    view.gate.release(4)
    # Pixels are half as large as voxels, and larger ones would not be; then as large as voxels.
    for zoom, expected in [(0.4, [96, 192]), (0.25, [192])]:
        del widths[:]
        widget.zoom = zoom
        wait_for(widths, len(expected))
        assert widths == expected


def test_who_waits_for_the_whole_picture_gets_it_without_a_rough_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    # Every whole picture takes too long.
    monkeypatch.setattr(painter, "_FLUENT", 1e-9)
    widget, view = slow(monkeypatch)
    with ThreadPoolExecutor(1) as pool:
        picture = pool.submit(lambda: widget.image)
        deadline = time.monotonic() + 60
        while widget._painter._waiting == 0 and time.monotonic() < deadline:
            time.sleep(0.01)
        send(widget, orbit=[0.1, 0])
        view.gate.release(2)
        assert picture.result(timeout=60).width == 192
    assert [scene.to_dict()["image"]["width"] for scene in view.drawn] == [192, 192]
    assert view.drawn[1].to_dict()["camera"] == widget.scene.to_dict()["camera"]


def test_a_process_that_draws_ends_cleanly() -> None:
    code = "import sheetsplat; sheetsplat.Widget('builtin:head:64', image={'width': 200, 'height': 200})"
    result = subprocess.run([sys.executable, "-X", "faulthandler", "-c", code], capture_output=True, text=True, timeout=300)
    assert (result.returncode, result.stderr) == (0, "")


def test_words() -> None:
    """The camera that the words place is the home of the widget, which `set` keeps unless a word of the camera is said."""
    words = {"view": "xz", "azimuth": 20, "zoom": 1.5, "cmap": "hot_r", "size": (24, 20)}
    widget = Widget("builtin:head:16", **words)
    view = sheetsplat.View("builtin:head:16", **words)
    assert widget.image == next(view.orbit(count=1))
    np.testing.assert_allclose(widget.scene.to_dict()["camera"]["direction"], view.scene.to_dict()["camera"]["direction"])
    widget.azimuth = 30
    widget.set(cmap="gray")
    assert widget.azimuth == 30 and "colormap" in widget.scene.to_dict()["transfer"]
    widget.set(azimuth=40)
    assert widget.azimuth == 0
    turned = sheetsplat.View("builtin:head:16", **{**words, "azimuth": 40, "cmap": "gray"})
    assert widget.image == next(turned.orbit(count=1))
    with pytest.raises(sheetsplat.SceneError, match=r"zom: found an unknown keyword \(perhaps zoom\)"):
        widget.set(zom=2)
