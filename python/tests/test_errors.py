"""Every error is an exception of this package, whatever an argument is, and nothing is left half-written."""

import os
import pathlib
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import sheetsplat
from sheetsplat import DeviceError, FileError, GoldenError, ImageError, Scene, SceneError, View, Volume, VolumeError, errors

SMALL = {"width": 16, "height": 16}
HEAD = "builtin:head:16"
PICTURE = np.zeros((4, 4, 3), np.uint8)


def test_every_exception_is_a_value_error_or_an_os_error() -> None:
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, errors.SheetsplatError)]
    assert {kind.__name__ for kind in kinds} - {"_Refused"} == set(errors.__all__) - {"SheetsplatWarning"}
    for kind in kinds:
        if kind is not errors.SheetsplatError:
            assert issubclass(kind, ValueError) != issubclass(kind, OSError), kind
        if kind.__name__ in errors.__all__:
            assert getattr(sheetsplat, kind.__name__) is kind


def test_errors_are_pickled() -> None:
    with pytest.raises(SceneError) as caught:
        Scene(camera={"up": "north"})
    sent = pickle.loads(pickle.dumps(caught.value))
    assert (sent.key, sent.found, sent.allowed) == (caught.value.key, caught.value.found, caught.value.allowed)
    assert str(sent) == str(caught.value)


@pytest.mark.parametrize("per_channel", [300, -1, 17, 2**70, 1.5, "much"])
def test_tolerances_are_checked(per_channel: Any, golden: Any) -> None:
    for call in (lambda: sheetsplat.compare(PICTURE, PICTURE, per_channel=per_channel), lambda: golden(PICTURE, "a", per_channel=per_channel)):
        with pytest.raises(GoldenError, match="tolerance per channel: found .*, allowed: .*0 to 16"):
            call()


@pytest.mark.parametrize("outliers", [0.02, -0.1, float("nan"), float("inf"), "few"])
def test_fractions_of_outliers_are_checked(outliers: Any, golden: Any) -> None:
    for call in (lambda: sheetsplat.compare(PICTURE, PICTURE, outliers=outliers), lambda: golden(PICTURE, "a", outliers=outliers)):
        with pytest.raises(GoldenError, match="share of outliers: found"):
            call()


def test_depths_are_checked(tmp_path: pathlib.Path) -> None:
    for depth in (-1, 7, 300, 2**70, "8", None):
        with pytest.raises(SceneError, match="depth: found .*, allowed: 8 or 16 bits") as caught:
            sheetsplat.Image(PICTURE).save(tmp_path / "a.png", depth=depth)
        assert caught.value.key == "depth"
    assert not os.listdir(tmp_path)


def test_numbers_of_parts_are_checked() -> None:
    view = View(HEAD, image=SMALL)
    for slabs in ((-(2**31) - 1, 0), (0, 2**31), (0, 1.5), (0,), 7, "ab"):
        with pytest.raises(SceneError, match="slabs: found") as caught:
            view.part(slabs=slabs)
        assert caught.value.key == "slabs"
    for region in ((-1, 0, 4, 4), (0, 0, 2**32, 4), (0, 0, 4), (0, 0, 4, 4, 4), (0, 0, 4, 0.5)):
        with pytest.raises(SceneError, match="region: found"):
            view.part(region=region)
    for count in (0, -1, 2**31, 2**70, 1.5, "all"):
        with pytest.raises(SceneError, match="count: found .*, allowed: a whole number from 1 to 2147483647"):
            view.split(count)


def test_turntables_are_checked_before_they_are_drawn(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PIL.Image")

    def drawn(view: View) -> None:
        raise AssertionError("a picture was drawn")

    monkeypatch.setattr(View, "render", drawn)
    gif = tmp_path / "a.gif"
    for key, arguments in [
        ("fps", {"fps": 0}),
        ("fps", {"fps": -1}),
        ("fps", {"fps": float("nan")}),
        ("fps", {"fps": "fast"}),
        ("fps", {"fps": 10**400}),
        ("count", {"count": 0}),
        ("count", {"count": 2.5}),
        ("frames", {"frames": range(0)}),
        ("frames", {"frames": range(3, 5)}),
        ("frames", {"frames": [0]}),
        ("turn", {"turn": float("inf")}),
        ("turn", {"turn": "all"}),
    ]:
        with pytest.raises(SceneError, match=f"{key}: found") as caught:
            sheetsplat.orbit(HEAD, gif, **{"count": 4, "image": SMALL, **arguments})
        assert caught.value.key == key
    with pytest.raises(ImageError, match="output: found") as refused:
        sheetsplat.orbit(HEAD, tmp_path / "a.mp4")
    assert refused.value.key == "output"
    assert not os.listdir(tmp_path)
    # No picture is drawn where none is asked for, and none is needed.
    assert list(sheetsplat.orbit(HEAD, count=4, frames=range(0), image=SMALL) or []) == []


def test_scenes_beside_scenes_are_refused(tmp_path: pathlib.Path) -> None:
    scene = Scene(volume={"builtin": "head:16"}, image=SMALL)
    scene.save(tmp_path / "s.toml")
    for source in (scene, tmp_path / "s.toml"):
        with pytest.raises(SceneError, match="scene: found a scene beside a source that is one") as caught:
            sheetsplat.render(source, scene=scene)
        assert caught.value.key == "scene"
    with pytest.raises(SceneError, match="scene: found int"):
        Scene(5)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="turn: found nan"):
        scene.turned(float("nan"))


def test_files_are_written_whole_or_not_at_all(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pil = pytest.importorskip("PIL.Image")
    scene, missing = Scene(image=SMALL), tmp_path / "missing"
    for save in (
        lambda: scene.save(missing / "a.toml"),
        lambda: sheetsplat.orbit(HEAD, missing / "a.gif", count=2, image=SMALL),
        lambda: sheetsplat.orbit(HEAD, missing / "%d.png", count=2, image=SMALL),
    ):
        with pytest.raises(FileError) as caught:
            save()
        assert caught.value.errno == 2 and str(missing) in str(caught.value.filename)
        assert isinstance(caught.value, OSError)
    with pytest.raises(FileError) as caught:
        scene.save(tmp_path)
    assert caught.value.errno is None or caught.value.errno == 21

    def broken(*arguments: Any, **keywords: Any) -> None:
        arguments[1].write(b"half")
        raise ValueError("no more")

    old = tmp_path / "old.gif"
    old.write_bytes(b"old")
    with monkeypatch.context() as patch:
        patch.setattr(pil.Image, "save", broken)
        with pytest.raises(ImageError, match=r"old\.gif: no more"):
            sheetsplat.orbit(HEAD, old, count=2, image=SMALL)
    # Neither a movie that could not be written nor a temporary file.
    assert os.listdir(tmp_path) == ["old.gif"] and old.read_bytes() == b"old"
    scene.save(tmp_path / "a.toml")
    link = tmp_path / "link.toml"
    link.symlink_to("a.toml")
    scene.replace(preset="mip").save(link)
    assert link.is_symlink() and Scene(tmp_path / "a.toml").to_dict()["preset"] == "mip"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_folders_that_may_not_be_written(tmp_path: pathlib.Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(FileError) as caught:
        Scene(image=SMALL).save(tmp_path / "a.toml")
    assert caught.value.errno == 13


def test_a_device_error_of_a_real_render() -> None:
    with pytest.raises(DeviceError, match="nobody's adapter") as caught:
        sheetsplat.render(HEAD, backend="gpu", adapter="nobody's adapter", image=SMALL)
    assert isinstance(caught.value, OSError) and isinstance(caught.value, sheetsplat.SheetsplatError)


def test_settings_are_not_assigned() -> None:
    """An attribute that a class lacks would change nothing, silently."""
    view = View(HEAD, image=SMALL)
    view.scene = view.scene.replace(preset="mip")
    part = view.part()
    for thing in (view, view.scene, view.volume, view.render(), part):
        for name in ("camera", "x", "preset"):
            with pytest.raises(AttributeError, match=name):
                setattr(thing, name, 1)
    with pytest.raises(AttributeError):
        view.volume = view.volume  # type: ignore[misc]


def test_errors_keep_the_order_of_the_axes() -> None:
    """z, y, x, as in the array; files have them the other way round."""
    values = np.zeros((2, 3, 4))
    with pytest.raises(VolumeError, match=r"sizes: found labels of 2×3×5 voxels, allowed: 2×3×4, as the values along z, y and x"):
        Volume(values, labels=np.zeros((2, 3, 5), int))
    for make in (lambda spacing: Volume(values, spacing=spacing), lambda spacing: Volume(Volume(values), spacing=spacing)):
        with pytest.raises(VolumeError, match=r"spacing\[0\]: found -1") as caught:
            make((-1, 2, 3))
        assert caught.value.key == "spacing[0]"
        with pytest.raises(VolumeError, match=r"spacing: found \[100000, 2, 1\]"):
            make((100000, 2, 1))


@pytest.mark.skipif(sys.platform != "linux", reason="limits the memory of a process")
def test_a_forked_process_without_threads_raises_an_error() -> None:
    code = """
import os, resource
import sheetsplat

def size():
    return int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()

pid = os.fork()
if pid == 0:
    # Too little for the stack of one more thread.
    resource.setrlimit(resource.RLIMIT_AS, (size() + (1 << 20), resource.RLIM_INFINITY))
    try:
        sheetsplat.Volume("builtin:cube:4")
    except sheetsplat.DeviceError as error:
        os._exit(0 if "threads: found" in str(error) else 1)
    except BaseException:
        os._exit(2)
    os._exit(3)
assert os.waitpid(pid, 0)[1] == 0
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
