"""What type checkers see of the installed package: `mypy --strict python/tests/typed.py`. Nothing runs it."""

from collections.abc import Iterator
from typing import Any, assert_type

import numpy as np
from numpy.typing import NDArray

import sheetsplat
from sheetsplat import Comparison, Image, Part, Scene, View, Volume


def use(values: NDArray[np.int16]) -> None:
    volume = Volume(values, spacing=(2, 1, 1), memory="1GiB")
    assert_type(volume.shape, tuple[int, int, int])
    assert_type(volume.values, NDArray[np.float32])
    scene = Scene(camera={"up": [0, 0, 1]})
    view = View(volume, scene=scene, backend="cpu")
    assert_type(view.render(), Image)
    assert_type(view.part(slabs=(0, 1)), Part)
    assert_type(view.split(4), list[dict[str, Any]])
    assert_type(view.orbit(count=3), Iterator[Image])
    assert_type(sheetsplat.render(values).to_uint8(), NDArray[np.uint8])
    assert_type(sheetsplat.compare(values, values), Comparison)
    assert_type(sheetsplat.orbit(values), Iterator[Image])
    sheetsplat.orbit(values, "turn.gif", fps=10, cmap="hot")
    settings: dict[str, Any] = {"camera.up": [0, 0, 1]}
    Scene(preset="mip", size=(8, 8), view="iso", camera={"fov_y": 30, "projection": "perspective"}, **settings)
    small = {"width": 8, "height": 8}
    sheetsplat.render(values, image=small, clim=(0, 1), opacity=[0, 0.5], backend="cpu", background=[0, 0, 0, 1])
    view.set(zoom=2, azimuth=30, clim=None)
    assert_type(sheetsplat.info("head.nrrd", spacing=2), dict[str, Any])
    assert_type(volume.unit, str | None)
    issubclass(sheetsplat.SheetsplatWarning, UserWarning)
    try:
        scene.save("scene.toml")
    except sheetsplat.FileError as error:
        assert_type(error.errno, int | None)
    except sheetsplat.SceneError as error:
        assert_type(error.key, str | None)
    # Each of these is an error, which `--strict` reports if it is none.
    View(volume, backend=5)  # type: ignore[arg-type]
    view.render().save("a.png", depth="8")  # type: ignore[arg-type]
    Scene(previw="mip")  # type: ignore[call-arg]
    Scene(preset="ct-bones")  # type: ignore[arg-type]
    view.render(view="font")  # type: ignore[arg-type]
    sheetsplat.render(values, opacity="sigmod")  # type: ignore[arg-type]
    sheetsplat.orbit(values, clim=3)  # type: ignore[call-overload]
    number: int = sheetsplat.orbit(values, "turn.gif")  # type: ignore[assignment]
    view.camera = scene  # type: ignore[attr-defined]
    Volume()  # type: ignore[call-arg]
    sheetsplat.rendre(values)  # type: ignore[attr-defined]
