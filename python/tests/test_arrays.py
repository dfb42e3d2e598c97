"""Volumes from arrays of every library: what they may take, and what is no volume."""

import pathlib
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import sheetsplat
from sheetsplat import Volume, VolumeError

STATUS = pathlib.Path("/proc/self/status")


def voxels(dtype: Any = np.int16) -> np.ndarray:
    z, y, x = np.meshgrid(np.arange(6), np.arange(7), np.arange(8), indexing="ij")
    return (10 * z + 3 * y + x - (0 if np.dtype(dtype).kind == "u" else 20)).astype(dtype)


def refused(field: str, *arguments: Any, **keywords: Any) -> VolumeError:
    with pytest.raises(VolumeError) as caught:
        Volume(*arguments, **keywords)
    error = caught.value
    assert error.key == field and error.found and error.allowed, str(error)
    return error


def test_sizes_are_checked_before_anything_is_copied() -> None:
    """None of these arrays takes memory itself: every voxel is the same number."""
    one = np.float32(0)
    error = refused("sizes", np.broadcast_to(one, (100_000,) * 3))
    assert error.found == "100000×100000×100000" and "4294967295" in str(error.allowed)
    refused("sizes", np.broadcast_to(one, (2**16, 2**16, 1)))
    refused("sizes", np.broadcast_to(one, (2**16, 2**16, 0)))
    refused("sizes", voxels(), labels=np.broadcast_to(np.uint8(0), (100_000,) * 3))
    refused("sizes", np.broadcast_to(one, (100_000, 100_000, 2, 100_000)), channel_axis=2)
    # It has few enough voxels for a volume, and more than the memory allows.
    error = refused("memory", np.broadcast_to(one, (2048, 1024, 1024)), memory="8GB")
    assert error.found == "2048×1024×1024 voxels, which take 8589934592 bytes"
    assert error.allowed == "at most the memory limit of 8000000000 bytes"


def test_memory_counts_channels_and_labels() -> None:
    values = np.zeros((4, 5, 6), np.float32)
    values[1, 2, 3] = 1
    labels = np.zeros(values.shape, np.uint8)
    assert Volume(values, memory=480).shape == (4, 5, 6)
    error = refused("memory", values, memory=479)
    assert "4×5×6 voxels, which take 480 bytes" in str(error) and "the memory limit of 479 bytes" in str(error)
    assert Volume(values, labels=labels, memory=720).info()["labels"]
    error = refused("memory", values, labels=labels, memory=719)
    assert "4×5×6 voxels with labels, which take 720 bytes" in str(error)
    stack = np.stack([values, values, values])
    assert Volume(stack, channel_axis=0, memory=1440).channels == 3
    error = refused("memory", stack, channel_axis=0, memory="1439")
    assert "4×5×6 voxels of 3 channels, which take 1440 bytes" in str(error)
    refused("memory", stack, channel_axis=0, labels=labels, memory=1679)
    assert Volume(stack, channel_axis=0, labels=labels, memory=1680).channels == 3
    # A volume's labels, and those beside a path or a builtin volume.
    refused("memory", Volume(values), labels=labels, memory=359)
    with pytest.raises(VolumeError, match="memory limit of 10 bytes"):
        Volume("builtin:cube:4", memory=10)
    with pytest.raises(VolumeError, match="memory limit"):
        Volume("builtin:cube:4", labels=np.zeros((4, 4, 4), int), memory=383)
    assert Volume("builtin:cube:4", labels=np.zeros((4, 4, 4), int), memory=384).info()["labels"]
    with pytest.raises(VolumeError, match="which take 480 bytes"):
        sheetsplat.render(values, memory=100)
    with pytest.raises(sheetsplat.SceneError, match="memory: found \"much\""):
        Volume(values, memory="much")


@pytest.mark.parametrize(("dtype", "bytes"), [("u1", 1), ("i1", 1), ("?", 1), ("u2", 2), (">i2", 2), ("i4", 4), ("f2", 4), ("f8", 4)])
def test_memory_counts_the_bits_of_values(dtype: str, bytes: int) -> None:
    values = np.zeros((4, 5, 6), dtype)
    values[1, 2, 3] = 1
    labels = np.zeros(values.shape, np.uint8)
    assert Volume(values, memory=120 * bytes).shape == (4, 5, 6)
    error = refused("memory", values, memory=120 * bytes - 1)
    assert f"4×5×6 voxels, which take {120 * bytes} bytes" in str(error)
    # Whatever the type, these are whole numbers of 8 bits, and labels beside them need no more than 2 bytes each.
    assert Volume(values).nbytes == 120
    assert Volume(Volume(values), labels=labels, memory=360).nbytes == 120
    refused("memory", Volume(values), labels=labels, memory=359)
    assert Volume(np.stack([values] * 3), channel_axis=0, memory=360 * bytes).nbytes == 360
    refused("memory", np.stack([values] * 3), channel_axis=0, memory=360 * bytes - 1)


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "f4"])
def test_strides_and_values_of_few_bits(dtype: str) -> None:
    values = voxels(dtype)
    values[0, 0, 0] = 127
    for array in (values, values.transpose(2, 0, 1)[::-1, ::2, ::-3], np.asfortranarray(values), values[:, 1:5, 2:]):
        array = array.view()
        array.flags.writeable = False
        volume = Volume(array)
        assert volume.values.dtype == np.float32
        np.testing.assert_array_equal(volume.values, array.astype(np.float32))
        assert volume.nbytes == array.size
    wide = values.astype("i4" if np.dtype(dtype).kind != "f" else "f8")
    wide[1, 1, 1] = 300
    assert Volume(wide).nbytes == 2 * wide.size
    wide[1, 1, 1] = 1 << 20
    assert Volume(wide).nbytes == 4 * wide.size


def test_sources_that_are_no_array_yet_are_not_computed() -> None:
    class Lazy:
        shape = (3000, 3000, 3000)

        def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
            raise AssertionError("computed")

    refused("sizes", Lazy())
    Lazy.shape = (1000, 1000, 1000)
    refused("memory", Lazy(), memory="1GiB")
    Lazy.shape = (2, 1000, 1000, 1000)  # type: ignore[assignment]
    refused("memory", Lazy(), channel_axis=0, memory="7GiB")
    Lazy.shape = (10, 10, 10)
    refused("array", Lazy())


@pytest.mark.parametrize("dtype", ["f2", ">f2", "g", ">i2", ">u4", ">f8", ">i8"])
def test_converted_samples_of_many_blocks(dtype: str) -> None:
    """Forms that the processor does not read are converted by blocks of a million samples: of planes, rows, and pieces of rows."""
    for shape in [(37, 211, 301), (3, 1700, 700), (2, 2, 1_200_000)]:
        values = (np.arange(np.prod(shape)) % 1009).reshape(shape).astype(dtype)
        np.testing.assert_array_equal(Volume(values).values, values.astype(np.float32))
    turned = voxels(dtype).transpose(2, 0, 1)[::-1, ::2]
    np.testing.assert_array_equal(Volume(turned).values, turned.astype(np.float32))
    labels = (np.arange(37 * 211 * 301) % 999).reshape(37, 211, 301).astype(dtype)
    view = Volume(np.ones(labels.shape, np.uint8) + (labels > 5), labels=labels)
    assert view.info()["labels"]
    if np.dtype(dtype).kind != "u":
        labels[36, 210, 299] = -1
        error = refused("labels[36, 210, 299]", np.ones(labels.shape, np.uint8), labels=labels)
        assert str(error.found).startswith("-1")


def test_unaligned_samples() -> None:
    packed = np.zeros(6 * 7 * 8, np.dtype([("flag", "u1"), ("value", "f8")]))
    values = packed["value"].reshape(6, 7, 8)
    values[...] = voxels()
    assert not values.flags.aligned
    np.testing.assert_array_equal(Volume(values).values, voxels())


@pytest.mark.parametrize("dtype", ["i1", "i2", "i4", "i8", "f4", "f8"])
def test_negative_labels_are_refused(dtype: str) -> None:
    """In 8 and 16 bits, -1 has the bits of the label 65535."""
    labels = np.zeros((2, 3, 4), dtype)
    labels[1, 0, 2] = -1
    refused("labels[1, 0, 2]", voxels()[:2, :3, :4], labels=labels)


def test_labels_are_whole_numbers() -> None:
    values, labels = voxels()[:2, :3, :4], np.zeros((2, 3, 4))
    for number in (0.5, 70000.5, np.nan, np.inf, -0.25):
        labels[0, 2, 3] = number
        refused("labels[0, 2, 3]", values, labels=labels)
    labels[0, 2, 3] = 65535
    assert Volume(values, labels=labels).info()["labels"]
    with pytest.raises(VolumeError, match="labels: found 2 dimensions"):
        Volume(values, labels=labels[0])


@pytest.mark.parametrize("dtype", ["i4", "u4", "i8", "u8", "f8"])
def test_labels_beyond_16_bits_are_exact(dtype: str) -> None:
    """Tables and pickles speak the array's own numbers, as they do a file's."""
    values = voxels()
    labels = np.zeros(values.shape, dtype)
    labels[2:] = 100_000
    labels[4:] = 2_000_000_011 if dtype != "u8" else 2**63 + 1025
    for volume in (Volume(values, labels=labels), Volume(Volume(values), labels=labels)):
        again = pickle.loads(pickle.dumps(volume))
        for shown in (volume, again):
            ids = sheetsplat._native.label_array(shown._native)
            assert ids is not None and (ids == labels.astype(ids.dtype)).all()
        table = [{"label": 0, "visible": False}, {"label": 100_000, "color": [[0, [1, 0, 0]]], "opacity": [[0, 0.9]]}]
        small = {"image": {"width": 24, "height": 24}}
        red = sheetsplat.render(volume, transfer={"label": table}, **small)
        places = np.unique(labels, return_inverse=True)[1].reshape(labels.shape)
        by_place = {"label": [table[0], {**table[1], "label": 1}]}
        direct = sheetsplat.render(values, labels=places, transfer=by_place, **small)
        assert red == direct and np.asarray(red)[..., 0].max() > 0.1
    labels[0, 0, 0] = 3
    negative = labels.astype("f8")
    negative[0, 0, 1] = -1
    refused("labels[0, 0, 1]", values, labels=negative)
    many = np.arange(70_000).reshape(70, 100, 10)
    assert "70000 different labels" in str(refused("labels", many.astype("f4"), labels=many))


def test_what_float32_does_not_hold() -> None:
    """Integers beyond 2²⁴ are rounded; numbers beyond float32's range are holes."""
    values = np.array([2**24, 2**24 + 1, 2**24 + 2, 2**53 + 1], np.int64).reshape(1, 2, 2)
    assert Volume(values).values.ravel().tolist() == [2**24, 2**24, 2**24 + 2, 2**53]
    wide = np.array([1.0, 1e39, -1e300, np.inf]).reshape(1, 2, 2)
    volume = Volume(wide)
    assert volume.holes == 3 and volume.info()["max"] == 1


def test_a_failing_array_is_refused() -> None:
    class Failing:
        def __init__(self, error: Exception) -> None:
            self.error = error

        def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
            raise self.error

    # What tensors with gradients, tensors on a GPU, and files that were removed raise.
    for error in (RuntimeError("Can't call numpy()"), TypeError("can't convert cuda:0"), OSError(2, "gone"), KeyError("x")):
        caught = refused("array", Failing(error))
        assert type(error).__name__ in str(caught) and caught.__cause__ is error
        refused("labels", voxels(), labels=Failing(error))
        refused("array", Failing(error), channel_axis=0)
        with pytest.raises(sheetsplat.ImageError, match=type(error).__name__):
            sheetsplat.Image(Failing(error))


def test_xarray() -> None:
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    array = xarray.DataArray(voxels(), dims=("z", "y", "x"), coords={"z": np.arange(6) * 2.0})
    np.testing.assert_array_equal(Volume(array).values, voxels())
    np.testing.assert_array_equal(Volume(array.transpose("x", "y", "z")).values, voxels())
    stack = xarray.concat([array, array + 1], dim="channel")
    np.testing.assert_array_equal(Volume(stack, channel_axis=0).values_of(1), voxels() + 1)
    refused("shape", array[0])


def test_dask_arrays() -> None:
    array = pytest.importorskip("dask.array", reason="dask is not installed")
    chunked = array.from_array(voxels(), chunks=(2, 3, 4))
    np.testing.assert_array_equal(Volume(2 * chunked, spacing=(3, 1, 1)).values, 2 * voxels())
    labels = chunked > 10
    assert Volume(chunked, labels=labels).info()["labels"]
    refused("sizes", array.zeros((100_000,) * 3, chunks=10_000))
    refused("memory", array.zeros((1000,) * 3, chunks=100), memory="1GiB")

    def fail(block: np.ndarray) -> np.ndarray:
        raise ZeroDivisionError("in a task")

    caught = refused("array", chunked.map_blocks(fail, dtype=float, meta=np.empty((0, 0, 0))))
    assert "in a task" in str(caught)


def test_zarr(tmp_path: pathlib.Path) -> None:
    zarr = pytest.importorskip("zarr", reason="zarr is not installed")
    stored = zarr.open_array(str(tmp_path / "a.zarr"), mode="w", shape=(6, 7, 8), chunks=(4, 4, 4), dtype="i2")
    stored[...] = voxels()
    np.testing.assert_array_equal(Volume(stored).values, voxels())
    # The library's own reader gives the same.
    np.testing.assert_array_equal(Volume(tmp_path / "a.zarr").values, voxels())
    assert Volume(voxels(), labels=zarr.array(voxels("u2"), chunks=(4, 4, 4))).info()["labels"]


def test_torch() -> None:
    torch = pytest.importorskip("torch", reason="torch is not installed")
    tensor = torch.from_numpy(voxels()).permute(0, 2, 1)
    np.testing.assert_array_equal(Volume(tensor).values, voxels().transpose(0, 2, 1))
    np.testing.assert_array_equal(Volume(tensor.to(torch.float16)).values, voxels().transpose(0, 2, 1))
    refused("array", tensor.float().requires_grad_())


@pytest.mark.skipif(not STATUS.exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize(("dtype", "bytes"), [("f2", 4), ("f4", 4), (">i2", 2), ("i2", 2), ("u1", 1), ("?", 1)])
def test_no_second_copy(dtype: str, bytes: int) -> None:
    """While a volume is made of an array, memory grows by the bytes that its own form has for each voxel, and by little more."""
    code = f"""
import numpy as np, sheetsplat

def peak():
    return next(int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith("VmHWM"))

values = np.ones((256, 256, 256), {dtype!r})
sheetsplat.Volume(values[:2])
before = peak()
volume = sheetsplat.Volume(values, labels=values, spacing=2)
assert volume.nbytes == values.size
print(peak() - before)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    # 16 MiB for each byte of a value, and 32 of labels.
    taken = 16 * bytes + 32
    assert taken - 6 < float(done.stdout) < taken + 16, done.stdout


def test_builtin_volumes_have_no_channels() -> None:
    for selection in ({"channel": 1}, {"time": 1}, {"level": 1}):
        with pytest.raises(VolumeError):
            Volume("builtin:cube:4", **selection)
    assert Volume("builtin:head:16", spacing=(3, 2, 1)).spacing == (3, 2, 1)


@pytest.mark.parametrize("key", ["channel", "time", "level"])
def test_numbers_of_channels_are_checked(key: str, tmp_path: pathlib.Path) -> None:
    path = tmp_path / "values.npy"
    np.save(path, voxels())
    for number in (-1, 2**32, 2**80, 0.5, "first"):
        with pytest.raises(VolumeError, match=f"{key}: found .*, allowed: a whole number from 0") as caught:
            Volume(path, **{key: number})
        assert caught.value.key == key
    assert Volume(path, **{key: np.int8(0)}).shape == (6, 7, 8)
    with pytest.raises(VolumeError, match="channel: found -1"):
        Volume(voxels()).values_of(-1)
