"""Nothing that was read for a picture is written over, whatever name leads to it."""

import os
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from test_streaming import LOOK as STREAMED
from test_streaming import MEMORY, ball, write_index

import sheetsplat
from sheetsplat import Image, Part, Scene, View, Volume, VolumeError

VALUES = np.arange(60, dtype="<f4").reshape(3, 4, 5)
__all__ = ["ball"]

LOOK: dict[str, Any] = {"image": {"width": 16, "height": 16}}


def state(folder: pathlib.Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def refused(folder: pathlib.Path, output: pathlib.Path, write: Callable[[], Any]) -> None:
    """Checks that writing a file is refused by its name, and that nothing changes."""
    before = state(folder)
    with pytest.raises(VolumeError, match="would replace, allowed: another file to write") as caught:
        write()
    assert str(output) in str(caught.value) and caught.value.key == "file"
    assert state(folder) == before


def detached_header(folder: pathlib.Path, data: str) -> pathlib.Path:
    (folder / data).write_bytes(VALUES.tobytes())
    path = folder / "a.nhdr"
    path.write_text(f"NRRD0005\ntype: float\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\ndata file: {data}\n")
    return path


@pytest.mark.parametrize("kind", ["itself", "other spelling", "hard link", "symbolic link"])
def test_pictures_parts_and_turntables(kind: str, tmp_path: pathlib.Path) -> None:
    np.save(tmp_path / "a.npy", VALUES)
    npz, exr = tmp_path / "part.npz", tmp_path / "data.exr"
    output = tmp_path / "a.npy"
    header = detached_header(tmp_path, "data.exr")
    if kind == "other spelling":
        (tmp_path / "sub").mkdir()
        output, exr = (tmp_path / "sub" / ".." / path.name for path in (output, exr))
    elif kind.endswith("link"):
        link = os.link if kind == "hard link" else os.symlink
        link(output, tmp_path / "b.npy")
        link(exr, tmp_path / "b.exr")
        output, exr = tmp_path / "b.npy", tmp_path / "b.exr"
    view = View(tmp_path / "a.npy", **LOOK)
    picture = view.render()
    refused(tmp_path, output, lambda: picture.save(output))
    refused(tmp_path, output, lambda: Image(picture).save(output))
    refused(tmp_path, output, lambda: View(Volume(tmp_path / "a.npy"), **LOOK).render().save(output))
    # The data that a header names.
    of_header = View(header, **LOOK, splatting={"opacity_threshold": 1})
    refused(tmp_path, exr, lambda: of_header.render().save(exr))
    parts = [of_header.part(**piece) for piece in of_header.split(2)]
    refused(tmp_path, exr, lambda: parts[0].save(exr))
    refused(tmp_path, exr, lambda: sheetsplat.merge(parts).save(exr))
    refused(tmp_path, exr, lambda: Part.join(reversed(parts[:1])).save(exr))
    # Other files are written.
    picture.save(tmp_path / "other.npy")
    parts[0].save(npz)
    assert npz.exists() and (tmp_path / "other.npy").exists()


def test_turntables_are_refused_before_they_are_drawn(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PIL.Image")
    gif, frame = detached_header(tmp_path, "data.gif"), tmp_path / "frame-1.npy"
    np.save(frame, VALUES)

    def drawn(view: View) -> None:
        raise AssertionError("a picture was drawn")

    monkeypatch.setattr(View, "render", drawn)
    movie = tmp_path / "data.gif"
    refused(tmp_path, movie, lambda: sheetsplat.orbit(gif, movie, count=2, **LOOK))
    refused(tmp_path, frame, lambda: sheetsplat.orbit(frame, tmp_path / "frame-%d.npy", count=3, **LOOK))


def test_folders_of_stores(tmp_path: pathlib.Path) -> None:
    zarr = pytest.importorskip("zarr", reason="zarr is not installed")
    store = tmp_path / "a.zarr"
    stored = zarr.open_array(str(store), mode="w", shape=VALUES.shape, chunks=(2, 2, 2), dtype="f4")
    stored[...] = VALUES
    picture = View(store, **LOOK).render()
    for inside in (store / "new.png", store / "c" / "0.exr"):
        inside.parent.mkdir(exist_ok=True)
        refused(tmp_path, inside, lambda: picture.save(inside))  # noqa: B023
    chunk = next(path for path in store.rglob("*") if path.is_file() and path.suffix == "")
    os.symlink(chunk, tmp_path / "link.npy")
    os.link(chunk, tmp_path / "hard.npy")
    for output in (tmp_path / "link.npy", tmp_path / "hard.npy"):
        refused(tmp_path, output, lambda: picture.save(output))  # noqa: B023


def test_labels_and_scenes(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "a.npy", VALUES)
    np.save(tmp_path / "tags.npy", (VALUES > 30).astype(np.uint8))
    scene = Scene({"volume.path": "a.npy", "volume.labels": "tags.npy"}, **LOOK)
    monkeypatch.chdir(tmp_path)
    picture = sheetsplat.render(scene)
    for name in ("a.npy", "tags.npy"):
        refused(tmp_path, pathlib.Path(name), lambda: picture.save(name))  # noqa: B023
        refused(tmp_path, pathlib.Path(name), lambda: scene.save(name))  # noqa: B023
    # The names were relative to the folder of then.
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "sub")
    refused(tmp_path, tmp_path / "a.npy", lambda: picture.save(tmp_path / "a.npy"))
    picture.save("a.npy")


def test_streamed_volumes_and_their_indices(ball: pathlib.Path, tmp_path: pathlib.Path) -> None:
    index = tmp_path / "index.exr"
    write_index(index, ball)
    picture = View(ball, memory=MEMORY, index=index, **STREAMED).render()
    refused(tmp_path, index, lambda: picture.save(index))
    refused(ball, ball / "x.png", lambda: picture.save(ball / "x.png"))
