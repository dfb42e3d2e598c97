"""Pages of one file, which turn a volume without a network."""

import gzip
import json
import pathlib
import re
import shutil
import subprocess
from typing import Any

import numpy as np
import pytest

import sheetsplat
from sheetsplat import View, Volume, _page

ROOT = pathlib.Path(__file__).parents[2]
SMALL = (40, 32)


def ball() -> np.ndarray:
    z, y, x = np.mgrid[-1:1:12j, -1:1:14j, -1:1:16j]
    return np.round(200 * np.exp(-3 * (x * x + 2 * y * y + 3 * z * z))).astype(np.uint8)


@pytest.fixture
def made(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with the page's files, of which nothing is looked at."""
    monkeypatch.setattr(_page, "FILES", tmp_path / "page.bin")
    (tmp_path / "page.bin").write_bytes(gzip.compress(b"\x02\0\0\0{}"))


def contents(path: pathlib.Path) -> dict[str, bytes]:
    """The volume and the scene in a page."""
    import base64

    packed = re.search(r'id="data">([^<]*)<', path.read_text())
    assert packed
    plain = gzip.decompress(base64.b64decode(packed[1]))
    begin = 4 + int.from_bytes(plain[:4], "little")
    return {name: plain[begin + first : begin + end] for name, (first, end) in json.loads(plain[4:begin]).items()}


@pytest.mark.parametrize("kind", ["values", "labels", "channels", "colors", "patient", "floats"])
def test_the_volume_and_the_scene_are_in_the_page(kind: str, made: None, tmp_path: pathlib.Path) -> None:
    """A page's scene and volume are drawn as the view draws them when its camera turns."""
    source: Any = {
        "values": ball(),
        "labels": ball(),
        "channels": np.stack([ball(), ball()[::-1] // 2]),
        "colors": np.stack([ball(), 255 - ball(), ball() // 2], axis=3),
        "patient": type("Nifti", (), {"affine": np.diag([-1.0, 2.0, 3.0, 1.0]), "dataobj": ball().T}),
        "floats": ball() / 7,
    }[kind]
    labels = (ball() > 60) * 100_000 if kind == "labels" else None
    look: Any = {"transfer": {"label": [{"label": 100_000, "color": [[0, "tomato"]]}]}} if kind == "labels" else {}
    spacing = None if kind == "patient" else (3, 2, 1)
    view = View(source() if kind == "patient" else source, labels=labels, spacing=spacing, size=SMALL, azimuth=20, **look)
    view.to_html(tmp_path / "page.html")
    files = contents(tmp_path / "page.html")
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    assert set(files) == {"scene.toml", "volume.nrrd"} | ({"labels.nrrd"} if labels is not None else set())
    named = {"volume.path": str(tmp_path / "volume.nrrd")}
    if labels is not None:
        named["volume.labels"] = str(tmp_path / "labels.nrrd")
    scene = sheetsplat.Scene(tmp_path / "scene.toml")
    again = sheetsplat.render(sheetsplat.Scene(files["scene.toml"].decode(), **named))  # type: ignore[arg-type]
    expected = next(view.orbit(count=1))
    assert again == expected, sheetsplat.compare(again, expected)
    assert not scene.names_volume and np.asarray(expected)[..., :3].max() > 0.1


def test_errors(made: None, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    view = View(ball(), size=SMALL)
    with pytest.raises(sheetsplat.FileError):
        view.to_html(tmp_path / "none" / "page.html")
    monkeypatch.setattr(_page, "_MOST_VOXELS", 100)
    with pytest.raises(sheetsplat.VolumeError, match="volume: found 12×14×16 voxels of 1 channels, allowed: at most 100"):
        view.to_html(tmp_path / "page.html")
    monkeypatch.setattr(_page, "FILES", tmp_path / "missing.bin")
    with pytest.raises(sheetsplat.FileError, match="npm run build") as caught:
        view.to_html(tmp_path / "page.html")
    assert caught.value.filename == str(tmp_path / "missing.bin") and not (tmp_path / "page.html").exists()


def test_a_browser_turns_the_page(tmp_path: pathlib.Path) -> None:
    if not _page.FILES.exists():
        pytest.skip("this package was made without the page's files")
    if shutil.which("node") is None or not (ROOT / "web" / "node_modules" / "playwright-core").exists():
        pytest.skip("the web package's tests are not set up")
    page = tmp_path / "page.html"
    View(Volume(ball(), labels=ball() > 60), cmap="magma", view="iso").to_html(page)
    # The library, the scripts, the volume and a picture.
    assert page.stat().st_size < 1_300_000
    command = ["node", str(ROOT / "web" / "tests" / "open_page.mjs"), str(page)]
    done = json.loads(subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout)
    assert (done["state"], done["problem"], done["faults"], done["isStill"]) == ("drawn", "", [], False)
    assert done["hasTurned"]
    assert all(request.startswith(("file:", "blob:", "data:")) for request in done["requests"]), done["requests"]
