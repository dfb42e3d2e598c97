"""Pictures that tell how they were made, and that are drawn again."""

import os
from pathlib import Path

import numpy as np
import pytest

import sheetsplat
from sheetsplat import Image, Scene, Volume, verify

SIZE = {"width": 24, "height": 20}


def values() -> np.ndarray:
    z, y, x = np.ogrid[0:7, 0:6, 0:5]
    return ((x * 3 + y * 5 + z * z) % 11).astype(np.float32)


def write(path: Path, array: np.ndarray) -> None:
    np.save(path, array)


def test_pictures_of_files_are_the_same(tmp_path: Path) -> None:
    write(tmp_path / "a.npy", values())
    write(tmp_path / "times.npy", np.stack([values(), 10 - values()]))
    labels = np.zeros((7, 6, 5), np.uint8)
    labels[2:4] = 1
    sources = {
        "a.png": (tmp_path / "a.npy", {}),
        "spaced.exr": (Volume(tmp_path / "a.npy", spacing=(2, 1, 1.5)), {}),
        "channel.png": (Volume(tmp_path / "times.npy", channel=1), {}),
        "both.png": (Volume(tmp_path / "times.npy"), {}),
        "words.png": (tmp_path / "a.npy", {"annotate": "scale,colors", "image": {"width": 200, "height": 150}}),
        "builtin.png": ("builtin:head:16", {"azimuth": 30, "zoom": 1.3}),
        "scene.png": (Scene(volume={"path": str(tmp_path / "a.npy")}), {}),
    }
    for name, (source, arguments) in sources.items():
        sheetsplat.render(source, **{"image": SIZE, **arguments}).save(tmp_path / name)
        found = verify(tmp_path / name)
        assert found and found.backend == "cpu" and found.version == sheetsplat.__version__, str(found)
    unculled = {"opacity_threshold": 1.0, "culling": False}
    image = sheetsplat.render(tmp_path / "a.npy", image=SIZE, splatting=unculled)
    image.save(tmp_path / "deep.png", depth=16)
    found = verify(tmp_path / "deep.png", oracle=30)
    assert found and 0 < found.deviation < 0.01
    # One voxel.
    changed = values()
    changed[3, 3, 3] += 1
    write(tmp_path / "a.npy", changed)
    found = verify(tmp_path / "a.png")
    assert not found and "the file a.npy was changed" in found.reasons
    # A file that is gone before the picture is saved.
    image = sheetsplat.render(tmp_path / "times.npy", image=SIZE)
    os.remove(tmp_path / "times.npy")
    image.save(tmp_path / "gone.png")
    with pytest.raises(sheetsplat.ImageError, match="no file times.npy"):
        verify(tmp_path / "gone.png")
    # Labels of an array lie in no file.
    sheetsplat.render(tmp_path / "a.npy", labels=labels, image=SIZE).save(tmp_path / "labels.png")
    with pytest.raises(sheetsplat.ImageError, match="its volume came from memory"):
        verify(tmp_path / "labels.png")
    assert verify(tmp_path / "labels.png", Volume(tmp_path / "a.npy", labels=labels))


def test_volumes_from_memory_are_told_by_their_values(tmp_path: Path) -> None:
    volume = Volume(values())
    sheetsplat.render(volume, image=SIZE).save(tmp_path / "a.png")
    with pytest.raises(sheetsplat.ImageError, match="a.png: cannot be verified: its volume came from memory"):
        verify(tmp_path / "a.png")
    assert verify(tmp_path / "a.png", volume) and verify(tmp_path / "a.png", values())
    changed = values()
    changed[0, 0, 0] += 1
    assert "the values of channel 0 were changed" in verify(tmp_path / "a.png", changed).reasons
    # Where the volume is gone, the pixels alone tell.
    image = sheetsplat.render(values(), image=SIZE)
    image.save(tmp_path / "gone.png")
    assert verify(tmp_path / "gone.png", values())
    assert any("pixels differ" in reason for reason in verify(tmp_path / "gone.png", values()[::-1]).reasons)


def test_a_picture_gives_its_scene(tmp_path: Path) -> None:
    data, figures = tmp_path / "data", tmp_path / "figures"
    data.mkdir()
    figures.mkdir()
    write(data / "a.npy", values())
    image = sheetsplat.render(data / "a.npy", image=SIZE, preset="ct-bone", azimuth=20)
    path = figures / "a.png"
    image.save(path)
    assert str(tmp_path).encode() not in path.read_bytes()
    with pytest.raises(sheetsplat.SceneError, match="no file a.npy"):
        Scene.from_picture(path)
    with pytest.raises(sheetsplat.ImageError, match="no file a.npy"):
        verify(path)
    assert verify(path, search=data) and verify(path, search=[os.fspath(figures), data])
    scene = Scene.from_picture(path, search=data)
    assert sheetsplat.render(scene) == image
    assert sheetsplat.render(scene, image={"width": 30}).width == 30
    again = sheetsplat.render(scene.replace(camera={"direction": [1, 0, 0]}))
    again.save(figures / "again.png")
    assert verify(figures / "again.png", search=data)
    image.save(figures / "bare.png", metadata=False)
    assert Image.open(figures / "bare.png") == Image.open(path)
    for read in (Scene.from_picture, verify):
        with pytest.raises(sheetsplat.ImageError, match="no scene"):
            read(figures / "bare.png")
        with pytest.raises(sheetsplat.FileError):
            read(figures / "missing.png")
    image.save(figures / "a.npy")
    with pytest.raises(sheetsplat.ImageError, match="NPY files have no room"):
        verify(figures / "a.npy")
    with pytest.raises(sheetsplat.SceneError, match="search: found 3, allowed: folders"):
        verify(path, search=3)


def test_views_tell_the_scene_of_each_picture(tmp_path: Path) -> None:
    write(tmp_path / "a.npy", values())
    view = sheetsplat.View(tmp_path / "a.npy", image=SIZE)
    pictures = [view.render()]
    view.set(camera={"direction": [1, 0, 0]})
    pictures.append(view.render(background="white"))
    del view
    for number, picture in enumerate(pictures):
        picture.save(tmp_path / f"{number}.png")
        assert verify(tmp_path / f"{number}.png")
    assert Scene.from_picture(tmp_path / "0.png") != Scene.from_picture(tmp_path / "1.png")
