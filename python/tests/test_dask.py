"""Pictures by a Dask cluster of two processes."""

import os
import pathlib
import pickle
import signal
import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip("distributed", reason="distributed is not installed")

import distributed
from distributed import Client, LocalCluster

import sheetsplat
import sheetsplat.dask

LOOK: dict[str, Any] = {
    "image": {"width": 60, "height": 50},
    "camera": {"direction": [0.4, 0.9, -0.3]},
    "splatting": {"opacity_threshold": 1},
}


@pytest.fixture(scope="module")
def client():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        yield client


def in_one_process(source: Any, parts: int, **settings: Any) -> np.ndarray:
    view = sheetsplat.View(source, **settings)
    view.scene = view.scene.explicit(view.volume)
    return np.asarray(sheetsplat.merge(view.part(**piece) for piece in view.split(parts)))


@pytest.mark.parametrize("parts", [1, 7, 12])
def test_bytes_are_those_of_one_process(client: Client, parts: int) -> None:
    future = sheetsplat.dask.render("builtin:head:48", client=client, parts=parts, **LOOK)
    image = future.result(timeout=120)
    assert isinstance(image, sheetsplat.Image)
    np.testing.assert_array_equal(np.asarray(image), in_one_process("builtin:head:48", parts, **LOOK))
    whole = np.asarray(sheetsplat.render("builtin:head:48", **LOOK))
    assert np.abs(np.asarray(image) - whole).max() < 1e-6


def test_arrays_paths_and_scenes(client: Client, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    values = np.random.default_rng(4).normal(size=(12, 14, 16)).astype(np.float32)
    expected = in_one_process(values, 4, spacing=(2, 1, 1), **LOOK)
    arguments: dict[str, Any] = {"client": client, "parts": 4, "spacing": (2, 1, 1), **LOOK}
    drawn = sheetsplat.dask.render(values, **arguments).result(timeout=120)
    np.testing.assert_array_equal(np.asarray(drawn), expected)
    np.save(tmp_path / "values.npy", values)
    # A path is relative to where the picture is asked for, not to where a worker runs.
    monkeypatch.chdir(tmp_path)
    drawn = sheetsplat.dask.render("values.npy", **arguments).result(timeout=120)
    np.testing.assert_array_equal(np.asarray(drawn), expected)
    scene = sheetsplat.Scene(volume={"path": "values.npy", "spacing": [1, 1, 2]}, **LOOK)
    scene.save("scene.toml")
    for source in (scene, "scene.toml"):
        drawn = sheetsplat.dask.render(source, client=client, parts=4).result(timeout=120)
        np.testing.assert_array_equal(np.asarray(drawn), expected)


def test_arrays_of_dask_are_computed_by_the_cluster(client: Client) -> None:
    array = pytest.importorskip("dask.array", reason="dask.array is not installed")
    values = np.random.default_rng(5).normal(size=(32, 32, 32)).astype(np.float32)
    labels = (values > 0).astype(np.uint8)
    expected = in_one_process(values, 8, **LOOK)
    for _ in range(3):
        chunked = array.from_array(values, chunks=8) + 0
        drawn = sheetsplat.dask.render(chunked, client=client, parts=8, **LOOK).result(timeout=120)
        np.testing.assert_array_equal(np.asarray(drawn), expected)
    drawn = sheetsplat.dask.render(values, labels=array.from_array(labels, chunks=16), client=client, parts=8, **LOOK)
    np.testing.assert_array_equal(np.asarray(drawn.result(timeout=120)), in_one_process(values, 8, labels=labels, **LOOK))


def test_scenes_are_pickled(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "values.npy", np.zeros((4, 4, 4)))
    monkeypatch.chdir(tmp_path)
    scene = sheetsplat.Scene(volume={"path": "values.npy"}, camera={"direction": [0.1, 0.2, 0.3]})
    data = pickle.dumps(scene)
    monkeypatch.chdir("/")
    assert pickle.loads(data).load_volume().shape == (4, 4, 4)
    assert pickle.loads(data).to_dict()["camera"] == scene.to_dict()["camera"]


def test_a_lost_workers_parts_are_drawn_again() -> None:
    look = {**LOOK, "image": {"width": 300, "height": 300}}
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        future = sheetsplat.dask.render("builtin:head:64", client=client, parts=30, **look)
        workers = client.run(os.getpid)
        # On a machine that is done before this is seen, the picture is lost, and all of it is drawn again.
        while not future.done() and sum("-part-" in str(key) for keys in client.has_what().values() for key in keys) < 3:
            time.sleep(0.01)
        # The worker that holds most parts.
        holding = {name: sum("-part-" in str(key) for key in keys) for name, keys in client.has_what().items()}
        victim = max(holding, key=lambda name: holding[name])
        os.kill(workers[victim], signal.SIGKILL)
        image = future.result(timeout=240)
    np.testing.assert_array_equal(np.asarray(image), in_one_process("builtin:head:64", 30, **look))


def test_orbits(client: Client) -> None:
    futures = sheetsplat.dask.orbit("builtin:head:32", client=client, count=5, frames=range(1, 4), parts=3, **LOOK)
    images = client.gather(futures)
    expected = list(sheetsplat.View("builtin:head:32", **LOOK).orbit(count=5, frames=range(1, 4)))
    assert len(images) == 3
    for image, other in zip(images, expected, strict=True):
        assert np.abs(np.asarray(image) - np.asarray(other)).max() < 1e-6


def test_a_scene_by_its_place(client: Client) -> None:
    drawn = sheetsplat.dask.render("builtin:head:32", LOOK, client=client, parts=3).result(timeout=120)
    np.testing.assert_array_equal(np.asarray(drawn), in_one_process("builtin:head:32", 3, **LOOK))
    [image] = client.gather(sheetsplat.dask.orbit("builtin:head:32", LOOK, client=client, count=1))
    assert np.abs(np.asarray(image) - np.asarray(next(sheetsplat.View("builtin:head:32", **LOOK).orbit(count=1)))).max() < 1e-6


def test_progress_is_shown(client: Client, capsys: pytest.CaptureFixture[str]) -> None:
    future = sheetsplat.dask.render("builtin:head:32", LOOK, client=client, parts=6)
    distributed.progress(future, notebook=False)
    assert "100% Completed" in capsys.readouterr().out
    assert isinstance(future.result(timeout=120), sheetsplat.Image)


def test_errors_reach_the_caller(client: Client, tmp_path: pathlib.Path) -> None:
    with pytest.raises(sheetsplat.SceneError, match="camera.up"):
        sheetsplat.dask.render("builtin:head:16", client=client, camera={"up": [0, 0, 0]})
    with pytest.raises(sheetsplat.SceneError, match="parts: found 0"):
        sheetsplat.dask.render("builtin:head:16", client=client, parts=0)
    with pytest.raises(TypeError, match="give its path or its array"):
        sheetsplat.dask.render(sheetsplat.Volume("builtin:head:16"), client=client)
    missing = sheetsplat.dask.render(tmp_path / "missing.nrrd", client=client)
    with pytest.raises(sheetsplat.FileError, match=r"missing\.nrrd"):
        missing.result(timeout=120)
    refused = sheetsplat.dask.render("builtin:head:16", client=client, splatting={"method": "axis-aligned"})
    with pytest.raises(sheetsplat.SceneError, match="splatting.method") as error:
        refused.result(timeout=120)
    assert error.value.key == "splatting.method"


def test_pictures_are_cancelled(client: Client) -> None:
    future = sheetsplat.dask.render("builtin:head:64", client=client, parts=64, **LOOK)
    future.cancel()
    deadline = time.monotonic() + 60
    while any("sheetsplat" in str(key) for keys in client.processing().values() for key in keys):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert future.cancelled()
