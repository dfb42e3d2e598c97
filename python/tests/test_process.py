"""What a process needs and keeps: libraries, memory, a clean exit."""

import gc
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import sheetsplat

MAPS = pathlib.Path("/proc/self/maps")
STATUS = pathlib.Path("/proc/self/status")


def python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-X", "faulthandler", "-W", "error", "-c", code], capture_output=True, text=True)


def test_importing_needs_no_numpy() -> None:
    """NumPy alone takes longer to import than a quick start allows."""
    result = python("import sys, sheetsplat; sys.exit('numpy' in sys.modules)")
    assert (result.returncode, result.stderr) == (0, "")


def test_exits_are_clean() -> None:
    code = """
import threading, sheetsplat
view = sheetsplat.View("builtin:head:16", image={"width": 32, "height": 32})
view.render()
threading.Thread(target=lambda: [view.render() for _ in range(50)], daemon=True).start()
view.render()
"""
    result = python(code)
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.skipif(not MAPS.exists(), reason="needs Linux's /proc")
def test_no_driver_is_loaded() -> None:
    code = """
import sheetsplat
sheetsplat.render("builtin:head:16", image={"width": 32, "height": 32})
print(open("/proc/self/maps").read())
"""
    result = python(code)
    assert result.returncode == 0 and "_native" in result.stdout, result.stderr
    assert "libvulkan" not in result.stdout and "libGL" not in result.stdout and "libX11" not in result.stdout


def resident_kib() -> int:
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1])


@pytest.mark.skipif(not STATUS.exists(), reason="needs Linux's /proc")
def test_renders_leak_nothing() -> None:
    """Over 2 000 renders the process keeps its size, also where pictures are encoded and settings are refused."""
    values = np.random.default_rng(1).normal(size=(3, 3, 3))

    def draw(count: int) -> None:
        for number in range(count):
            image = sheetsplat.render(values, image={"width": 64, "height": 64})
            if number % 50 == 0:
                image._repr_png_()
                with pytest.raises(sheetsplat.SceneError):
                    sheetsplat.Scene(camera={"up": [0, 0, 0]})
        gc.collect()

    draw(500)
    before = resident_kib()
    draw(2000)
    # The pictures alone would take 125 MiB.
    assert resident_kib() - before < 1024


FORK = """
import multiprocessing, pathlib, sys
import numpy as np
import sheetsplat

LOOK = {"image": {"width": 40, "height": 30}}

def draw(number):
    values = np.random.default_rng(number).normal(size=(12, 12, 12))
    return np.asarray(sheetsplat.render(values, **LOOK)).copy()

def by_gpu(_):
    try:
        sheetsplat.render("builtin:head:8", backend="gpu", **LOOK)
    except sheetsplat.DeviceError as error:
        return str(error)
    return "drawn"

def by_view(name):
    try:
        return np.asarray(VIEWS[name].render()).copy()
    except sheetsplat.DeviceError as error:
        return str(error)

def by_auto(_):
    return np.asarray(sheetsplat.render("builtin:head:8", backend="auto", **LOOK)).shape

if __name__ == "__main__":
    method, is_before = sys.argv[1], sys.argv[2] == "before"
    VIEWS = {}
    if is_before:
        draw(0)
        from test_streaming import MEMORY, SIDE, write_store
        from test_streaming import LOOK as STREAMED
        write_store(pathlib.Path("values.zarr"), np.full((SIDE, SIDE, SIDE), 90, np.float32))
        streamed = sheetsplat.View("values.zarr", memory=MEMORY, **STREAMED)
        VIEWS = {"whole": sheetsplat.View("builtin:head:12", **LOOK), "streamed": streamed}
        pictures_before = {name: by_view(name) for name in VIEWS}
    with multiprocessing.get_context(method).Pool(2) as pool:
        pictures = pool.map_async(draw, range(6)).get(100)
        if method == "fork":
            assert "forked process" in pool.apply_async(by_gpu, (0,)).get(100)
            if is_before:
                assert (pool.apply_async(by_view, ("whole",)).get(100) == pictures_before["whole"]).all()
                assert "forked process" in pool.apply_async(by_view, ("streamed",)).get(100)
            assert pool.apply_async(by_auto, (0,)).get(100) == (30, 40, 4)
    for number, picture in enumerate(pictures):
        assert (picture == draw(number)).all(), number
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
@pytest.mark.parametrize("is_before", ["before", "after"])
def test_processes_draw_the_same(method: str, is_before: str, tmp_path: pathlib.Path) -> None:
    """However processes are started, before or after a first picture."""
    script = tmp_path / "script.py"
    script.write_text(FORK)
    command = [sys.executable, "-X", "faulthandler", str(script), method, is_before]
    environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(__file__).parent)}
    result = subprocess.run(command, capture_output=True, text=True, timeout=200, cwd=tmp_path, env=environment)
    assert result.returncode == 0, result.stderr
