"""The GPU and the f64 evaluation, against the native backend. A GPU may be software, such as Mesa's lavapipe."""

import json
import pathlib
from typing import Any

import numpy as np
import pytest

import sheetsplat
from sheetsplat import DeviceError, RenderError, View

HEAD = "builtin:head:48"
LOOK: dict[str, Any] = {
    "image": {"width": 96, "height": 80},
    "camera": {"direction": [0.5, 0.8, -0.3]},
    "splatting": {"opacity_threshold": 0.999},
}


@pytest.fixture(scope="module")
def gpu() -> str:
    """The backend `gpu`, where there is an adapter."""
    try:
        View("builtin:cube:4", backend="gpu", image={"width": 8, "height": 8}).render()
    except DeviceError as error:
        pytest.skip(f"there is no GPU: {error}")
    return "gpu"


def psnr(image: sheetsplat.Image, other: sheetsplat.Image) -> float:
    """In dB, of 8-bit pictures."""
    return sheetsplat.compare(image, other).psnr_db


@pytest.mark.parametrize("classification", ["before", "after"])
def test_the_gpu_draws_what_the_cpu_draws(gpu: str, classification: str) -> None:
    look = {**LOOK, "splatting": {**LOOK["splatting"], "classification": classification}}
    ours, theirs = sheetsplat.render(HEAD, **look), sheetsplat.render(HEAD, backend=gpu, **look)
    assert (ours.stats["backend"], theirs.stats["backend"]) == ("cpu", "gpu") and theirs.stats["adapter"]
    assert psnr(theirs, ours) > 45
    assert np.asarray(ours)[..., :3].max() > 0.3


def test_views_on_the_gpu(gpu: str) -> None:
    view = View(sheetsplat.Volume(HEAD).values, backend=gpu, **LOOK)
    assert view.backend == "gpu"
    for direction in ([1, 0, 0], [0, 0.6, -0.8]):
        theirs = view.render(camera={"direction": direction})
        assert psnr(theirs, sheetsplat.render(view.volume, scene=view.scene)) > 45
    pictures = list(view.orbit(count=3))
    assert len({np.asarray(picture).tobytes() for picture in pictures}) == 3
    pieces = [{"region": (0, 0, 96, 40)}, {"region": (0, 40, 96, 40)}]
    merged = sheetsplat.merge([view.part(**piece) for piece in pieces])
    assert np.abs(np.asarray(merged) - np.asarray(view.render())).max() < 2e-3


def test_the_reference_draws_what_the_cpu_draws() -> None:
    look = {**LOOK, "image": {"width": 48, "height": 40}, "splatting": {"opacity_threshold": 1}}
    ours = sheetsplat.render("builtin:head:20", **look)
    exact = sheetsplat.render("builtin:head:20", backend="reference", **look)
    assert exact.stats["backend"] == "reference"
    # Floats, not 8-bit numbers: SPEC §12 asks for 80 dB before splatting, 60 after.
    error = np.sqrt(np.mean((np.asarray(ours, float) - np.asarray(exact, float)) ** 2))
    assert -20 * np.log10(error) > 60


def test_automatic_is_a_backend_that_draws() -> None:
    """A GPU if there is one that is no software driver, and else the CPU."""
    view = View(HEAD, backend="auto", **LOOK)
    assert view.backend in ("cpu", "gpu")
    image = view.render()
    assert image.stats["backend"] == view.backend
    assert psnr(image, sheetsplat.render(HEAD, **LOOK)) > 45


def test_automatic_is_the_gpu_where_one_is_named(gpu: str) -> None:
    adapter = View(HEAD, backend=gpu, **LOOK).render().stats["adapter"]
    assert View(HEAD, backend="auto", adapter=adapter, **LOOK).backend == "gpu"


def test_a_limit_of_the_gpu(gpu: str) -> None:
    with pytest.raises((RenderError, sheetsplat.SceneError), match="image") as caught:
        sheetsplat.render("builtin:cube:4", backend=gpu, image={"width": 32768, "height": 32768})
    assert isinstance(caught.value, RenderError), caught.value
    assert isinstance(caught.value, ValueError)


def test_goldens_know_where_they_were_made(gpu: str, golden: Any, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture of the GPU is no golden of the native backend's kind: between two adapters, rounding is allowed."""
    theirs, ours = sheetsplat.render(HEAD, backend=gpu, **LOOK), sheetsplat.render(HEAD, **LOOK)
    assert theirs._made_on is not None and ours._made_on is not None and theirs._made_on != ours._made_on
    monkeypatch.setattr(golden, "_folder", tmp_path)
    monkeypatch.setattr(golden, "_output", tmp_path / "failures")
    monkeypatch.setenv("SHEETSPLAT_BLESS", "all")
    golden(theirs, "gpu")
    golden(ours, "cpu")
    monkeypatch.delenv("SHEETSPLAT_BLESS")
    assert sheetsplat.Image.open(tmp_path / "gpu.png")._made_on == theirs._made_on
    golden(theirs, "gpu")
    golden(theirs, "cpu")
    golden(ours, "gpu")
    # The golden's own backend must draw every byte again.
    changed = np.array(ours)
    changed[0, 0, :3] = 2 / 255
    near = sheetsplat.Image._of(changed, {}, ours._made_on)
    with pytest.raises(pytest.fail.Exception, match="differ by more than 0 of 255"):
        golden(near, "cpu")
    assert (tmp_path / "failures" / "cpu-report.txt").read_text()
    # A picture from elsewhere may round differently.
    golden(changed, "cpu")
    assert json.dumps(near.stats) == "{}"
    golden._compared.clear()
