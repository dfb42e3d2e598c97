"""The pytest plugin."""

import pathlib

import pytest

pytest_plugins = ["pytester"]

TEST = """
import numpy as np
import sheetsplat

def test_picture(golden):
    golden(sheetsplat.render("builtin:head:16", image={"width": 24, "height": 24}%s), "head")

def test_array(golden):
    golden(np.full((8, 8, 3), %s, np.uint8), "grey", per_channel=2)
"""


@pytest.fixture(autouse=True)
def no_blessing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SHEETSPLAT_BLESS", raising=False)


def text_has_controls(text: str) -> bool:
    """Whether a page has a zoom, and a slider between the golden and what was found."""
    return all(part in text for part in ('<select><option value="1">', '<input type="range"', '<div class="both"><img class="golden"'))


def run(pytester: pytest.Pytester, change: str = "", grey: int = 100) -> pytest.RunResult:
    pytester.makepyfile(test_it=TEST % (change, grey))
    return pytester.runpytest_subprocess("-p", "no:cacheprovider")


def test_goldens(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    result = run(pytester)
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines(["*head.png does not exist*", "*SHEETSPLAT_BLESS=head makes*"])
    monkeypatch.setenv("SHEETSPLAT_BLESS", "grey")
    run(pytester).assert_outcomes(passed=1, failed=1)
    monkeypatch.setenv("SHEETSPLAT_BLESS", "all")
    run(pytester).assert_outcomes(passed=2)
    monkeypatch.delenv("SHEETSPLAT_BLESS")
    run(pytester).assert_outcomes(passed=2)
    page = pytester.path / "golden-failures" / "index.html"
    assert (pytester.path / "goldens" / "head.png").exists() and not page.exists()
    # The native backend allows no difference; the array may differ by 2.
    result = run(pytester, ', shading={"ambient": 0.21}', 102)
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["*of 24×24 pixels*differ by more than 0 of 255*", "golden images that failed: *index.html"])
    left = sorted(path.name for path in (pytester.path / "golden-failures" / "test_it").iterdir())
    assert text_has_controls(page.read_text())
    assert left == ["head-actual.png", "head-difference.png", "head-golden.png", "head-report.txt"]
    text = page.read_text()
    for name in left[:3]:
        assert f'src="test_it/{name}"' in text
    # To list the tests compares nothing.
    pytester.runpytest_subprocess("-p", "no:cacheprovider", "--collect-only")
    assert page.read_text() == text
    run(pytester).assert_outcomes(passed=2)
    assert not page.exists() and not (page.parent / "test_it" / "head-actual.png").exists()


def test_a_failure_names_the_line(pytester: pytest.Pytester) -> None:
    pytester.makeconftest("""
def check(golden, picture):
    golden(picture, "helped")
""")
    pytester.makepyfile(test_it=TEST % ("", 100) + """
def test_by_a_helper(golden):
    from conftest import check
    picture = np.zeros((2, 2, 3))
    check(golden, picture)
""")
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.stdout.fnmatch_lines(["test_it.py:5: *head.png does not exist*", "test_it.py:8: *grey*", "test_it.py:13: *helped*"])
    text = (pytester.path / "golden-failures" / "index.html").read_text()
    assert all(f"<p>test_it.py:{line}</p>" in text for line in (5, 8, 13))


def test_options(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    pytester.makepyfile(test_it=TEST % ("", 100))
    options = ("-p", "no:cacheprovider", "--golden-report", "out/all.html")
    result = pytester.runpytest_subprocess(*options, "--golden-bless", "-k", "array")
    result.assert_outcomes(passed=1, deselected=1)
    result.stdout.fnmatch_lines(["golden images that were compared: *all.html"])
    assert (pytester.path / "goldens" / "grey.png").exists() and not (pytester.path / "goldens" / "head.png").exists()
    pytester.runpytest_subprocess(*options, "--golden-bless").assert_outcomes(passed=2)
    page = pytester.path / "out" / "all.html"
    text = page.read_text()
    assert "0 of 2 golden images failed" in text and "head blessed" in text and "grey passed" in text
    pytester.makepyfile(test_it=TEST % ("", 103))
    pytester.runpytest_subprocess(*options).assert_outcomes(passed=1, failed=1)
    # One file, with the pictures inside: the golden twice and what was found twice, to be laid over one another, and the difference.
    text = page.read_text()
    assert text.count('src="data:image/png;base64,') == text.count("<img ") == 6
    assert "1 of 2 golden images failed" in text and "grey failed" in text and "test_it.py:8" in text
    assert text.index("grey failed") < text.index("head passed")
    monkeypatch.setenv("SHEETSPLAT_BLESS", "head")
    result = pytester.runpytest_subprocess(*options, "--golden-bless")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--golden-bless: found SHEETSPLAT_BLESS=head beside it*"])


def test_lax_settings_are_refused(golden, tmp_path: pathlib.Path) -> None:  # type: ignore[no-untyped-def]
    import numpy as np

    import sheetsplat

    picture = np.zeros((4, 4, 3))
    for name, lax in (("a", {"per_channel": 17}), ("a", {"outliers": 0.02}), ("../a", {}), ("all", {})):
        with pytest.raises(sheetsplat.GoldenError):
            golden(picture, name, **lax)


PASSING = """
import numpy as np
import pytest
import sheetsplat

RANDOM = np.random.default_rng(5)
COLOR = RANDOM.integers(0, 256, (6, 9, 3), dtype=np.uint8)
STRAIGHT = np.dstack([COLOR, RANDOM.integers(0, 256, (6, 9), dtype=np.uint8)])
UNIT = STRAIGHT.astype(np.float64) / 255
PREMULTIPLIED = np.dstack([UNIT[..., :3] * UNIT[..., 3:], UNIT[..., 3]])
SPREAD = np.zeros((12, 27, 3), np.uint8)
SPREAD[::2, ::3] = COLOR

FORMS = {
    "color": [
        COLOR,
        COLOR.astype(np.int64),
        COLOR.tolist(),
        COLOR.astype(np.uint16) * 257,
        COLOR / 255,
        (COLOR / 255).astype(np.float32),
        np.dstack([COLOR, np.full((6, 9), 255, np.uint8)]),
        SPREAD[::2, ::3],
        np.ascontiguousarray(COLOR[::-1, ::-1])[::-1, ::-1],
        np.asfortranarray(COLOR),
        COLOR.astype(">u2") * 257,
        sheetsplat.Image(COLOR),
    ],
    "alpha": [STRAIGHT, STRAIGHT.astype(np.uint16) * 257, PREMULTIPLIED, PREMULTIPLIED.astype(np.float32), np.asfortranarray(STRAIGHT)],
}

@pytest.mark.parametrize("name, form", [(name, form) for name, forms in FORMS.items() for form in range(len(forms))])
def test_form(golden, name, form):
    golden(FORMS[name][form], name, per_channel=0)

def test_others(golden):
    changed = COLOR.copy()
    changed[3, 4, 1] ^= 4
    with pytest.raises(pytest.fail.Exception, match="1 of 9×6 pixels"):
        golden(changed, "color", per_channel=3)
    golden(changed, "color", per_channel=4)
    with pytest.raises(sheetsplat.ImageError, match="int64 from .* to 256"):
        golden(np.where(COLOR == COLOR.max(), 256, COLOR.astype(np.int64)), "color")
    with pytest.raises(pytest.fail.Exception, match="9×6"):
        golden(COLOR[:5], "color")
"""


def test_every_form_of_a_picture_passes(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays of any type, of three and four channels, and with any strides are the same picture."""
    pytester.makepyfile(test_it=PASSING)
    monkeypatch.setenv("SHEETSPLAT_BLESS", "all")
    pytester.runpytest_subprocess("-p", "no:cacheprovider", "-k", "form and 0").assert_outcomes(passed=3)
    monkeypatch.delenv("SHEETSPLAT_BLESS")
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=18)


MANY = """
import numpy as np
import pytest

@pytest.mark.parametrize("number", range(6))
def test_picture(golden, number):
    golden(np.full((8, 8, 3), number, np.uint8), f"grey{number}", per_channel=0)
"""


def test_failures_of_many_processes_are_on_one_page(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("xdist", reason="pytest-xdist is not installed")
    pytester.makepyfile(test_it=MANY)
    monkeypatch.setenv("SHEETSPLAT_BLESS", "grey0,grey3")
    page = pytester.path / "golden-failures" / "index.html"
    # The processes that ran these tests stay out of it.
    for name in ("PYTEST_XDIST_WORKER", "PYTEST_XDIST_WORKER_COUNT"):
        monkeypatch.delenv(name, raising=False)
    for _ in range(2):
        result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-n", "2")
        result.assert_outcomes(passed=2, failed=4)
        result.stdout.fnmatch_lines(["*golden images that failed: *index.html"])
        text = page.read_text()
        for number in range(6):
            assert (f"test_picture[{number}]: grey{number}" in text) == (number not in (0, 3)), number
            assert (f'src="test_it/grey{number}-actual.png"' in text) == (number not in (0, 3)), number
    monkeypatch.setenv("SHEETSPLAT_BLESS", "all")
    pytester.runpytest_subprocess("-p", "no:cacheprovider", "-n", "2").assert_outcomes(passed=6)
    assert not page.exists()
