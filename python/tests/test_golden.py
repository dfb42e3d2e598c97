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
    assert left == ["head-actual.png", "head-difference.png", "head-golden.png", "head-report.txt"]
    text = page.read_text()
    for name in left[:3]:
        assert f'src="test_it/{name}"' in text
    run(pytester).assert_outcomes(passed=2)
    assert not page.exists() and not (page.parent / "test_it" / "head-actual.png").exists()


def test_lax_settings_are_refused(golden, tmp_path: pathlib.Path) -> None:  # type: ignore[no-untyped-def]
    import numpy as np

    import sheetsplat

    picture = np.zeros((4, 4, 3))
    for name, lax in (("a", {"per_channel": 17}), ("a", {"outliers": 0.02}), ("../a", {}), ("all", {})):
        with pytest.raises(sheetsplat.GoldenError):
            golden(picture, name, **lax)
