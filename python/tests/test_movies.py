"""Movies, and the bar that shows how far they are."""

import pathlib
import sys
import types
from typing import Any

import numpy as np
import pytest

import sheetsplat

SMALL = {"width": 32, "height": 32}
HEAD = "builtin:head:24"


@pytest.mark.parametrize("name", ["turn.gif", "turn.apng", "turn.webp"])
def test_movies(tmp_path: pathlib.Path, name: str) -> None:
    pil = pytest.importorskip("PIL.Image")
    if name.endswith(".webp") and not pytest.importorskip("PIL.features").check("webp"):
        pytest.skip("this Pillow writes no WebP")
    sheetsplat.orbit(HEAD, tmp_path / name, count=3, fps=25, image=SMALL)
    pictures = list(sheetsplat.orbit(HEAD, count=3, image=SMALL) or [])
    with pil.open(tmp_path / name) as movie:
        assert movie.n_frames == 3 and movie.size == (32, 32)
        for frame, picture in enumerate(pictures):
            movie.seek(frame)
            shown = np.asarray(movie.convert("RGB"), float)
            assert movie.info["duration"] == 40
            # A GIF has 256 colours; WebP is lossy.
            error = np.abs(shown - picture.to_uint8()[..., :3]).mean()
            assert error < (0.01 if name.endswith(".apng") else 8), error


class Bar:
    """What tqdm does with an iterator."""

    shown: "list[Bar]" = []

    def __init__(self, pictures: Any, **arguments: Any) -> None:
        self.pictures, self.arguments, self.count = pictures, arguments, 0
        self.shown.append(self)

    def __iter__(self) -> Any:
        for picture in self.pictures:
            self.count += 1
            yield picture


@pytest.fixture
def bars(monkeypatch: pytest.MonkeyPatch) -> list[Bar]:
    """The bars that are shown, where tqdm is installed."""
    module = types.ModuleType("tqdm.auto")
    module.tqdm = Bar  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "tqdm", types.ModuleType("tqdm"))
    monkeypatch.setitem(sys.modules, "tqdm.auto", module)
    monkeypatch.setattr(Bar, "shown", [])
    return Bar.shown


@pytest.mark.parametrize("output", ["turn.gif", "f-%02d.png"])
def test_a_bar_counts_pictures(tmp_path: pathlib.Path, bars: list[Bar], output: str) -> None:
    pytest.importorskip("PIL.Image")
    sheetsplat.orbit(HEAD, tmp_path / output, count=6, frames=range(1, 5), image=SMALL)
    (bar,) = bars
    assert (bar.count, bar.arguments["total"], bar.arguments["unit"]) == (4, 4, "picture")
    sheetsplat.orbit(HEAD, tmp_path / output, count=2, image=SMALL, progress=False)
    # An iterator of pictures leaves the bar to its caller.
    assert len(list(sheetsplat.orbit(HEAD, count=2, image=SMALL) or [])) == 2
    assert len(bars) == 1


@pytest.mark.parametrize("output", ["turn.gif", "f-%02d.png"])
def test_tqdm_itself(tmp_path: pathlib.Path, capsys: pytest.CaptureFixture[str], output: str) -> None:
    pytest.importorskip("tqdm", reason="tqdm is not installed")
    pytest.importorskip("PIL.Image")
    sheetsplat.orbit(HEAD, tmp_path / output, count=3, image=SMALL)
    assert "/3" in capsys.readouterr().err


@pytest.mark.parametrize("output", ["turn.gif", "f-%02d.png"])
def test_without_tqdm(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], output: str
) -> None:
    pytest.importorskip("PIL.Image")
    for name in ("tqdm", "tqdm.auto"):
        monkeypatch.setitem(sys.modules, name, None)
    sheetsplat.orbit(HEAD, tmp_path / output, count=3, image=SMALL)
    assert len(list(tmp_path.iterdir())) == (1 if output.endswith(".gif") else 3)
    assert capsys.readouterr().err == ""


def test_pillow_is_asked_for_before_anything_is_drawn(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    monkeypatch.setattr(sheetsplat.View, "render", lambda view: pytest.fail("a picture was drawn"))
    with pytest.raises(ImportError):
        sheetsplat.orbit(HEAD, tmp_path / "a.gif", count=2, image=SMALL)
