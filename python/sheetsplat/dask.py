"""Pictures drawn by many workers of Dask: parts that merge to the same bytes however the work was shared.

Only this module needs ``dask`` and ``distributed``.

>>> import sheetsplat.dask
>>> from distributed import Client
>>> client = Client("scheduler:8786")  # doctest: +SKIP
>>> future = sheetsplat.dask.render("/shared/head.nrrd", parts=64, preset="ct-bone")  # doctest: +SKIP
>>> future.result().save("head.png")  # doctest: +SKIP
"""

from __future__ import annotations

import math
import os
import threading
import uuid
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Unpack

import dask
from distributed import Client, Future, default_client, get_worker

from . import _words as words
from ._checks import finite, whole
from ._settings import Backend, Settings, completed
from .image import Image
from .part import Part, merge
from .scene import Scene
from .view import View, _check_single, _frames, _is_scene_file, _opened
from .volume import _BUILTIN, Volume

__all__ = ["orbit", "render"]


@completed
def render(
    source: Any,
    scene: Scene | Mapping[str, Any] | str | os.PathLike[str] | None = None,
    *,
    client: Client | None = None,
    parts: int | None = None,
    spacing: float | Sequence[float] | None = None,
    labels: Any = None,
    backend: Backend = "cpu",
    memory: int | str | None = None,
    index: str | os.PathLike[str] | None = None,
    light: str | os.PathLike[str] | None = None,
    **settings: Unpack[Settings],
) -> Future:
    """Draws a picture by the workers of a Dask cluster.

    Parameters
    ----------
    source : path, array or Scene
        What is drawn. Every worker reads a path itself, so it must mean the same file on all of them; an array is
        sent to them, and one of Dask is computed first. A scene, or the path of a scene file, names its volume.
    scene : Scene, mapping, str or path, optional
        How it is drawn, as for `View`.
    client : distributed.Client, optional
        The cluster. Without it, the client that was made last.
    parts : int, optional
        The number of parts of about equal work. Without it, two for each thread of the workers.
    spacing, labels, backend, **settings
        As for `View`.
    memory : int or str, optional
        Bytes that the values may take on each worker, such as ``"2GiB"``; without it, three quarters of a worker's limit.
        A volume that takes more is streamed: each part reads only the chunks that matter to it. State it if
        workers differ, because parts of a streamed volume do not merge with those of one in memory.
    index : str or path, optional
        The ranges of the values in the chunks of a volume that is streamed, as for `Volume`; every worker reads it.
    light : str or path, optional
        Light sheets of the same scene, as for `View`; every worker reads them.

    Returns
    -------
    distributed.Future
        Its result is an `Image`. ``distributed.progress(future)`` shows a bar, ``future.cancel()`` stops what has not
        begun. If a worker is lost, others draw its parts again.

    Notes
    -----
    Each part is a task, and neighbours merge in pairs on the workers, by a tree that follows the parts' numbers: the
    bytes are those of `merge` of the parts of `View.split`, whatever worker draws them. With
    ``splatting.opacity_threshold = 1`` they are the whole picture's to rounding.
    """
    client = client or default_client()
    what, look = _sent(client, source, spacing, labels, scene, settings, memory, index, light)
    count = _count(client, parts)
    start = _prepare(what, look, backend, False)
    return client.compute(_picture(what, start, 0.0, count, backend), retries=3)


@completed
def orbit(
    source: Any,
    scene: Scene | Mapping[str, Any] | str | os.PathLike[str] | None = None,
    *,
    client: Client | None = None,
    count: int = 120,
    turn: float = 360.0,
    frames: range | None = None,
    parts: int = 1,
    spacing: float | Sequence[float] | None = None,
    labels: Any = None,
    backend: Backend = "cpu",
    memory: int | str | None = None,
    index: str | os.PathLike[str] | None = None,
    light: str | os.PathLike[str] | None = None,
    **settings: Unpack[Settings],
) -> list[Future]:
    """Draws a turntable by the workers of a Dask cluster: a future for each picture.

    Parameters
    ----------
    source, scene, client, spacing, labels, backend, memory, index, light, **settings
        As for `render`.
    count, turn, frames
        As for `View.orbit`.
    parts : int
        The number of parts of each picture; 1 is best where there are more pictures than workers.

    Returns
    -------
    list of distributed.Future
        The pictures, as for `render`.
    """
    client = client or default_client()
    what, look = _sent(client, source, spacing, labels, scene, settings, memory, index, light)
    numbers, count_of_parts, turn = _frames(count, frames), _count(client, parts), finite("turn", turn)
    start = _prepare(what, look, backend, True)
    pictures = [_picture(what, start, turn / count * frame, count_of_parts, backend) for frame in numbers]
    futures: list[Future] = client.compute(pictures, retries=3)
    return futures


@dataclass(frozen=True)
class _Source:
    """What the workers draw: a path, a scene that names its volume, or an array that was sent to them."""

    token: str
    what: Any
    look: Scene
    spacing: float | Sequence[float] | None
    labels: Any
    memory: int | str | None
    index: str | os.PathLike[str] | None
    light: str | os.PathLike[str] | None

    def view(self, scene: Scene, backend: Backend) -> View:
        # Every worker opens it for the same scene, which decides the level.
        memory = _limit() if self.memory is None else self.memory
        volume = _opened(self.what, self.look, self.spacing, self.labels, memory, False, self.index)
        return View(volume, scene=scene, backend=backend, light=self.light)


def _limit() -> int | None:
    """The bytes of values that fit on a worker, if it has a limit."""
    limit = get_worker().memory_manager.memory_limit
    return None if limit is None else max(1, limit // 4 * 3)


def _sent(
    client: Client,
    source: Any,
    spacing: float | Sequence[float] | None,
    labels: Any,
    scene: Scene | Mapping[str, Any] | str | os.PathLike[str] | None,
    settings: Settings,
    memory: int | str | None,
    index: str | os.PathLike[str] | None,
    light: str | os.PathLike[str] | None,
) -> tuple[Any, Scene]:
    """The source as the workers get it, sent once to each that needs it, and the scene, which is checked here."""
    words.check_names(settings, words.ARGUMENTS)
    if isinstance(source, Volume):
        raise TypeError("a volume is not sent to other processes; give its path or its array")
    if isinstance(source, Scene) or _is_scene_file(source):
        _check_single(scene)
        look = source = Scene(source, **settings)
    else:
        look = Scene(scene, **settings)
        if isinstance(source, (str, os.PathLike)):
            path = os.fsdecode(source)
            source = path if path.startswith(_BUILTIN) or "://" in path else os.path.abspath(path)
    index, light = (None if path is None else os.path.abspath(path) for path in (index, light))
    token = uuid.uuid4().hex
    if dask.is_dask_collection(source) or dask.is_dask_collection(labels):
        # The cluster computes it before the parts: a part that computed it would wait for the workers that wait for it.
        return _task(_Source, "source")(token, source, look, spacing, labels, memory, index, light), look
    return client.scatter(_Source(token, source, look, spacing, labels, memory, index, light), hash=False), look


def _count(client: Client, parts: int | None) -> int:
    if parts is None:
        threads: dict[str, int] = client.nthreads()
        return max(1, 2 * sum(threads.values()))
    return whole("parts", parts, 1, 2**31 - 1)


def _prepare(what: Any, look: Scene, backend: Backend, all_around: bool) -> Any:
    return _task(_start, "start")(what, look, backend, all_around)


def _picture(what: Any, start: Any, degrees: float, count: int, backend: Backend) -> Any:
    """The tasks of a picture. `View.split` gives ⌊√count⌋ regions, whose slab ranges follow one another."""
    pieces = _task(_split, "split")(what, start, degrees, count, backend)
    regions = math.isqrt(count)
    ends = [count * at // regions for at in range(regions + 1)]
    merged = []
    for first, end in zip(ends, ends[1:], strict=False):
        drawn = [_task(_draw, "part")(what, pieces, number, backend) for number in range(first, end)]
        while len(drawn) > 1:
            pairs = [drawn[at : at + 2] for at in range(0, len(drawn), 2)]
            drawn = [_task(Part.join, "join")(pair) if len(pair) == 2 else pair[0] for pair in pairs]
        merged += drawn
    return _task(merge, "merge")(merged)


def _task(function: Any, name: str) -> Any:
    def call(*arguments: Any) -> Any:
        key = f"sheetsplat-{name}-{uuid.uuid4().hex}"
        return dask.delayed(function, pure=False)(*arguments, dask_key_name=key)

    return call


@dataclass
class _Kept:
    """A view that a worker keeps for the next parts of the same volume. One thread uses it at a time."""

    view: View | None = None
    lock: threading.Lock = field(default_factory=threading.Lock)


#: The views of the volumes that a worker used last, and how many it keeps.
_KEPT: OrderedDict[tuple[str, str], _Kept] = OrderedDict()
_MOST_KEPT = 2
_KEPT_LOCK = threading.Lock()


@contextmanager
def _view(what: _Source, look: Scene, backend: Backend) -> Iterator[View]:
    with _KEPT_LOCK:
        kept = _KEPT.setdefault((what.token, backend), _Kept())
        _KEPT.move_to_end((what.token, backend))
        while len(_KEPT) > _MOST_KEPT:
            _KEPT.popitem(last=False)
    with kept.lock:
        if kept.view is None:
            kept.view = what.view(look, backend)
        else:
            kept.view.scene = look
        yield kept.view


def _start(what: _Source, look: Scene, backend: Backend, all_around: bool) -> Scene:
    """The scene with everything stated that depends on the volume, so that all workers draw the same."""
    with _view(what, look, backend) as view:
        return look.explicit(view.volume, all_around=all_around)


def _split(what: _Source, start: Scene, degrees: float, count: int, backend: Backend) -> tuple[Scene, list[dict[str, Any]]]:
    look = start.turned(degrees) if degrees != 0 else start
    with _view(what, look, backend) as view:
        return look, view.split(count)


def _draw(what: _Source, pieces: tuple[Scene, list[dict[str, Any]]], number: int, backend: Backend) -> Part:
    look, windows = pieces
    with _view(what, look, backend) as view:
        return view.part(**windows[number])
