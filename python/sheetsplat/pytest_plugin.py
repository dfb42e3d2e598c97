"""A pytest plugin: pictures are compared with golden images.

The fixture `golden` compares a picture with ``goldens/NAME.png`` in the folder of the test's file, by the rules of the
Rust macro ``assert_golden!``::

    def test_head(golden):
        golden(sheetsplat.render("builtin:head:48"), "head")

``SHEETSPLAT_BLESS=all pytest``, or the names of goldens separated by commas, makes a picture the golden if it fails or
has no golden yet. The files of a failure lie under ``--golden-output``, with a page ``index.html`` of all of them, whether
one process ran the tests or the workers of pytest-xdist did.
"""

from __future__ import annotations

import html
import os
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import pytest

#: What a worker of pytest-xdist sends its controller at its end, by this name.
_SENT = "sheetsplat_golden_failures"


class _Failure(NamedTuple):
    """A golden that failed; texts alone, so that it can be sent to another process."""

    name: str
    test: str
    golden: str
    left_in: str
    report: str


_FAILURES = pytest.StashKey["list[_Failure]"]()


class Golden:
    """Compares pictures with the goldens beside a test.

    Call it with a picture and the golden's name.
    """

    def __init__(self, folder: Path, output: Path, test: str, failures: list[_Failure]) -> None:
        self._folder, self._output, self._test, self._failures = folder, output, test, failures

    def __call__(
        self,
        image: Any,
        name: str,
        *,
        per_channel: int | None = None,
        outliers: float = 0.0,
    ) -> None:
        """Compares a picture with the golden ``goldens/NAME.png``.

        Parameters
        ----------
        image : Image or array
            An `Image`, or any array of height × width × 3 or 4 that `Image` takes: floating-point numbers, ``uint16``,
            and other integers from 0 to 255, with any strides.
        name : str
            The golden's name.
        per_channel : int, optional
            The steps of 255 by which a channel may differ, at most 16. Without it, pictures of the native backend
            must equal goldens of the native backend, and others may differ by 3.
        outliers : float
            The fraction of pixels that may differ by more, at most 0.01.

        Raises
        ------
        GoldenError
            If the name is none of a file, the tolerance would allow visible differences, or ``SHEETSPLAT_BLESS`` is
            invalid.
        ImageError
            If something is no picture.
        """
        __tracebackhide__ = True
        from . import _native
        from .comparison import _tolerance
        from .image import Image

        picture = Image(image)
        is_default = per_channel is None and outliers == 0.0
        tolerance = None if is_default else _tolerance(3 if per_channel is None else per_channel, outliers)
        blessed, report = _native.check_golden(
            name, self._folder, self._output, picture._array, picture._made_on, tolerance
        )
        if blessed:
            print(f"blessed {self._folder / name}.png")
        if report is not None:
            golden = self._folder / f"{name}.png"
            self._failures.append(_Failure(name, self._test, str(golden), str(self._output), report))
            pytest.fail(report, pytrace=False)


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("sheetsplat")
    group.addoption(
        "--golden-output",
        metavar="DIR",
        default="golden-failures",
        help="folder for the pictures and reports of golden images that failed, below the root folder",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_FAILURES] = []


def _output(config: pytest.Config) -> Path:
    return config.rootpath / str(config.getoption("--golden-output"))


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Golden:
    """Compares a picture with its golden: ``golden(image, "name")``."""
    path, root = request.path, request.config.rootpath
    place = path.relative_to(root) if path.is_relative_to(root) else Path(path.name)
    output = _output(request.config) / place.with_suffix("")
    return Golden(path.parent / "goldens", output, request.node.nodeid, request.config.stash[_FAILURES])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Takes over the failures of a worker of pytest-xdist. One that was killed sends none."""
    sent = getattr(node, "workeroutput", {}).get(_SENT, [])
    node.config.stash[_FAILURES] += [_Failure(*failure) for failure in sent]


def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    if config.option.collectonly:
        # Nothing was compared, so that the page of the last run still holds.
        return
    output, failures = _output(config), config.stash[_FAILURES]
    if hasattr(config, "workeroutput"):
        # The controller makes the page, which shows the failures of all workers.
        config.workeroutput[_SENT] = [tuple(failure) for failure in failures]
        return
    page = output / "index.html"
    if failures:
        output.mkdir(parents=True, exist_ok=True)
        page.write_text(_page(failures, output), encoding="utf-8")
    elif page.exists():
        page.unlink()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    if config.stash[_FAILURES]:
        terminalreporter.write_line(f"golden images that failed: {_output(config) / 'index.html'}")


def _page(failures: list[_Failure], output: Path) -> str:
    sections = "\n".join(_section(failure, output) for failure in failures)
    return f"""<!doctype html>
<meta charset="utf-8">
<title>Golden images that failed</title>
<style>
body {{ font: 14px sans-serif; margin: 2em; }}
figure {{ display: inline-block; margin: 0 1em 1em 0; }}
img {{ image-rendering: pixelated; max-width: 30vw; background: #888; }}
</style>
<h1>Golden images that failed</h1>
{sections}
"""


def _section(failure: _Failure, output: Path) -> str:
    left = Path(failure.left_in)
    # The page stays complete when the folder is copied elsewhere, for instance from a CI run.
    copy = left / f"{failure.name}-golden.png"
    if Path(failure.golden).exists():
        shutil.copyfile(failure.golden, copy)
    kinds = {"golden": copy, "actual": left / f"{failure.name}-actual.png", "difference": left / f"{failure.name}-difference.png"}
    figures = "\n".join(
        f'<figure><img src="{html.escape(os.path.relpath(path, output))}" alt="{kind}"><figcaption>{kind}</figcaption></figure>'
        for kind, path in kinds.items()
        if path.exists()
    )
    return f"<h2>{html.escape(failure.test)}: {html.escape(failure.name)}</h2>\n{figures}\n<pre>{html.escape(failure.report)}</pre>"
