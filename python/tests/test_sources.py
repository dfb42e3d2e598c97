"""Volumes from arrays of more dimensions, images of other libraries, stores and open files, and through pickles."""

import contextlib
import gzip
import io
import os
import pathlib
import pickle
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import sheetsplat
from sheetsplat import SheetsplatWarning, Volume, VolumeError


def voxels(dtype: Any = np.int16) -> np.ndarray:
    """Voxels `[z, y, x]` that no symmetry maps to themselves."""
    z, y, x = np.meshgrid(np.arange(5), np.arange(6), np.arange(7), indexing="ij")
    return (30 * (x + y > 5) + 3 * z + x).astype(dtype)


def colored(dtype: Any = np.uint8) -> np.ndarray:
    return np.stack([5 * voxels(), 3 * voxels(), 255 - 2 * voxels()], axis=3).astype(dtype)


@contextlib.contextmanager
def the_first_of(times: int) -> Iterator[None]:
    with pytest.warns(SheetsplatWarning, match=f"{times} times: the first is drawn"):
        yield


def same(one: Volume, other: Volume) -> None:
    """Asserts that two volumes are drawn alike and lie alike."""
    assert (one.shape, one.channels, one.unit) == (other.shape, other.channels, other.unit)
    np.testing.assert_allclose(one.spacing, other.spacing, rtol=1e-6)
    for channel in range(one.channels):
        np.testing.assert_array_equal(one.values_of(channel), other.values_of(channel))
    assert sheetsplat.render(one, size=24) == sheetsplat.render(other, size=24)


def test_arrays_are_as_in_files(tmp_path: pathlib.Path) -> None:
    """The dimensions of an array mean what they mean in a file of NumPy."""
    channels = np.stack([voxels(), 50 - voxels()])
    for name, values in {
        "gray": voxels(),
        "rgb": colored(),
        "rgba": np.concatenate([colored(), 40 * voxels(np.uint8)[..., None] % 255], axis=3),
        "deep": colored(np.uint16) * 200,
        "shares": colored(np.float32) / 255,
        "channels": channels,
        "film": np.stack([channels]),
    }.items():
        np.save(tmp_path / f"{name}.npy", values)
        same(Volume(values), Volume(tmp_path / f"{name}.npy"))
        same(Volume(np.asfortranarray(values)), Volume(values))
    same(Volume(colored(np.int64)), Volume(colored()))
    same(Volume(colored().tolist()), Volume(colored()))
    assert np.asarray(sheetsplat.render(colored(), size=24, preset="photo"))[..., 2].max() > 0.2
    labelled = Volume(colored(), labels=voxels() > 20, spacing=(2, 1, 1))
    assert labelled.info()["labels"] and labelled.spacing == (2, 1, 1)


def test_times_and_channels_of_arrays() -> None:
    film = np.stack([np.stack([voxels() + 100 * time, 1000 - voxels()]) for time in range(3)])
    with the_first_of(3):
        assert Volume(film).channels == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(Volume(film, time=2).values, voxels() + 200)
        np.testing.assert_array_equal(Volume(film, time=1, channel=1).values, 1000 - voxels())
        assert Volume(film[0], channel=0).channels == 1
    for source, selection, text in (
        (film, {"time": 3}, "time: found 3, allowed: 0 to 2"),
        (film, {"channel": 2}, "channel: found 2, allowed: 0 to 1"),
        (film, {"level": 0}, "level: found 0 beside ndarray"),
        (film[0], {"time": 1}, "time: found 1 beside an array c, z, y, x"),
        (colored(), {"channel": 1}, "channel: found 1 beside an array of colours"),
        (colored(np.int32) * 300, {}, "colours: found int32 from"),
        (colored(np.float32), {}, "colours: found float32 from"),
        (np.ma.masked_greater(colored(), 60), {}, "colours: found .* masked numbers"),
        (np.zeros((2, 0, 3, 4)), {}, "sizes: found 2×0×3×4"),
        (np.zeros((2, 2, 2, 2, 2, 2)), {}, "6 dimensions"),
        (np.zeros((300, 2, 2, 2)), {}, "channels"),
    ):
        with warnings.catch_warnings(), pytest.raises(VolumeError, match=text):
            warnings.simplefilter("ignore", SheetsplatWarning)
            Volume(source, **selection)  # type: ignore[arg-type]
    with pytest.raises(VolumeError, match="memory"):
        Volume(np.broadcast_to(np.uint8(0), (2048, 1024, 1024, 3)), memory="8GiB")


def test_only_one_time_is_computed() -> None:
    array = pytest.importorskip("dask.array", reason="dask is not installed")
    film = np.stack([np.stack([voxels(), 9 - voxels()]), np.stack([2 * voxels(), voxels()])])
    taken: list[int] = []

    def took(block: np.ndarray, block_info: Any = None) -> np.ndarray:
        taken.append(block_info[0]["chunk-location"][0])
        return block

    lazy = array.from_array(film, chunks=(1, 1, 5, 6, 7)).map_blocks(took, dtype=film.dtype, meta=np.empty((0,) * 5, film.dtype))
    np.testing.assert_array_equal(Volume(lazy, time=1).values_of(1), voxels())
    assert set(taken) == {1}
    with the_first_of(2):
        np.testing.assert_array_equal(Volume(lazy, channel=1).values, 9 - voxels())


def test_nibabel_of_more_dimensions(tmp_path: pathlib.Path) -> None:
    nibabel = pytest.importorskip("nibabel", reason="nibabel is not installed")
    affine = np.array([[-1.5, 0, 0, 4], [0, 0, 2.0, -3], [0, 0.75, 0, 5], [0, 0, 0, 1]])
    film = np.stack([voxels().T, 2 * voxels().T], axis=3)
    vectors = np.stack([voxels().T, 60 - voxels().T], axis=3)[:, :, :, None]
    colors = colored().transpose(2, 1, 0, 3)
    rgb = np.zeros(colors.shape[:3], [("R", "u1"), ("G", "u1"), ("B", "u1")])
    for at, name in enumerate("RGB"):
        rgb[name] = colors[..., at]
    for name, values in (("film", film), ("vectors", vectors), ("rgb", rgb)):
        made = nibabel.Nifti1Image(values, affine)
        made.header.set_xyzt_units("micron")
        nibabel.save(made, tmp_path / f"{name}.nii")
        selection = {"time": 1} if name == "film" else {}
        for image in (made, nibabel.load(tmp_path / f"{name}.nii")):
            same(Volume(image, **selection), Volume(tmp_path / f"{name}.nii", **selection))
    with the_first_of(2):
        np.testing.assert_array_equal(Volume(nibabel.Nifti1Image(film, affine)).values, voxels())
    assert Volume(nibabel.Nifti1Image(vectors, affine), channel=1).channels == 1
    with pytest.raises(VolumeError, match="time: found 2, allowed: 0 to 1"):
        Volume(nibabel.Nifti1Image(film, affine), time=2)


def test_simpleitk_of_more_dimensions() -> None:
    itk = pytest.importorskip("SimpleITK", reason="SimpleITK is not installed")

    def placed(values: np.ndarray, is_vector: bool) -> Any:
        image = itk.GetImageFromArray(values, isVector=is_vector)
        image.SetSpacing((0.5, 1.25, 2.0))
        image.SetDirection((0, 1, 0, 1, 0, 0, 0, 0, -1))
        return image

    plain = placed(voxels(), False)
    vectors = Volume(placed(np.stack([voxels(), 60 - voxels()], axis=3), True))
    assert vectors.channels == 2 and vectors.spacing == (2, 1.25, 0.5) and vectors.unit == "mm"
    np.testing.assert_array_equal(vectors.values_of(1), 60 - voxels())
    assert vectors.info()["axes"] == Volume(plain).info()["axes"]
    colors = Volume(placed(colored(), True))
    assert colors.channels == 1 and sheetsplat.render(colors, size=24) != sheetsplat.render(plain, size=24)
    film = itk.JoinSeries([plain, placed(2 * voxels(), False)])
    same(Volume(film, time=0), Volume(plain))
    np.testing.assert_array_equal(Volume(film, time=1).values, 2 * voxels())
    with the_first_of(2):
        Volume(film)
    with pytest.raises(VolumeError, match="time: found 1"):
        Volume(plain, time=1)


def test_groups_of_zarr(tmp_path: pathlib.Path) -> None:
    zarr = pytest.importorskip("zarr", reason="zarr is not installed")
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed")
    axes = [{"name": "c", "type": "channel"}] + [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    steps = [[1, 2, 0.5, 0.5], [1, 2, 1, 1]]
    sets = [{"path": str(at), "coordinateTransformations": [{"type": "scale", "scale": scale}]} for at, scale in enumerate(steps)]
    attributes = {"ome": {"version": "0.5", "multiscales": [{"name": "image", "axes": axes, "datasets": sets}]}}
    levels = [np.stack([voxels(), 60 - voxels()]), np.stack([voxels(), 60 - voxels()])[..., ::2, ::2]]

    def filled(store: Any) -> Any:
        group = zarr.open_group(store, mode="w", attributes=attributes)
        for at, values in enumerate(levels):
            group.create_array(str(at), data=values, chunks=values.shape, dimension_names=["c", "z", "y", "x"])
        return zarr.open_group(store, mode="r")

    on_disk, in_memory = filled(str(tmp_path / "a.zarr")), filled(zarr.storage.MemoryStore())
    expected = Volume(tmp_path / "a.zarr")
    assert expected.unit == "µm" and expected.spacing == (2, 0.5, 0.5) and expected.channels == 2
    for source in (on_disk, in_memory, fsspec.get_mapper(str(tmp_path / "a.zarr"))):
        same(Volume(source), expected)
        coarse, of_path = Volume(source, level=1, channel=1), Volume(tmp_path / "a.zarr", level=1, channel=1)
        assert coarse.spacing == of_path.spacing == (2, 1, 1) and coarse.channels == 1
        np.testing.assert_array_equal(coarse.values, of_path.values)
    copied = fsspec.get_mapper("memory://words.zarr")
    for key, value in fsspec.get_mapper(str(tmp_path / "a.zarr")).items():
        copied[key] = value
    same(Volume(copied), expected)
    with pytest.raises(VolumeError, match="level: found 2, allowed: 0 to 1"):
        Volume(in_memory, level=2)
    for store in (str(tmp_path / "single.zarr"), zarr.storage.MemoryStore()):
        single = zarr.open_group(store, mode="w")
        single.create_array("values", data=voxels())
        np.testing.assert_array_equal(Volume(single).values, voxels())
    single.create_array("more", data=voxels())
    with pytest.raises(VolumeError, match="source: found a group with more, values"):
        Volume(single)
    with pytest.raises(VolumeError, match="source: found a mapping with a, allowed: the keys of a Zarr store"):
        Volume({"a": voxels()})
    with pytest.raises(VolumeError, match="time: found 1"):
        Volume(in_memory, time=1)


def test_nodes_of_ome_zarr() -> None:
    class Node:
        """As much of a node as is read."""

        data = [np.stack([voxels(), voxels() + 7]), np.stack([voxels(), voxels() + 7])[..., ::2]]
        metadata = {
            "axes": [{"name": "t"}, {"name": "z", "unit": "nanometer"}, {"name": "y", "unit": "nanometer"}, {"name": "x", "unit": "nanometer"}],
            "coordinateTransformations": [[{"type": "scale", "scale": [1, 3, 2, 1]}], [{"type": "scale", "scale": [1, 3, 2, 2]}]],
        }

    volume = Volume(Node(), time=1, level=1)
    np.testing.assert_array_equal(volume.values, voxels()[..., ::2] + 7)
    assert volume.spacing == (3, 2, 2) and volume.unit == "nm"


def test_open_files(tmp_path: pathlib.Path) -> None:
    np.save(tmp_path / "a.npy", voxels())
    content = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "b.npy.gz").write_bytes(gzip.compress(content))
    expected = Volume(tmp_path / "a.npy")
    with open(tmp_path / "a.npy", "rb") as file, gzip.open(tmp_path / "b.npy.gz") as packed:
        for source in (file, packed, io.BytesIO(content)):
            same(Volume(source), expected)
    with open(tmp_path / "a.npy", "rb") as file:
        assert sheetsplat.render(file, size=24) == sheetsplat.render(expected, size=24)
    (tmp_path / "a.nhdr").write_text("NRRD0001\ntype: uint8\ndimension: 3\nsizes: 7 6 5\nencoding: raw\ndata file: a.raw\n")
    (tmp_path / "a.raw").write_bytes(voxels("u1").tobytes())
    with open(tmp_path / "a.nhdr", "rb") as header:
        np.testing.assert_array_equal(Volume(header).values, voxels())
    with open(tmp_path / "a.nhdr") as text, pytest.raises(VolumeError, match="file: found str .* binary mode"):
        Volume(text)
    with pytest.raises(VolumeError):
        Volume(io.BytesIO(b"nothing that is known"))
    closed = io.BytesIO()
    closed.close()
    with pytest.raises(VolumeError, match="file: found ValueError"):
        Volume(closed)


def test_pickles(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "a.npy", voxels())
    holed = voxels(np.float32)
    holed[0, 0, 0] = np.nan
    monkeypatch.chdir(tmp_path)
    nifti = type("Nifti", (), {"affine": np.array([[-1.0, 0, 0, 1], [0, 2, 0, 2], [0, 0, 3, 3], [0, 0, 0, 1]]), "dataobj": voxels().T})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SheetsplatWarning)
        made = [Volume("a.npy"), Volume("a.npy", spacing=3), Volume("a.npy", labels=voxels() % 3), Volume("builtin:head:12")]
        made += [Volume(voxels(), spacing=(3, 2, 1)), Volume(holed), Volume(colored()), Volume(colored(np.float32) / 255), Volume(voxels(), labels=voxels() % 3)]
        made += [Volume(np.stack([voxels(), 9 - voxels()])), Volume(nifti()), Volume(Volume("a.npy"), spacing=4)]
        made += [sheetsplat.View("a.npy", spacing=2).volume, sheetsplat.Scene(volume={"path": "a.npy", "spacing": [1, 2, 3]}).load_volume()]
    monkeypatch.chdir("/")
    with warnings.catch_warnings():
        # Holes have been told of.
        warnings.simplefilter("error")
        for volume in made:
            again = pickle.loads(pickle.dumps(volume))
            same(again, volume)
            facts = {**again.info(), "format": None, "type": None}
            assert repr(again) == repr(volume)
            np.testing.assert_equal(facts, {**volume.info(), "format": None, "type": None})
    assert len(pickle.dumps(made[0])) < 1000 < len(pickle.dumps(made[4]))
    os.remove(tmp_path / "a.npy")
    with pytest.raises(sheetsplat.FileError):
        pickle.loads(pickle.dumps(made[0]))


def test_a_volume_tells_what_it_is(tmp_path: pathlib.Path) -> None:
    np.save(tmp_path / "a.npy", voxels())
    text = repr(Volume(tmp_path / "a.npy", spacing=(3, 1, 1), labels=voxels() % 2))
    for part in ("5×6×7 voxels", "spacing (3.0, 1.0, 1.0)", "values 0 to 48", "labels", f"of {tmp_path / 'a.npy'}"):
        assert part in text, text
    assert "2 channels" in repr(Volume(np.stack([voxels(), voxels()])))
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    coords = {name: (name, np.arange(size) * 2.0, {"units": "um"}) for name, size in zip("zyx", voxels().shape, strict=True)}
    array = xarray.DataArray(voxels(), dims=tuple("zyx"), coords=coords)
    assert "spacing (2.0, 2.0, 2.0) µm" in repr(Volume(array))
