"""Images of SimpleITK and nibabel themselves, against the files that they write."""

import pathlib
from typing import Any

import nibabel
import numpy as np
import pytest
import sheetsplat
import SimpleITK

SMALL = {"width": 48, "height": 40}


def voxels(dtype: Any) -> np.ndarray:
    """Voxels `[z, y, x]` that no symmetry maps to themselves."""
    z, y, x = np.meshgrid(np.arange(9), np.arange(8), np.arange(7), indexing="ij")
    return (10 * (x + y > 5) + 3 * z + x).astype(dtype)


def same(source: Any, path: pathlib.Path) -> None:
    """Asserts that an image and its file are the same volume, seen from the patient's front too."""
    ours, file = sheetsplat.Volume(source), sheetsplat.Volume(path)
    assert ours.shape == file.shape == (9, 8, 7)
    np.testing.assert_allclose(ours.spacing, file.spacing, rtol=1e-6)
    np.testing.assert_array_equal(ours.values, file.values)
    pictures = [sheetsplat.render(each, side="front", image=SMALL) for each in (ours, file)]
    np.testing.assert_allclose(*map(np.asarray, pictures), atol=1e-4)
    assert np.asarray(pictures[0]).max() > 0.1


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
def test_nibabel(tmp_path: pathlib.Path, dtype: Any) -> None:
    # x to the patient's left, y upwards, z to the front.
    affine = np.array([[-1.5, 0, 0, 4], [0, 0, 2.0, -3], [0, 0.75, 0, 5], [0, 0, 0, 1]])
    image = nibabel.Nifti1Image(voxels(dtype).T, affine)
    nibabel.save(image, tmp_path / "volume.nii.gz")
    same(image, tmp_path / "volume.nii.gz")
    same(nibabel.load(tmp_path / "volume.nii.gz"), tmp_path / "volume.nii.gz")


def test_nibabel_scales_values(tmp_path: pathlib.Path) -> None:
    image = nibabel.Nifti1Image(voxels(np.int16).T, np.diag([1.0, 1.0, 2.0, 1.0]))
    image.header.set_slope_inter(0.5, -3.0)
    nibabel.save(image, tmp_path / "volume.nii")
    loaded = nibabel.load(tmp_path / "volume.nii")
    same(loaded, tmp_path / "volume.nii")
    assert sheetsplat.Volume(loaded).values.min() == -3.0


@pytest.mark.parametrize("extension", ["nrrd", "mha", "nii"])
def test_simpleitk(tmp_path: pathlib.Path, extension: str) -> None:
    image = SimpleITK.GetImageFromArray(voxels(np.uint16))
    image.SetSpacing((0.5, 1.25, 2.0))
    image.SetOrigin((3.0, -2.0, 7.0))
    # x to the patient's back, y to the left, z downwards.
    image.SetDirection((0, 1, 0, 1, 0, 0, 0, 0, -1))
    path = tmp_path / f"volume.{extension}"
    SimpleITK.WriteImage(image, str(path))
    same(image, path)
    same(SimpleITK.ReadImage(str(path)), path)


def test_planes_are_refused() -> None:
    for image in (SimpleITK.Image(4, 5, SimpleITK.sitkUInt8), SimpleITK.Image([4, 5], SimpleITK.sitkVectorUInt8, 3)):
        with pytest.raises(sheetsplat.VolumeError, match="array: spacing: found .* of three dimensions"):
            sheetsplat.Volume(image)


def test_channels() -> None:
    """An axis of an array may be channels, which are drawn as one."""
    stack = np.random.default_rng(3).normal(size=(6, 2, 7, 8)).astype(np.float32)
    volume = sheetsplat.Volume(stack, spacing=(2, 1, 1), channel_axis=1)
    assert (volume.channels, volume.shape, volume.spacing) == (2, (6, 7, 8), (2.0, 1.0, 1.0))
    np.testing.assert_array_equal(volume.values_of(1), stack[:, 1])
    np.testing.assert_array_equal(volume.values, stack[:, 0])
    np.testing.assert_array_equal(sheetsplat.Volume(stack, channel_axis=-3).values_of(1), stack[:, 1])
    small = {"image": {"width": 32, "height": 32}}
    both = np.asarray(sheetsplat.render(volume, preset="confocal", **small))
    first = np.asarray(sheetsplat.render(stack[:, 0], spacing=(2, 1, 1), preset="confocal", **small))
    assert np.abs(both - first).max() > 0.05
    hidden = np.asarray(sheetsplat.render(volume, preset="confocal", **{"channel[1].visible": False}, **small))
    assert np.abs(hidden - both).max() > 0.05
    for source, axis in [(stack, 4), (stack[0], 0), (stack[:, :0], 1)]:
        with pytest.raises(sheetsplat.VolumeError, match="array: shape: found"):
            sheetsplat.Volume(source, channel_axis=axis)
    with pytest.raises(sheetsplat.VolumeError, match="channel: found 2, allowed: a whole number from 0 to 1"):
        volume.values_of(2)
