"""Volumes that do not fit into memory: read while they are drawn."""

import http.server
import json
import pathlib
import threading
import time
from typing import Any

import numpy as np
import pytest

import sheetsplat
from sheetsplat import SceneError, View, Volume, VolumeError

SIDE, CHUNK = 96, 16
MEMORY = "3MiB"
LOOK: dict[str, Any] = {
    "image": {"width": 90, "height": 80},
    "camera": {"direction": [0.4, 0.9, -0.3], "fit": "volume"},
    "transfer": {"color": [[0, [1, 0.9, 0.8]]], "opacity": [[0, 0], [60, 0], [200, 0.8]]},
    "splatting": {"opacity_threshold": 1, "classification": "before"},
}


def write_store(path: pathlib.Path, values: np.ndarray) -> None:
    """Writes a Zarr array `[…, z, y, x]` in chunks; those of zeros are left out."""
    chunks = [1] * (values.ndim - 3) + [CHUNK] * 3
    path.mkdir()
    metadata = {
        "zarr_format": 2,
        "shape": values.shape,
        "chunks": chunks,
        "dtype": values.dtype.str,
        "order": "C",
        "compressor": None,
        "filters": None,
        "fill_value": 0,
    }
    (path / ".zarray").write_text(json.dumps(metadata))
    for at in np.ndindex(*[size // chunk for size, chunk in zip(values.shape, chunks)]):
        chunk = values[tuple(slice(size * a, size * (a + 1)) for a, size in zip(at, chunks))]
        if chunk.any():
            (path / ".".join(map(str, at))).write_bytes(chunk.tobytes())


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """A Zarr array of a ball, whose chunks of zeros are left out."""
    z, y, x = np.ogrid[-1 : 1 : SIDE * 1j, -1 : 1 : SIDE * 1j, -1 : 1 : SIDE * 1j]
    values = np.clip(300 * (0.8 - np.sqrt(x * x + y * y + z * z)), 0, 250).round().astype("<f4")
    path = tmp_path_factory.mktemp("stores") / "ball.zarr"
    write_store(path, values)
    return path


def test_bytes_are_those_of_a_volume_in_memory(ball: pathlib.Path) -> None:
    whole, streamed = View(ball, **LOOK), View(ball, memory=MEMORY, **LOOK)
    assert (whole.volume.streamed, streamed.volume.streamed) == (False, True)
    assert streamed.volume.shape == whole.volume.shape == (SIDE,) * 3
    for direction in [(0.4, 0.9, -0.3), (0, -1, 0)]:
        pictures = [view.render(camera={"direction": direction}) for view in (whole, streamed)]
        np.testing.assert_array_equal(*pictures)
        assert np.asarray(pictures[0])[..., 3].max() > 0.9
    stats = pictures[1].stats
    assert 0 < stats["chunks_read"] < stats["chunks_total"] == (SIDE // CHUNK) ** 3
    pieces = streamed.split(6)
    parts = [[view.part(**piece) for piece in pieces] for view in (whole, streamed)]
    np.testing.assert_array_equal(*[sheetsplat.merge(each) for each in parts])
    turns = [list(view.orbit(count=3)) for view in (whole, streamed)]
    for pictures in zip(*turns, strict=True):
        np.testing.assert_array_equal(*pictures)


def write_index(path: pathlib.Path, store: pathlib.Path) -> None:
    """Writes the index of a store, as ``sheetsplat index`` does. The store's identity is told by the error for another one."""
    values = Volume(store).values
    path.write_text("sheetsplat index 1\nidentity 0\n")
    with pytest.raises(VolumeError, match="identity: found 0") as error:
        Volume(store, memory=MEMORY, index=path)
    lines = ["sheetsplat index 1", f"identity {error.value.allowed.split(',')[0]}", "level" + f" {SIDE // CHUNK}" * 3]
    for at in np.ndindex(*[SIDE // CHUNK] * 3):
        chunk = values[tuple(slice(CHUNK * a, CHUNK * (a + 1)) for a in at)]
        lines.append(f"{chunk.min():g} {chunk.max():g}")
    path.write_text("\n".join(lines) + "\n")


def test_an_index_spares_chunks(ball: pathlib.Path, tmp_path: pathlib.Path) -> None:
    index = tmp_path / "ball.index"
    write_index(index, ball)
    look = {**LOOK, "splatting": {"opacity_threshold": 1, "classification": "after"}}
    look["transfer"] = {"color": [[0, [1, 0.9, 0.8]]], "opacity": [[230, 0], [240, 0.8]]}
    whole = View(ball, **look).render()
    plain, indexed = [View(ball, memory=MEMORY, index=path, **look).render() for path in (None, index)]
    np.testing.assert_array_equal(np.asarray(indexed), np.asarray(whole))
    assert 0 < indexed.stats["chunks_read"] < plain.stats["chunks_read"]
    scene = sheetsplat.Scene(volume={"path": str(ball)}, **look)
    assert scene.load_volume(memory=MEMORY, index=index).streamed
    with pytest.raises(sheetsplat.FileError, match=r"missing\.index"):
        View(ball, memory=MEMORY, index=tmp_path / "missing.index")


def test_channels_are_streamed(tmp_path: pathlib.Path) -> None:
    z, y, x = np.ogrid[-1 : 1 : SIDE * 1j, -1 : 1 : SIDE * 1j, -1 : 1 : SIDE * 1j]
    ball = lambda at: np.clip(300 * (0.6 - np.sqrt((x - at) ** 2 + y * y + z * z)), 0, 180).astype("<f4")
    path = tmp_path / "two.zarr"
    write_store(path, np.stack([ball(-0.2), ball(0.3)]))
    opacity = [[0, 0], [60, 0], [200, 0.8]]
    look: dict[str, Any] = {key: LOOK[key] for key in ("image", "camera", "splatting")}
    channels = [{"transfer": {"color": [[0, color]], "opacity": opacity}} for color in ([1, 0, 0], [0, 1, 0])]
    whole, streamed = View(path, **look, channel=channels), View(path, memory="6MiB", **look, channel=channels)
    assert (whole.volume.streamed, streamed.volume.streamed, streamed.volume.channels) == (False, True, 2)
    pictures = [view.render() for view in (whole, streamed)]
    np.testing.assert_allclose(*[np.asarray(picture) for picture in pictures], rtol=0, atol=1e-6)
    total = 2 * (SIDE // CHUNK) ** 3
    assert 0 < pictures[1].stats["chunks_read"] <= pictures[1].stats["chunks_total"] == total
    channels[0]["visible"] = False
    hidden = View(path, memory="6MiB", **look, channel=channels).render()
    assert 0 < hidden.stats["chunks_read"] <= total / 2
    parts = [streamed.part(slabs=slabs) for slabs in ((-1000, 0), (0, 1000))]
    np.testing.assert_allclose(np.asarray(sheetsplat.merge(parts)), np.asarray(pictures[1]), rtol=0, atol=1e-6)


@pytest.mark.parametrize("kind", ["uint8", "int16", "uint16"])
def test_stores_of_few_bits_are_held_in_them(kind: str, tmp_path: pathlib.Path) -> None:
    side = 128
    values = np.random.default_rng(0).integers(-100, 100, (2, side, side, side)).astype(np.int16)
    values = (values if kind == "int16" else values + 1000 if kind == "uint16" else values + 100).astype(kind)
    # Larger values come late.
    values[:, side // 2 :] += 30
    path = tmp_path / "few.zarr"
    write_store(path, values)
    # Four bytes for each value would be 16 MiB, and 8 MiB for one channel.
    volume = Volume(path, memory="14MiB")
    assert not volume.streamed and volume.nbytes == values.nbytes
    np.testing.assert_array_equal([volume.values, volume.values_of(1)], values)
    assert Volume(path, memory="7.5MiB", channel=1).nbytes == values[1].nbytes


def test_what_needs_all_values_is_refused(ball: pathlib.Path) -> None:
    volume = Volume(ball, memory=MEMORY)
    assert volume.info()["streamed"] and volume.info()["max"] <= 250
    for attempt in (lambda: volume.values, lambda: Volume(volume, spacing=2)):
        with pytest.raises(VolumeError, match="found a volume that is streamed"):
            attempt()
    with pytest.raises(SceneError, match="splatting.interpolation: found \"exact\" for a volume that is streamed"):
        View(volume, backend="reference", splatting={"classification": "after", "interpolation": "exact"})
    with pytest.raises(SceneError, match=r"memory: found \"2XB\", allowed: a number of bytes"):
        Volume(ball, memory="2XB")
    assert not Volume(ball, memory=1 << 23).streamed
    with pytest.raises(VolumeError, match="level"):
        Volume(ball, level=1)


def test_addresses(ball: pathlib.Path) -> None:
    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments, directory=str(ball.parent))

        def log_message(self, *arguments: Any) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        address = f"http://127.0.0.1:{server.server_port}/ball.zarr"
        image = sheetsplat.render(address, **LOOK)
        np.testing.assert_array_equal(image, sheetsplat.render(ball, **LOOK))
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_workers_read_their_own_chunks(ball: pathlib.Path) -> None:
    distributed = pytest.importorskip("distributed", reason="distributed is not installed")
    import sheetsplat.dask

    view = View(ball, memory=MEMORY, **LOOK)
    view.scene = view.scene.explicit(view.volume)
    expected = sheetsplat.merge(view.part(**piece) for piece in view.split(5))
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        future = sheetsplat.dask.render(str(ball), client=client, parts=5, memory=MEMORY, **LOOK)
        np.testing.assert_array_equal(future.result(timeout=120), expected)


def test_bars_count_what_is_read(ball: pathlib.Path, monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path) -> None:
    from sheetsplat import _loading, _native

    read = _native.BytesRead()
    _native.Volume.open(str(ball), None, [None, None, None], None, read)
    stored = sum(path.stat().st_size for path in ball.iterdir())
    # Metadata are read more than once.
    assert stored <= read.count < stored + 100_000
    shown: list[dict[str, Any]] = []

    class Bar:
        def __init__(self, **arguments: Any) -> None:
            self.n = 0
            shown.append({**arguments, "bar": self})

        def __enter__(self) -> "Bar":
            return self

        def __exit__(self, *_: Any) -> None:
            pass

        def update(self, count: int) -> None:
            self.n += count

    tqdm = pytest.importorskip("tqdm.auto")
    monkeypatch.setattr(tqdm, "tqdm", Bar)
    monkeypatch.setattr(_loading, "_DELAY", 0.0)
    path = tmp_path / "values.npy"
    np.save(path, np.zeros((200, 200, 100), np.float32))
    with _loading.loading(str(path), True) as read:
        _native.Volume.open(str(path), None, [None, None, None], None, read)
        # The bar takes a step.
        time.sleep(0.5)
    (bar,) = shown
    assert (bar["desc"], bar["total"], bar["bar"].n) == (str(path), path.stat().st_size, path.stat().st_size)
    shown.clear()
    Volume(path, progress=False)
    assert not shown
