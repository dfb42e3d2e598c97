"""A pytest plugin: pictures are compared with golden images.

The fixture `golden` compares a picture with ``goldens/NAME.png`` in the folder of the test's file, by the rules of the
Rust macro ``assert_golden!``::

    def test_head(golden):
        golden(sheetsplat.render("builtin:head:48"), "head")

``pytest --golden-bless`` makes a picture the golden if it fails or has no golden yet, in all tests that run; so does
``SHEETSPLAT_BLESS=all``, and with names of goldens separated by commas only these. The files of a failure lie under
``--golden-output``, with a page ``index.html`` of all of them, whether one process ran the tests or the workers of
pytest-xdist did. ``--golden-report FILE`` writes one page of all comparisons with the pictures inside.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import pytest

from ._golden_page import Compared, page

#: The name by which a worker of pytest-xdist sends its comparisons to its controller, at its end.
_SENT = "sheetsplat_goldens"

#: The variable that names the goldens to bless.
_BLESS = "SHEETSPLAT_BLESS"

_COMPARED = pytest.StashKey["list[Compared]"]()


class Golden:
    """Compares pictures with the goldens beside a test.

    Call it with a picture and the golden's name.
    """

    def __init__(self, file: Path, shown: str, output: Path, test: str, compared: list[Compared]) -> None:
        self._file, self._shown, self._output, self._test, self._compared = file, shown, output, test, compared
        self._folder = file.parent / "goldens"

    def _place(self) -> str:
        """The line of the test's file that compares now, or the file if a helper elsewhere does so without it."""
        frame = sys._getframe(2)
        while frame.f_back is not None and frame.f_code.co_filename != str(self._file):
            frame = frame.f_back
        is_found = frame.f_code.co_filename == str(self._file)
        return f"{self._shown}:{frame.f_lineno}" if is_found else self._shown

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
        place, golden = self._place(), str(self._folder / f"{name}.png")
        one = Compared(name, self._test, place, golden, str(self._output), report or "", blessed)
        self._compared.append(one)
        if report is not None:
            pytest.fail(f"{place}: {report}", pytrace=False)


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("sheetsplat")
    group.addoption(
        "--golden-output",
        metavar="DIR",
        default="golden-failures",
        help="folder for the pictures and reports of golden images that failed, below the root folder",
    )
    group.addoption(
        "--golden-bless",
        action="store_true",
        help=f"make each picture the golden that fails or has none yet, as {_BLESS}=all does",
    )
    group.addoption(
        "--golden-report",
        metavar="FILE",
        help="write one page with all pictures that were compared inside it, below the root folder",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_COMPARED] = []
    if not config.getoption("--golden-bless"):
        return
    named = os.environ.get(_BLESS)
    if named not in (None, "", "all"):
        raise pytest.UsageError(f"--golden-bless: found {_BLESS}={named} beside it, allowed: one of the two")
    # The library reads it, also in the workers of pytest-xdist, which inherit it.
    os.environ[_BLESS] = "all"

    def restore() -> None:
        if named is None:
            os.environ.pop(_BLESS, None)
        else:
            os.environ[_BLESS] = named

    config.add_cleanup(restore)


def _output(config: pytest.Config) -> Path:
    return config.rootpath / str(config.getoption("--golden-output"))


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Golden:
    """Compares a picture with its golden: ``golden(image, "name")``."""
    path, root = request.path, request.config.rootpath
    place = path.relative_to(root) if path.is_relative_to(root) else Path(path.name)
    output = _output(request.config) / place.with_suffix("")
    return Golden(path, str(place), output, request.node.nodeid, request.config.stash[_COMPARED])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Takes over the comparisons of a worker of pytest-xdist. One that was killed sends none."""
    sent = getattr(node, "workeroutput", {}).get(_SENT, [])
    node.config.stash[_COMPARED] += [Compared(*one) for one in sent]


def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    if config.option.collectonly:
        # Nothing was compared, so that the page of the last run still holds.
        return
    output, compared = _output(config), config.stash[_COMPARED]
    if hasattr(config, "workeroutput"):
        # The controller makes the page, which shows the comparisons of all workers.
        config.workeroutput[_SENT] = [tuple(one) for one in compared]
        return
    index = output / "index.html"
    failures = [one for one in compared if one.report]
    if failures:
        _write(index, page(failures, output, is_whole=False))
    elif index.exists():
        index.unlink()
    report = _report(config)
    if report is not None:
        _write(report, page(compared, report.parent, is_whole=True))


def _report(config: pytest.Config) -> Path | None:
    named = config.getoption("--golden-report")
    return None if named is None else config.rootpath / str(named)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    report = _report(config)
    if report is not None:
        terminalreporter.write_line(f"golden images that were compared: {report}")
    if any(one.report for one in config.stash[_COMPARED]):
        terminalreporter.write_line(f"golden images that failed: {_output(config) / 'index.html'}")
