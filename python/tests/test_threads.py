"""Pictures drawn by several threads at once."""

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

import sheetsplat

HEAD = "builtin:head:48"
LARGE = {"width": 320, "height": 240}
THREADS = 8


def directions(count: int) -> list[tuple[float, float, float]]:
    return [(float(np.sin(angle)), float(np.cos(angle)), 0.25) for angle in np.linspace(0, 3, count)]


def at_once(work: Callable[[int], None]) -> None:
    """Has threads do something with their numbers, which all begin at the same moment; an error of one is raised."""
    barrier, raised = threading.Barrier(THREADS), []

    def run(number: int) -> None:
        try:
            barrier.wait(timeout=60)
            work(number)
        except BaseException as error:
            raised.append(error)

    threads = [threading.Thread(target=run, args=(number,)) for number in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if raised:
        raise raised[0]


def data(image: sheetsplat.Image) -> bytes:
    return np.asarray(image).tobytes()


@pytest.mark.parametrize("classification", ["before", "after"])
def test_threads_draw_the_same_bytes(classification: str) -> None:
    """Each thread has its own view; pictures take long enough for all of them to be drawn at once."""
    values = sheetsplat.Volume(HEAD).values
    look = {"image": LARGE, "splatting": {"classification": classification}}
    expected = data(sheetsplat.render(values, **look))
    found: list[bytes] = [b""] * THREADS
    drawing, most = [0], [0]
    lock = threading.Lock()

    def draw(number: int) -> None:
        with lock:
            drawing[0] += 1
            most[0] = max(most[0], drawing[0])
        found[number] = data(sheetsplat.render(values, **look))
        with lock:
            drawing[0] -= 1

    at_once(draw)
    assert found == [expected] * THREADS
    assert most[0] > 1, "no two threads were in a render at once"


def test_threads_share_a_volume() -> None:
    volume = sheetsplat.Volume(HEAD)
    expected = [data(sheetsplat.render(volume, image=LARGE, camera={"direction": at})) for at in directions(THREADS)]
    found: list[bytes] = [b""] * THREADS

    def draw(number: int) -> None:
        found[number] = data(sheetsplat.render(volume, image=LARGE, camera={"direction": directions(THREADS)[number]}))

    at_once(draw)
    assert found == expected and len(set(expected)) == THREADS


def test_threads_share_a_view() -> None:
    """They take turns. One that changes the view changes it for all, so that each picture is of one of the scenes and never of two."""
    view = sheetsplat.View(HEAD, image=LARGE)
    whole = data(view.render())
    found: list[list[bytes]] = [[] for _ in range(THREADS)]

    def draw(number: int) -> None:
        found[number] = [data(view.render()) for _ in range(3)]

    at_once(draw)
    assert found == [[whole] * 3] * THREADS

    places = directions(THREADS)
    expected = {data(sheetsplat.render(view.volume, image=LARGE, camera={"direction": place})) for place in places}
    assert len(expected) == THREADS

    def change(number: int) -> None:
        found[number] = [data(view.render(camera={"direction": places[number]})) for _ in range(3)]

    at_once(change)
    assert {picture for pictures in found for picture in pictures} <= expected


def test_arrays_that_change_meanwhile_are_harmless() -> None:
    values = np.asarray(sheetsplat.Volume(HEAD).values)
    stop = threading.Event()

    def change() -> None:
        while not stop.is_set():
            np.copyto(values, values[::-1])

    thread = threading.Thread(target=change)
    thread.start()
    try:
        for _ in range(10):
            image = np.asarray(sheetsplat.render(values, image={"width": 48, "height": 32}))
            assert np.isfinite(image).all()
    finally:
        stop.set()
        thread.join()


def test_the_lock_is_released_while_drawing() -> None:
    """Another thread goes on while one draws; with the lock it could only run between two pictures."""
    view = sheetsplat.View(HEAD, image={"width": 512, "height": 512})
    pauses: list[float] = []
    stop = threading.Event()

    def tick() -> None:
        last = time.perf_counter()
        while not stop.is_set():
            time.sleep(0.001)
            now = time.perf_counter()
            pauses.append(now - last)
            last = now

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    while time.perf_counter() - start < 1.0:
        began = time.perf_counter()
        view.render()
        took = time.perf_counter() - began
    stop.set()
    thread.join()
    assert len(pauses) > 20, f"{len(pauses)} steps of another thread in a second, a picture took {took:.3f} s"
