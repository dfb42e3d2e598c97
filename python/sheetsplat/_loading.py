"""A bar that shows how much of a volume has been read."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from . import _native as native

__all__ = ["loading"]

#: Seconds before a bar appears, and between its steps.
_DELAY, _STEP = 1.0, 0.1


@contextmanager
def loading(path: str | None, progress: bool) -> Iterator[native.BytesRead | None]:
    """Shows a bar while a volume is read with what this yields, if that takes long and tqdm is installed."""
    if not progress:
        yield None
        return
    read, done = native.BytesRead(), threading.Event()
    thread = threading.Thread(target=_show, args=(path, read, done), daemon=True)
    thread.start()
    try:
        yield read
    finally:
        done.set()
        thread.join()


def _show(path: str | None, read: native.BytesRead, done: threading.Event) -> None:
    if done.wait(_DELAY):
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return
    total = _size(path)
    with tqdm(total=total, desc=path, unit="B", unit_scale=True, leave=False) as bar:
        while True:
            is_done = done.wait(_STEP)
            # Headers may be read more than once.
            count = read.count if total is None else min(read.count, total)
            bar.update(count - bar.n)
            if is_done:
                return


def _size(path: str | None) -> int | None:
    """The bytes of a file; of a folder some may not be read."""
    if path is None or not os.path.isfile(path):
        return None
    return os.path.getsize(path)
