"""Arrays whose dims have names, masked arrays, and the units of images."""

import pathlib
import warnings
from typing import Any

import nibabel
import numpy as np
import pytest
import SimpleITK
import xarray

import sheetsplat
from sheetsplat import SheetsplatWarning, View, Volume, VolumeError

Z, Y, X = np.arange(2) * 2.5, np.arange(3) * 1.5 + 7, np.arange(4) * 0.5
VALUES = np.arange(24, dtype=np.int16).reshape(2, 3, 4)


def named(units: Any = None, **coords: Any) -> xarray.DataArray:
    """Values `[z, y, x]` with coordinates, in which some take the place of others."""
    attributes = {} if units is None else {"units": units}
    both = {"z": Z, "y": Y, "x": X} | coords
    return xarray.DataArray(VALUES, dims=("z", "y", "x"), coords={dim: (dim, at, attributes) for dim, at in both.items()})


def refused(key: str, source: Any, **arguments: Any) -> VolumeError:
    with pytest.raises(VolumeError) as caught:
        Volume(source, **arguments)
    assert caught.value.key == key, caught.value
    return caught.value


@pytest.mark.parametrize("order", ["zyx", "xyz", "yxz", "xzy"])
@pytest.mark.parametrize(
    "names",
    [
        {},
        {"z": "Z", "y": "Y", "x": "X"},
        {"z": "slice", "y": "row", "x": "col"},
        {"z": "plane", "y": "height", "x": "width"},
    ],
)
def test_dims_are_ordered_by_their_names(order: str, names: dict[str, str]) -> None:
    array = named().transpose(*order).rename(names)
    labels = (VALUES % 3).astype(np.uint8)
    for tags in (labels.transpose(["zyx".index(dim) for dim in order]), array % 3):
        volume = Volume(array, labels=tags)
        np.testing.assert_array_equal(volume.values, VALUES)
        assert volume.spacing == (2.5, 1.5, 0.5) and volume.unit is None
        look = {"image": {"width": 16, "height": 16}, "transfer": {"label": [{"label": 1, "opacity": [[0, 0.9]]}]}}
        expected = View(VALUES, spacing=(2.5, 1.5, 0.5), labels=labels, **look).render()
        np.testing.assert_array_equal(np.asarray(View(volume, **look).render()), np.asarray(expected))


def test_dims_without_names_keep_their_order() -> None:
    array = xarray.DataArray(VALUES)
    np.testing.assert_array_equal(Volume(array).values, VALUES)
    np.testing.assert_array_equal(Volume(xarray.concat([array, array], "dim_3"), channel_axis=0).values, VALUES)


def test_descending_coordinates_are_no_mirror_image() -> None:
    """Whatever way the coordinates run, a value is drawn where its coordinate is; so are labels."""
    array, tags = named(), (VALUES % 3).astype(np.uint8)
    for dims in ("z", "y", "x", "zx", "zyx"):
        flipped = array.isel({dim: slice(None, None, -1) for dim in dims})
        own = tags[tuple(slice(None, None, -1) if dim in dims else slice(None) for dim in "zyx")]
        volume = Volume(flipped.transpose("x", "y", "z"), labels=own.transpose())
        np.testing.assert_array_equal(volume.values, VALUES)
        assert volume.spacing == (2.5, 1.5, 0.5)
        look = {"image": {"width": 16, "height": 16}, "transfer": {"label": [{"label": 1, "opacity": [[0, 0.9]]}]}}
        expected = View(array, labels=tags, **look).render()
        np.testing.assert_array_equal(np.asarray(View(volume, **look).render()), np.asarray(expected))


def test_uneven_coordinates_are_refused() -> None:
    error = refused("y", named(y=[0.0, 1.0, 3.0]))
    assert "coordinates 1 apart at 0 and coordinates 2 apart at 1" in str(error) and "evenly spaced" in str(error)
    # The spacing that is stated goes before them, and their direction still counts.
    volume = Volume(named(y=[3.0, 1.0, 0.0]), spacing=(1, 2, 3))
    assert volume.spacing == (1, 2, 3)
    np.testing.assert_array_equal(volume.values, VALUES[:, ::-1])
    # As float32 they are even but for rounding.
    even = np.linspace(0, 1, 4, dtype=np.float32)
    assert Volume(named(x=even)).spacing[2] == pytest.approx(1 / 3)
    for y in ([0.0, 1.0, 0.5], [1.0, 1.0, 1.0], [0.0, np.nan, 2.0], [0.0, 1.0, np.inf]):
        assert "all ascend or all descend" in str(refused("y", named(y=y)))
        refused("y", named(y=y), spacing=1)
    assert "of type <U1" in str(refused("x", named(x=list("abcd"))))
    refused("z", named(z=np.array(["2020-01-01", "2020-01-02"], "datetime64[ns]")))


def test_dims_without_coordinates_have_numbers() -> None:
    array = named().drop_vars(["y", "x"])
    assert Volume(array).spacing == (2.5, 1, 1)
    # A single voxel has no distance; the next dim's is taken.
    assert Volume(named().isel(z=slice(1))).spacing == (0.5, 1.5, 0.5)


def test_unknown_dims_are_refused() -> None:
    assert "the dims z (depth, slice, plane), y" in str(refused("lat", named().rename({"y": "lat"})))
    assert "beside depth" in str(refused("z", named().expand_dims("depth")))
    assert "the dims y, x, without z" in str(refused("shape", named()[0]))
    assert "sample" in str(refused("sample", named().expand_dims("sample")))


def test_channels_and_times() -> None:
    array = named()
    stack = xarray.concat([array, array + 100], "c").transpose("x", "c", "y", "z")
    assert Volume(stack).channels == 2
    np.testing.assert_array_equal(Volume(stack).values_of(1), VALUES + 100)
    np.testing.assert_array_equal(Volume(stack, channel=1).values, VALUES + 100)
    assert Volume(stack, channel=1).channels == 1
    assert "0 to 1" in str(refused("channel", stack, channel=2))
    assert "the dims z, y, x" in str(refused("channel", array, channel=1))
    film = xarray.concat([stack, stack + 1000, stack + 2000], "time")
    with pytest.warns(SheetsplatWarning, match="time: 3 times: the first is drawn") as caught:
        volume = Volume(film)
    assert [warning.filename for warning in caught] == [__file__]
    np.testing.assert_array_equal(volume.values_of(1), VALUES + 100)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(Volume(film, time=2, channel=0).values, VALUES + 2000)
    assert "0 to 2" in str(refused("time", film, time=3))
    refused("time", array, time=1)
    refused("level", array, level=0)
    for key in ("channel", "time", "level"):
        assert "1 beside ndarray" in str(refused(key, VALUES, **{key: 1}))


def test_units_of_coordinates() -> None:
    for name, symbol in [("mm", "mm"), ("micrometer", "µm"), ("um", "µm"), ("nm", "nm"), ("pixel", None), (None, None)]:
        assert Volume(named(name)).unit == symbol, name
    array = named("mm")
    array.x.attrs["units"] = "um"
    assert "the unit mm, allowed: µm, as along x" in str(refused("z", array))
    assert Volume(array, spacing=1).unit is None
    array.x.attrs.clear()
    assert Volume(array).unit is None


def test_lazy_arrays_are_not_computed_before_they_fit() -> None:
    dask = pytest.importorskip("dask.array", reason="dask is not installed")
    large = xarray.DataArray(dask.zeros((3, 1000, 1000, 1000), chunks=100), dims=("t", "x", "y", "z"))
    refused("memory", large, memory="1GiB", time=1)
    small = xarray.DataArray(dask.from_array(VALUES, chunks=2), dims=("x", "y", "z"))
    np.testing.assert_array_equal(Volume(small).values, VALUES.transpose())


class Duck:
    """As much of a `DataArray` as is read."""

    def __init__(self, array: xarray.DataArray) -> None:
        self.dims, self.shape, self.dtype = array.dims, array.shape, array.dtype
        self.coords, self.array = array.coords, array

    def isel(self, places: Any) -> "Duck":
        return Duck(self.array.isel(places))

    def transpose(self, *dims: Any) -> "Duck":
        return Duck(self.array.transpose(*dims))

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        return self.array.values


def test_other_classes_with_dims() -> None:
    volume = Volume(Duck(named("mm").transpose("x", "y", "z")))
    np.testing.assert_array_equal(volume.values, VALUES)
    assert volume.spacing == (2.5, 1.5, 0.5) and volume.unit == "mm"


@pytest.mark.parametrize("dtype", ["i2", "u1", "f4", "f8", ">i4", "?"])
def test_masked_values_are_holes(dtype: str) -> None:
    mask = VALUES % 5 == 1
    array = np.ma.array(VALUES.astype(dtype), mask=mask)
    expected = np.where(mask, np.nan, VALUES.astype(dtype).astype(np.float32))
    with warnings.catch_warnings():
        # They are holes on purpose.
        warnings.simplefilter("error")
        volume = Volume(array)
        several = Volume(np.ma.stack([array, array]), channel_axis=0)
    np.testing.assert_array_equal(volume.values, expected)
    np.testing.assert_array_equal(several.values_of(1), expected)
    assert volume.holes == mask.sum()
    assert Volume(np.ma.array(VALUES.astype(dtype))).holes == 0


def test_masks_of_dask_and_of_labels() -> None:
    dask = pytest.importorskip("dask.array", reason="dask is not installed")
    array = np.ma.array(VALUES, mask=VALUES == 7)
    chunked = dask.from_array(array, chunks=2)
    assert Volume(chunked).holes == 1
    assert Volume(xarray.DataArray(chunked, dims=("z", "y", "x"))).holes == 1
    assert "1 masked ones" in str(refused("labels", VALUES, labels=array))
    assert Volume(VALUES, labels=np.ma.array(VALUES)).info()["labels"]
    refused("data", np.ma.masked_all((2, 3, 4)))


def test_images_state_millimetres(tmp_path: pathlib.Path) -> None:
    assert Volume(SimpleITK.GetImageFromArray(VALUES)).unit == "mm"
    image = nibabel.Nifti1Image(VALUES.T, np.diag([0.5, 1.5, 2.5, 1]))
    assert Volume(image).unit == "mm" and Volume(image).spacing == (2.5, 1.5, 0.5)
    image.header.set_xyzt_units("micron")
    assert Volume(image).unit == "µm"
    nibabel.save(image, tmp_path / "a.nii")
    assert Volume(tmp_path / "a.nii").unit == "µm"
    assert sheetsplat.info(image)["unit"] == "µm"
