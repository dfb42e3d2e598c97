"""Pictures from arrays."""

import io

import numpy as np
import pytest

import sheetsplat

SMALL = {"width": 48, "height": 32}


def ball(size: int = 16) -> np.ndarray:
    z, y, x = np.ogrid[-1 : 1 : size * 1j, -1 : 1 : size * 1j, -1 : 1 : size * 1j]
    return np.round(100 * np.clip(1.2 - x * x - 2 * y * y - 3 * z * z, 0, 1))


def pixels(volume: object, **arguments: object) -> bytes:
    return np.asarray(sheetsplat.render(volume, image=SMALL, **arguments)).tobytes()


def test_a_picture_is_an_array_without_a_copy() -> None:
    image = sheetsplat.render(ball(), spacing=(2, 1, 1), image=SMALL)
    array = np.asarray(image)
    assert array.shape == (32, 48, 4) and array.dtype == np.float32
    assert array is np.asarray(image), "no copy"
    assert np.array(image) is not array
    assert array[16, 24, :3].max() > 0.1 and array[0, 0].tolist() == [0, 0, 0, 1]
    assert image.stats["backend"] == "cpu" and image.stats["voxels_total"] == 16**3


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8", "g", ">i2", ">f8", "l", "q"])
def test_every_type_gives_the_same_picture(dtype: str) -> None:
    assert pixels(ball().astype(dtype)) == pixels(ball())


def test_booleans_are_numbers() -> None:
    assert pixels(ball() > 50) == pixels((ball() > 50).astype("u1"))


def test_strides_do_not_matter() -> None:
    expected = pixels(ball())
    fortran = np.asfortranarray(ball())
    assert not fortran.flags.c_contiguous
    spread = np.zeros((32, 48, 16))[::2, ::3]
    spread[...] = ball()
    backwards = np.ascontiguousarray(ball()[::-1, :, ::-1])[::-1, :, ::-1]
    unaligned = np.zeros(16**3 * 8 + 1, np.uint8)[1:].view("f8").reshape(16, 16, 16)
    unaligned[...] = ball()
    assert backwards.strides[0] < 0 and not unaligned.flags.aligned
    frozen = ball()
    frozen.flags.writeable = False
    for array in (fortran, spread, backwards, unaligned, frozen, ball().tolist()):
        assert pixels(array) == expected
    assert pixels(ball()[::-1]) != expected or (ball()[::-1] == ball()).all()


def test_the_axes_are_z_y_x() -> None:
    values = np.zeros((3, 4, 5))
    values[2, 1, 4] = 1
    volume = sheetsplat.Volume(values, spacing=(3, 2, 1))
    assert volume.shape == (3, 4, 5) and volume.spacing == (3, 2, 1)
    np.testing.assert_array_equal(volume.values, values)


def test_anything_with_array_is_an_array() -> None:
    class Lazy:
        def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
            return ball()

    assert pixels(Lazy()) == pixels(ball())


def test_holes_are_not_drawn() -> None:
    values = ball()
    values[:, :8] = np.nan
    values[0, 0, 0] = np.inf
    volume = sheetsplat.Volume(values)
    assert volume.holes == 16 * 8 * 16
    assert pixels(volume) != pixels(ball())
    with pytest.raises(sheetsplat.VolumeError, match="finite"):
        sheetsplat.Volume(np.full((2, 2, 2), np.nan))


@pytest.mark.parametrize(
    ("source", "field", "found"),
    [
        (np.zeros((2, 3)), "shape", "2 dimensions"),
        (np.zeros((2, 3, 4, 5, 6, 7)), "shape", "6 dimensions"),
        (np.float64(1), "shape", "0 dimensions"),
        (np.zeros((0, 3, 4)), "sizes", "0"),
        (np.full((2, 2, 2), None), "dtype", "object"),
        (np.full((2, 2, 2), "a"), "dtype", "<U1"),
        (np.zeros((2, 2, 2), complex), "dtype", "complex128"),
        (np.zeros((2, 2, 2), "m8[s]"), "dtype", "timedelta64"),
        (np.zeros((2, 2, 2), [("a", "f4")]), "dtype", "a"),
        (12, "source", "int"),
        (None, "source", "NoneType"),
        ([[1, 2], [3]], "array", "inhomogeneous"),
    ],
)
def test_what_is_no_volume_is_refused(source: object, field: str, found: str) -> None:
    with pytest.raises(sheetsplat.VolumeError) as caught:
        sheetsplat.render(source)
    assert caught.value.key == field and found in str(caught.value)
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, sheetsplat.SheetsplatError)


@pytest.mark.parametrize("spacing", [(1, 2), "wide", (1, 2, 0), (1, -1, 1), (1, float("nan"), 1), (1, 1, 1e6), (1, None, 1)])
def test_spacings_are_checked(spacing: object) -> None:
    with pytest.raises(sheetsplat.VolumeError) as caught:
        sheetsplat.Volume(ball(4), spacing=spacing)  # type: ignore[arg-type]
    assert caught.value.key is not None and caught.value.key.startswith("spacing")


def test_labels() -> None:
    labels = (ball() > 50).astype(np.int64)
    table = [
        {"label": 0, "visible": False},
        {"label": 1, "color": [[0, [1, 0, 0]]], "opacity": [[0, 0.9]]},
    ]
    red = np.asarray(sheetsplat.render(ball(), labels=labels, image=SMALL, transfer={"label": table}))
    assert red[16, 24, 0] > 2 * red[16, 24, 1]
    with pytest.raises(sheetsplat.VolumeError, match=r"labels\[0, 1, 2\]: found -1"):
        labels[0, 1, 2] = -1
        sheetsplat.Volume(ball(), labels=labels)
    with pytest.raises(sheetsplat.VolumeError, match="sizes"):
        sheetsplat.Volume(ball(), labels=labels[1:] * 0)


def test_the_volume_is_a_copy() -> None:
    values = ball()
    view = sheetsplat.View(values, image=SMALL)
    before = np.asarray(view.render()).tobytes()
    values[...] = 0
    assert np.asarray(view.render()).tobytes() == before


def test_files_of_pictures(tmp_path) -> None:  # type: ignore[no-untyped-def]
    image = sheetsplat.render(ball(), image={**SMALL, "background": [0.2, 0.4, 0.6, 0.5]})
    image.save(tmp_path / "a.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), np.asarray(image))
    image.save(str(tmp_path / "a.png"), metadata=False)
    assert (tmp_path / "a.png").read_bytes() == image._repr_png_()
    assert sheetsplat.compare(tmp_path / "a.png", image).max == (0, 0, 0, 0)
    again = sheetsplat.Image(image.to_uint8())
    assert sheetsplat.compare(again, image, per_channel=1).passes
    with pytest.raises(sheetsplat.ImageError, match=r"found \"\.bmp\", allowed: \.png.*\.webp"):
        image.save(tmp_path / "a.bmp")
    with pytest.raises(sheetsplat.FileError) as caught:
        image.save(tmp_path / "no" / "a.png")
    assert isinstance(caught.value, OSError) and caught.value.errno == 2
    assert "no/a.png" in str(caught.value.filename)


def test_to_uint8_is_the_png() -> None:
    pil = pytest.importorskip("PIL.Image")
    image = sheetsplat.render(ball(), image={**SMALL, "background": [0.2, 0.4, 0.6, 0.5]})
    png = np.asarray(pil.open(io.BytesIO(image._repr_png_())))
    np.testing.assert_array_equal(png, image.to_uint8())
    np.testing.assert_array_equal(np.asarray(image.to_pil()), png)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((4, 4)),
        np.zeros((4, 4, 2)),
        np.zeros((0, 4, 3)),
        np.full((4, 4, 3), 256),
        np.full((4, 4, 3), -1, "i1"),
        np.zeros((4, 4, 3), bool),
        np.zeros((4, 4, 3), complex),
        np.full((4, 4, 3), None),
        [[1, 2], [3]],
        None,
    ],
)
def test_what_is_no_picture_is_refused(array: object) -> None:
    with pytest.raises(sheetsplat.ImageError, match="image: found"):
        sheetsplat.Image(array)


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u4", "i8", ">i4"])
def test_integers_of_pictures(dtype: str) -> None:
    """Integers are straight channels from 0 to 255, but `uint16`, which has a range of its own."""
    picture = np.arange(4 * 5 * 4, dtype="u1").reshape(4, 5, 4)
    expected = np.asarray(sheetsplat.Image(picture))
    np.testing.assert_array_equal(sheetsplat.Image(picture.astype(dtype)), expected)
    np.testing.assert_array_equal(sheetsplat.Image(picture.tolist()), expected)
    np.testing.assert_allclose(sheetsplat.Image(picture.astype("u2") * 257), expected, rtol=1e-6)


def test_comparisons() -> None:
    one, other = np.zeros((4, 8, 3), np.uint8), np.zeros((4, 8, 3), np.uint8)
    other[1, 2] = (10, 0, 0)
    comparison = sheetsplat.compare(one, other)
    assert (comparison.passes, comparison.max, comparison.worst, comparison.outliers) == (False, (10, 0, 0, 0), (2, 1), 1)
    assert "1 of 8×4 pixels" in str(comparison)
    assert np.asarray(comparison.difference_image())[1, 2, 0] == 1
    assert sheetsplat.compare(one, other, per_channel=10).passes
    with pytest.raises(sheetsplat.GoldenError, match="tolerance per channel: found 40, allowed: a whole number from 0 to 16"):
        sheetsplat.compare(one, other, per_channel=40)
    with pytest.raises(sheetsplat.ImageError, match="8×4 pixels, the golden 8×3"):
        sheetsplat.compare(one, other[1:])
