"""A machine without a Vulkan loader: pictures are drawn, and they are those of the Rust macro's goldens."""

import os
import pathlib
import shutil
import sys

import pytest

pytest_plugins = ["pytester"]

#: The repository's goldens, which the Rust macro blessed.
GOLDENS = pathlib.Path(__file__).parents[2] / "tests" / "goldens"

#: As tests/goldens.rs draws them.
TEST = """
import ctypes

import numpy as np
import pytest
import sheetsplat
from sheetsplat import DeviceError

HEAD = {"camera": {"direction": [0.5, 0.85, -0.2], "height": 170.0, "fit": "volume"}}
SCENES = {
    "head": ("head:72", "before", {"image": {"width": 160, "height": 160}, **HEAD}),
    "after-head": ("head:64", "after", {"image": {"width": 112, "height": 112}, **HEAD}),
    "tomato-transparent-background": (
        "tomato:64",
        "before",
        {
            "image": {"width": 128, "height": 128, "background": [0, 0, 0, 0]},
            "camera": {"direction": [0.1, 1, -0.4], "height": 280.0, "fit": "volume"},
            "splatting": {"footprint": "sections", "radius": 1.4},
        },
    ),
}


def picture(name, **arguments):
    volume, classification, settings = SCENES[name]
    splatting = {"opacity_threshold": 0.999, "classification": classification, **settings.get("splatting", {})}
    return sheetsplat.render(f"builtin:{volume}", **{**settings, "splatting": splatting}, **arguments)


def test_there_is_no_loader():
    with pytest.raises(OSError):
        ctypes.CDLL("libvulkan.so.1")


@pytest.mark.parametrize("name", SCENES)
def test_goldens_of_the_rust_macro(golden, name):
    # Both were made by the native backend, so that nothing may differ.
    golden(picture(name), name)
    golden(picture(name), name, per_channel=0)


def test_arrays_draw_the_golden(golden):
    volume = sheetsplat.Volume("builtin:head:72")
    _, _, settings = SCENES["head"]
    # The builtin head is lit so by itself.
    shading = {"light": "upper-left", "ambient": 0.7, "diffuse": 0.45, "occlusion": 0.7, "shadow": 0.5}
    appearance = {"splatting": {"opacity_threshold": 0.999, "classification": "before"}, "shading": shading}
    for dtype in ("u1", ">f8"):
        values = volume.values.astype(dtype)
        golden(sheetsplat.render(values, spacing=volume.spacing, **appearance, **settings), "head")


def test_automatic_is_the_cpu(golden):
    view = sheetsplat.View("builtin:head:16", backend="auto", image={"width": 16, "height": 16})
    assert view.backend == "cpu" and view.render().stats["backend"] == "cpu"
    golden(picture("head", backend="auto"), "head")


def test_there_is_no_gpu():
    with pytest.raises(DeviceError) as caught:
        picture("head", backend="gpu")
    assert isinstance(caught.value, OSError) and str(caught.value)


def test_a_difference_is_found(golden):
    with pytest.raises(pytest.fail.Exception, match="differ by more than 0 of 255"):
        golden(picture("head", **{"shading.ambient": 0.204}), "head")
"""


@pytest.mark.skipif(not GOLDENS.exists(), reason="the repository's goldens are not there")
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems find loaders in other ways")
def test_without_a_vulkan_loader(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(GOLDENS, pytester.path / "goldens")
    libraries = pytester.mkdir("libraries")
    for name in ("libvulkan.so.1", "libvulkan.so"):
        # The system's loader is behind it, and never reached.
        (libraries / name).write_text("no library")
    monkeypatch.setenv("LD_LIBRARY_PATH", f"{libraries}:{os.environ.get('LD_LIBRARY_PATH', '')}".rstrip(":"))
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, "/nonexistent")
    monkeypatch.delenv("SHEETSPLAT_BLESS", raising=False)
    pytester.makepyfile(test_it=TEST)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.assert_outcomes(passed=8)
