"""Scenes, views, turntables and sweeps."""

import pathlib

import numpy as np
import pytest

import sheetsplat
from sheetsplat import Scene

SMALL = {"width": 32, "height": 32}
HEAD = "builtin:head:24"
TEXT = """
[volume]
builtin = "head:24"
[image]
width = 32
height = 32
[camera]
direction = [1, 0, 0]
"""


def data(image: sheetsplat.Image) -> bytes:
    return np.asarray(image).tobytes()


def test_one_vocabulary(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(TEXT)
    table = {"volume": {"builtin": "head:24"}, "image": SMALL, "camera": {"direction": np.array([1, 0, 0])}}
    flat = {"volume.builtin": "head:24", "image.width": 32, "image.height": np.int16(32), "camera.direction": (1, 0, 0)}
    expected = data(sheetsplat.render(path))
    for scene in (Scene(path), Scene(str(path)), Scene(TEXT)):
        assert data(sheetsplat.render(scene)) == expected
    # A scene file without [transfer] or [camera] fits the object; these have no file.
    fitted = [Scene(table, camera={"fit": "volume"}), Scene(**table, **{"camera.fit": "volume"}), Scene(flat, camera={"fit": "volume"})]
    for scene in fitted:
        assert data(sheetsplat.render(scene)) == expected


def test_the_last_value_of_a_setting_counts() -> None:
    scene = sheetsplat.Scene(preset="mip", camera={"up": [1, 0, 0], "direction": [0, 0, 1]})
    for number in range(200):
        scene = scene.replace(**{"camera.up": [1, 0, number]})
        scene = scene.replace(camera={"direction": [0, 1 + number, 0]}, preset="ct-skin" if number % 2 else "ct-bone")
    assert scene == sheetsplat.Scene(preset="ct-skin", camera={"up": [1, 0, 199], "direction": [0, 200, 0]})


def test_scenes_come_back(tmp_path: pathlib.Path) -> None:
    scene = Scene(TEXT, splatting={"compositing": "exponential"}, preset="mr-head")
    assert Scene(scene.to_toml()) == scene
    assert scene.to_dict()["splatting"]["compositing"] == "exponential"
    scene.save(tmp_path / "s.toml")
    assert Scene(tmp_path / "s.toml") == scene
    assert scene.replace(preset="mip") != scene
    explicit = scene.explicit(scene.load_volume())
    assert explicit.to_dict()["transfer"]["opacity"]
    assert data(sheetsplat.render(explicit)) == data(sheetsplat.render(scene))


@pytest.mark.parametrize(
    ("settings", "key", "found"),
    [
        ({"camera": {"up": "north"}}, "camera.up", "north"),
        ({"camera": {"upp": [0, 0, 1]}}, "camera.upp", ""),
        ({"kamera": {"up": [0, 0, 1]}}, "kamera", ""),
        ({"camera.up": [0, 0]}, "camera.up", ""),
        ({"camera": {"up": [0, 0, None]}}, "camera.up[2]", "None"),
        ({"camera": 5}, "camera", "5"),
        ({"image": {"width": 0}}, "image.width", "0"),
        ({"image": {"width": 2**70}}, "image.width", str(2**70)),
        ({"splatting": {"slab_width": float("nan")}}, "splatting.slab_width", "nan"),
        ({"splatting": {"culling": 1}}, "splatting.culling", "1"),
        ({"preset": "nonsense"}, "preset", "nonsense"),
        ({"shading": {"light": object()}}, "shading.light", "object"),
        ({"transfer": {"opacity": [[0, 0], [1, 2]]}}, "transfer.opacity[1][1]", "2"),
        ({"camera": {1: 2}}, "settings", "1"),
    ],
)
def test_errors_name_the_key(settings: dict[str, object], key: str, found: str) -> None:
    with pytest.raises(sheetsplat.SceneError) as caught:
        Scene(**settings)
    error = caught.value
    assert error.key == key and error.allowed and found in str(error.found) and str(error).startswith(f"{key}: found")
    assert isinstance(error, ValueError)


def test_errors_of_files(tmp_path: pathlib.Path) -> None:
    with pytest.raises(sheetsplat.FileError) as caught:
        Scene(tmp_path / "none.toml")
    assert caught.value.filename == str(tmp_path / "none.toml") and caught.value.errno == 2
    with pytest.raises(sheetsplat.FileError) as caught:
        sheetsplat.Volume(tmp_path / "none.nrrd")
    assert isinstance(caught.value, FileNotFoundError | OSError) and caught.value.errno == 2
    (tmp_path / "bad.toml").write_text("[camera\n")
    with pytest.raises(sheetsplat.SceneError, match=r"bad\.toml"):
        Scene(tmp_path / "bad.toml")
    (tmp_path / "bad.toml").write_text("camera.up = 'x'\n")
    with pytest.raises(sheetsplat.SceneError, match=r"bad\.toml: camera\.up: found"):
        Scene(tmp_path / "bad.toml")
    (tmp_path / "bad.nrrd").write_bytes(b"NRRD0004\n")
    with pytest.raises(sheetsplat.VolumeError, match=r"bad\.nrrd"):
        sheetsplat.render(tmp_path / "bad.nrrd")
    with pytest.raises(sheetsplat.SceneError, match="backend"):
        sheetsplat.render(HEAD, backend="fast")
    with pytest.raises(sheetsplat.VolumeError, match="builtin:nobody"):
        sheetsplat.render("builtin:nobody")
    with pytest.raises(sheetsplat.VolumeError, match="volume in memory"):
        Scene().load_volume()
    with pytest.raises(sheetsplat.SceneError, match="volume: found"):
        sheetsplat.render(HEAD, volume={"builtin": "tomato"})


def test_volume_files(tmp_path: pathlib.Path) -> None:
    values = sheetsplat.Volume(HEAD).values
    np.save(tmp_path / "head.npy", values)
    assert sheetsplat.info(tmp_path / "head.npy")["format"] == "NPY"
    look = {"image": SMALL, "spacing": (2, 1, 1)}
    assert data(sheetsplat.render(tmp_path / "head.npy", **look)) == data(sheetsplat.render(values, **look))


def test_a_scene_for_another_volume() -> None:
    """The volume that a scene names is ignored where a volume is given."""
    cube = sheetsplat.render("builtin:cube:12", scene=TEXT)
    named = Scene(TEXT).replace(**{"volume.builtin": "cube:12"})
    assert data(cube) == data(sheetsplat.render(named))


def test_views_redo_what_changed() -> None:
    view = sheetsplat.View(HEAD, image=SMALL)
    for settings in (
        {"camera": {"direction": [1, 0, 0]}},
        {"shading": {"light": [0, 0, 1]}},
        {"transfer": {"opacity": [[0, 0], [255, 0.3]]}},
        {"image": {"width": 20}},
    ):
        before = view.render()
        changed = view.render(**settings)
        assert np.asarray(changed).shape != np.asarray(before).shape or data(changed) != data(before)
        assert data(changed) == data(sheetsplat.render(view.volume, scene=view.scene)), settings
        assert changed.stats["prepare_ms"] > 0 and view.render().stats["prepare_ms"] == 0, settings
    scene = view.scene
    with pytest.raises(sheetsplat.SceneError, match="camera.up"):
        view.set(camera={"up": [0, 0, 0]})
    assert view.scene == scene and data(view.render()) == data(changed)


def test_orbits(tmp_path: pathlib.Path) -> None:
    pictures = list(sheetsplat.orbit(HEAD, count=4, image=SMALL) or [])
    assert len({data(picture) for picture in pictures}) == 4
    part = list(sheetsplat.orbit(HEAD, count=4, frames=range(2, 4), image=SMALL) or [])
    assert [data(picture) for picture in part] == [data(picture) for picture in pictures[2:]]
    sheetsplat.orbit(HEAD, tmp_path / "f-##.npy", count=3, turn=270, image=SMALL)
    sheetsplat.orbit(HEAD, tmp_path / "g%d.npy", count=3, turn=270, image=SMALL, progress=False)
    for frame in range(3):
        saved = np.load(tmp_path / f"f-{frame:02}.npy")
        np.testing.assert_array_equal(saved, np.asarray(pictures[frame]))
        np.testing.assert_array_equal(saved, np.load(tmp_path / f"g{frame}.npy"))
    for output in ("a.png", "a%s.png", "a#b#.png", "a%d%d.png", "a%d.bmp"):
        with pytest.raises(sheetsplat.ImageError, match="found"):
            sheetsplat.orbit(HEAD, tmp_path / output, count=3, image=SMALL)
    with pytest.raises(sheetsplat.SceneError, match="frames: found range"):
        sheetsplat.orbit(HEAD, count=3, frames=range(2, 5))
    with pytest.raises(sheetsplat.SceneError, match="count: found 0"):
        sheetsplat.orbit(HEAD, count=0)


def test_movies(tmp_path: pathlib.Path) -> None:
    pil = pytest.importorskip("PIL.Image")
    for name in ("turn.gif", "turn.apng"):
        sheetsplat.orbit(HEAD, tmp_path / name, count=3, image=SMALL)
        with pil.open(tmp_path / name) as movie:
            assert movie.n_frames == 3 and movie.size == (32, 32)


def test_ctrl_c_stops_between_pictures(tmp_path: pathlib.Path) -> None:
    """An interrupt is raised after the picture that is being drawn; complete files stay."""
    import os
    import signal
    import subprocess
    import sys
    import time

    code = f"import sheetsplat; sheetsplat.orbit({HEAD!r}, {str(tmp_path / '%05d.png')!r}, count=100000, image={SMALL!r})"

    def heed_interrupts() -> None:
        # A caller that runs these tests in the background may ignore interrupts, and its processes would, too.
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    command = [sys.executable, "-c", code]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heed_interrupts)
    end = time.monotonic() + 60
    while len(os.listdir(tmp_path)) < 3 and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode != 0 and "KeyboardInterrupt" in errors, errors
    names = sorted(os.listdir(tmp_path))
    assert 3 <= len(names) < 100000 and all(name.endswith(".png") for name in names), names[:5]
    assert sheetsplat.Image.open(tmp_path / names[-1]).width == 32


def test_sweeps() -> None:
    keys = {"splatting.slab_width": [0.5, 2], "shading": [{"enabled": False}, {"enabled": True}]}
    found = list(sheetsplat.sweep(HEAD, keys, image=SMALL))
    assert [settings["splatting.slab_width"] for settings, _ in found] == [0.5, 0.5, 2, 2]
    assert len({data(image) for _, image in found}) == 4
    with pytest.raises(sheetsplat.SceneError, match="slab_width"):
        sheetsplat.sweep(HEAD, {"splatting.slab_width": [1, -1]})


def test_info() -> None:
    facts = sheetsplat.info(np.arange(24.0).reshape(2, 3, 4), spacing=(3, 2, 1))
    assert facts["shape"] == [2, 3, 4] and facts["spacing"] == [3, 2, 1]
    assert (facts["min"], facts["max"], facts["mean"]) == (0, 23, 11.5)
    assert facts["percentiles"]["50"] in (11, 12)


class Itk:
    """As much of an image of SimpleITK as is read."""

    def GetSpacing(self) -> tuple[float, ...]:
        return (1.0, 2.0, 3.0)

    def GetOrigin(self) -> tuple[float, ...]:
        return (10.0, 20.0, 30.0)

    def GetDirection(self) -> tuple[float, ...]:
        return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class Nifti:
    """As much of an image of nibabel as is read."""

    affine = np.array([[-1.0, 0, 0, -10], [0, -2.0, 0, -20], [0, 0, 3.0, 30], [0, 0, 0, 1]])
    dataobj = sheetsplat.Volume(HEAD).values.T


def test_images_of_other_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both images lie in the patient in the same way: x to the left, y to the back, z to the head."""
    import sys
    import types

    module = types.ModuleType("SimpleITK")
    module.GetArrayViewFromImage = lambda image: Nifti.dataobj.T  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "SimpleITK", module)
    volumes = [sheetsplat.Volume(Itk()), sheetsplat.Volume(Nifti())]
    for volume in volumes:
        assert volume.spacing == (3, 2, 1)
        assert volume.info()["axes"] == [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]
    pictures = {data(sheetsplat.render(volume, side="front", image=SMALL)) for volume in volumes}
    assert len(pictures) == 1
    assert pictures != {data(sheetsplat.render(volumes[0], side="left", image=SMALL))}
    assert sheetsplat.Volume(Nifti(), spacing=5).spacing == (5, 5, 5)
    with pytest.raises(sheetsplat.SceneError, match="side: found 'inside'|side: found \"inside\""):
        sheetsplat.render(volumes[0], side="inside")
    with pytest.raises(sheetsplat.SceneError, match="side: found a volume without orientation"):
        sheetsplat.render(HEAD, side="front")
