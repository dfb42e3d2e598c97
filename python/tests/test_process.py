"""What a process needs and keeps: libraries, memory, a clean exit."""

import gc
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
    assert resident_kib() - before < 5 * 1024
