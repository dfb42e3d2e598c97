"""Warnings reach `logging` and `warnings`, at the user's line, each once for a call."""

import logging
import pathlib
import shutil
import warnings
from collections.abc import Callable
from typing import Any

import nibabel
import numpy as np
import pytest

import sheetsplat
from sheetsplat import SheetsplatWarning, View, Volume

SMALL = {"width": 16, "height": 16}
VALUES = np.arange(60, dtype=np.float32).reshape(3, 4, 5)


def nrrd(folder: pathlib.Path, values: np.ndarray, name: str = "a.nrrd", **fields: str) -> pathlib.Path:
    """A file of float32 with some more fields."""
    sizes = " ".join(str(size) for size in reversed(values.shape))
    header = {"type": "float", "dimension": str(values.ndim), "sizes": sizes, "endian": "little", "encoding": "raw"} | fields
    text = "NRRD0005\n" + "".join(f"{key}: {value}\n" for key, value in header.items()) + "\n"
    path = folder / name
    path.write_bytes(text.encode() + values.astype("<f4").tobytes())
    return path


def holes(folder: pathlib.Path) -> Callable[[], Any]:
    values = VALUES.copy()
    values[0, 1, 2] = np.nan
    path = nrrd(folder, values)
    return lambda: Volume(path)


def holes_of_an_array(folder: pathlib.Path) -> Callable[[], Any]:
    values = VALUES.copy()
    values[0, 1, 2] = np.inf
    return lambda: sheetsplat.render(values, image=SMALL)


def times(folder: pathlib.Path) -> Callable[[], Any]:
    path = folder / "a.nii"
    nibabel.save(nibabel.Nifti1Image(np.stack([VALUES.T, VALUES.T], axis=3), np.eye(4)), path)
    return lambda: sheetsplat.info(path)


def sheared(folder: pathlib.Path) -> Callable[[], Any]:
    fields = {"space": "RAS", "space directions": "(1,0,0) (0.3,1,0) (0,0,1)", "space origin": "(0,0,0)"}
    path = nrrd(folder, VALUES, **{key.replace("_", " "): value for key, value in fields.items()})
    return lambda: View(path, image=SMALL)


def other_grid(folder: pathlib.Path) -> Callable[[], Any]:
    nrrd(folder, VALUES)
    nrrd(folder, VALUES[:, ::2], "b.nrrd", spacings="1 2 1")
    scene = folder / "scene.toml"
    scene.write_text('[[channel]]\n[channel.volume]\npath = "a.nrrd"\n[[channel]]\n[channel.volume]\npath = "b.nrrd"\n')
    return lambda: sheetsplat.render(scene, image=SMALL)


CASES = [
    (holes, "1 of 60 samples are NaN or infinite"),
    (holes_of_an_array, "1 of 60 samples are NaN or infinite"),
    (times, "2 times: the first is read"),
    (sheared, "sheared by 16.70°: resampled"),
    (other_grid, "resampled from"),
]


@pytest.mark.parametrize(("case", "message"), CASES, ids=[case.__name__ for case, _ in CASES])
def test_what_changes_the_picture_is_a_warning(
    case: Any, message: str, tmp_path: pathlib.Path, caplog: pytest.LogCaptureFixture
) -> None:
    draw = case(tmp_path)
    with warnings.catch_warnings(record=True) as caught, caplog.at_level(logging.WARNING, "sheetsplat"):
        warnings.simplefilter("always")
        draw()
        about = [warning for warning in caught if message in str(warning.message)]
        assert len(about) == 1, [str(warning.message) for warning in caught]
        assert about[0].category is SheetsplatWarning
        # At the line of whoever called the package.
        assert about[0].filename == __file__
        assert about[0].lineno == draw.__code__.co_firstlineno
        logged = [record for record in caplog.records if message in record.getMessage()]
        assert [(record.name, record.levelname) for record in logged] == [("sheetsplat", "WARNING")]
        draw()
        assert len([warning for warning in caught if message in str(warning.message)]) == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error", SheetsplatWarning)
        with pytest.raises(SheetsplatWarning):
            draw()


def test_each_call_gets_its_own_warnings(tmp_path: pathlib.Path) -> None:
    draw = holes(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sheetsplat.render(VALUES, image=SMALL)
        with pytest.warns(SheetsplatWarning):
            draw()
        sheetsplat.render(VALUES, image=SMALL)


def test_control_characters_of_files_are_escaped(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "a\x1b[31m.nii"
    nibabel.save(nibabel.Nifti1Image(np.stack([VALUES.T, VALUES.T], axis=3), np.eye(4)), path)
    with pytest.warns(SheetsplatWarning) as caught:
        Volume(path)
    assert all("\x1b" not in str(warning.message) for warning in caught)


def test_a_series_of_a_folder_is_chosen(tmp_path: pathlib.Path) -> None:
    fixtures = pathlib.Path(__file__).parents[2] / "tests" / "fixtures"
    for name in ("series/IM1", "series/IM2", "series/IM3.dcm", "jpeg2000-large.dcm"):
        shutil.copy(fixtures / name, tmp_path)
    with pytest.warns(SheetsplatWarning, match="2 series: 0: 3 of 5 × 4"):
        assert Volume(tmp_path).shape == (3, 4, 5)
    for series in (1, "1"):
        chosen = Volume(tmp_path, series=series)
        assert chosen.shape == (1, 50, 70)
        assert len(chosen.info()["series"]) == 2
    assert Volume(tmp_path, series="1.2.4").shape == (3, 4, 5)
    for wrong in (2, -1, "1.2"):
        with pytest.raises(sheetsplat.VolumeError, match="series"):
            Volume(tmp_path, series=wrong)
    with pytest.raises(sheetsplat.VolumeError, match="series"):
        Volume(VALUES, series=0)
