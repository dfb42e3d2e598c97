"""Pictures as other libraries expect them: shapes, pixels, files and shows."""

import io
import pathlib
import sys
import types
import warnings

import numpy as np
import pytest

import sheetsplat
from sheetsplat import Image, ImageError

HEAD = "builtin:head:16"


def test_shape_pixels_and_equality() -> None:
    image = sheetsplat.render(HEAD, size=(30, 20))
    assert image.shape == np.asarray(image).shape == (20, 30, 4)
    np.testing.assert_array_equal(image[5], np.asarray(image)[5])
    np.testing.assert_array_equal(image[2:4, ..., :3], np.asarray(image)[2:4, ..., :3])
    assert image[10, 15].shape == (4,) and image[10, 15, 3] == 1
    with pytest.raises(IndexError):
        image[20]
    same = sheetsplat.render(HEAD, size=(30, 20))
    assert image == same and not image != same
    assert image != sheetsplat.render(HEAD, size=(20, 30)) and image != sheetsplat.render(HEAD, size=(30, 20), azimuth=9)
    assert image != 5 and (image == np.asarray(image)).all()
    with pytest.raises(TypeError):
        hash(image)


@pytest.mark.parametrize("background", ["white", [0.2, 0.4, 0.6, 0.5]])
def test_files_of_pillow(background: object, tmp_path: pathlib.Path) -> None:
    pil = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    image = sheetsplat.render(HEAD, size=(30, 20), background=background)  # type: ignore[arg-type]
    for name in ("a.tif", "b.TIFF", "c.webp"):
        image.save(tmp_path / name)
        with pil.open(tmp_path / name) as found:
            pixels = np.asarray(found.convert("RGBA"))
        np.testing.assert_array_equal(pixels, image.to_uint8(), err_msg=name)
    if background == "white":
        image.save(tmp_path / "d.jpg")
        with pil.open(tmp_path / "d.jpg") as found:
            assert found.format == "JPEG" and found.size == (30, 20)
            assert np.abs(np.asarray(found).astype(int) - image.to_uint8()[..., :3]).max() < 24
        sheetsplat.orbit(HEAD, tmp_path / "turn-#.jpg", count=2, size=16, background="white")
        assert (tmp_path / "turn-1.jpg").exists()
    else:
        with pytest.raises(ImageError, match="alpha of 12[78] of 255, allowed: opaque pixels"):
            image.save(tmp_path / "d.jpg")
        assert not (tmp_path / "d.jpg").exists()
    with pytest.raises(sheetsplat.SceneError, match=r"depth: found 16, allowed: 8 bits per channel in \.webp"):
        image.save(tmp_path / "c.webp", depth=16)
    with pytest.raises(sheetsplat.FileError):
        image.save(tmp_path / "none" / "a.tif")


def test_no_input_is_written(tmp_path: pathlib.Path) -> None:
    pil = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    first, *others = (pil.fromarray(slice) for slice in np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    first.save(tmp_path / "stack.tif", save_all=True, append_images=others)
    before = (tmp_path / "stack.tif").read_bytes()
    picture = sheetsplat.render(tmp_path / "stack.tif", size=16)
    with pytest.raises(sheetsplat.VolumeError):
        picture.save(tmp_path / "stack.tif")
    assert (tmp_path / "stack.tif").read_bytes() == before


def test_home(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    np.save(tmp_path / "values.npy", np.arange(60.0).reshape(3, 4, 5))
    picture = sheetsplat.render("~/values.npy", size=16)
    picture.save("~/picture.png")
    assert sheetsplat.compare(Image.open("~/picture.png"), picture).passes
    sheetsplat.Scene(view="iso").save(tmp_path / "look.toml")
    assert sheetsplat.Scene("~/look.toml") == sheetsplat.Scene(tmp_path / "look.toml")
    sheetsplat.orbit(pathlib.Path("~/values.npy"), "~/turn-#.png", count=1, size=8)
    assert (tmp_path / "turn-0.png").exists()


def test_matplotlib_shows_the_picture() -> None:
    """An opaque picture as it is; one with a transparent background by its straight pixels."""
    matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    matplotlib.use("agg")
    from matplotlib import pyplot

    def drawn(pixels: object) -> np.ndarray:
        figure = pyplot.figure(figsize=(0.3, 0.2), dpi=100)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.imshow(pixels, aspect="auto", interpolation="nearest")
        figure.canvas.draw()
        found = np.asarray(figure.canvas.buffer_rgba()).copy()
        pyplot.close(figure)
        return found

    opaque = sheetsplat.render(HEAD, size=(30, 20), view="iso")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_allclose(drawn(opaque)[..., :3].astype(int), opaque.to_uint8()[..., :3], atol=1)
    clear = sheetsplat.render(HEAD, size=(30, 20), view="iso", background="transparent")
    over_white = np.asarray(sheetsplat.render(HEAD, size=(30, 20), view="iso", background="white"))[..., :3] * 255
    np.testing.assert_allclose(drawn(clear.to_uint8())[..., :3].astype(int), over_white, atol=3)


def test_show(monkeypatch: pytest.MonkeyPatch) -> None:
    pil = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    image = Image(np.full((4, 6, 3), 200, np.uint8))
    shown: list[object] = []
    monkeypatch.setattr(pil.Image, "show", lambda picture: shown.append(picture.size))
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    image.show()
    assert shown == [(6, 4)]
    # As in a notebook.
    shell = types.SimpleNamespace(kernel=object())
    display = types.ModuleType("IPython.display")
    display.display = shown.append  # type: ignore[attr-defined]
    notebook = types.ModuleType("IPython")
    notebook.get_ipython = lambda: shell  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    image.show()
    assert shown == [(6, 4), image]


def test_to_pil() -> None:
    pil = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    image = sheetsplat.render(HEAD, size=(30, 20), background=[0, 0, 1, 0.25])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture = image.to_pil()
    assert picture.mode == "RGBA" and picture.size == (30, 20)
    np.testing.assert_array_equal(np.asarray(pil.open(io.BytesIO(image._repr_png_()))), np.asarray(picture))
