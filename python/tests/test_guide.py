"""Pages of the guide whose Python runs as it stands."""

import pathlib
import re
import warnings

import pytest

GUIDE = pathlib.Path(__file__).parents[2] / "docs" / "guide"


@pytest.mark.parametrize("page", ["python-words", "python-data"])
def test_page(page: str, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blocks of a page run one after another, in a folder of their own, without a warning."""
    monkeypatch.chdir(tmp_path)
    text = (GUIDE / f"{page}.md").read_text(encoding="utf-8")
    blocks = list(re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    assert len(blocks) >= 3
    names: dict[str, object] = {"__name__": "guide"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for block in blocks:
            # Errors name the page's own lines.
            before = text.count("\n", 0, block.start(1))
            exec(compile("\n" * before + block[1], str(GUIDE / f"{page}.md"), "exec"), names)
