"""Ctrl-C raises `KeyboardInterrupt` at once, whatever is at work, and leaves nothing half-written."""

import os
import pathlib
import subprocess
import sys

import pytest

import sheetsplat

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be sent Ctrl-C there")

#: Sends Ctrl-C while something is at work that would take much longer than the time that is allowed here, which a busy machine keeps, too.
SCRIPT = """
import os, signal, sys, threading, time
import sheetsplat

# Processes that a shell starts in the background ignore Ctrl-C, and so do their children.
signal.signal(signal.SIGINT, signal.default_int_handler)

def interrupted(work, after=0.3):
    sent = []
    def send():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)
    threading.Timer(after, send).start()
    try:
        work()
    except KeyboardInterrupt:
        took = time.monotonic() - sent[0]
        print(f"{took:.3f} s", flush=True)
        assert took < 5, took
    else:
        sys.exit("not interrupted")

def image(side):
    return {"width": side, "height": side}

"""


def run(code: str, folder: pathlib.Path) -> str:
    command = [sys.executable, "-X", "faulthandler", "-c", SCRIPT + code]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=folder)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.parametrize("classification", ["before", "after"])
@pytest.mark.parametrize(("backend", "side"), [("cpu", 6144), ("reference", 700)])
def test_drawing(backend: str, side: int, classification: str, tmp_path: pathlib.Path) -> None:
    """A view of the native backend, which stops, draws as ever afterwards."""
    code = f"""
look = {{"splatting": {{"classification": {classification!r}}}}}
view = sheetsplat.View("builtin:head:64", backend={backend!r}, image=image({side}), **look)
interrupted(view.render)
interrupted(view.part)
if view.backend == "cpu":
    import numpy as np
    expected = sheetsplat.render("builtin:head:64", image=image(32), **look)
    assert (np.asarray(view.render(image=image(32))) == np.asarray(expected)).all()
"""
    run(code, tmp_path)


def test_drawing_by_the_gpu(tmp_path: pathlib.Path) -> None:
    """Whatever it does then, from opening the device on; the process ends cleanly."""
    probe = "sheetsplat.render('builtin:cube:4', backend='gpu', image=image(8))"
    found = subprocess.run([sys.executable, "-c", SCRIPT + probe], capture_output=True, text=True, timeout=300)
    if "DeviceError" in found.stderr:
        pytest.skip("there is no GPU")
    draw = 'lambda: sheetsplat.render("builtin:head:64", backend="gpu", image=image(1500))'
    for after in (0.1, 1.0):
        run(f"interrupted({draw}, {after})", tmp_path)


def test_the_first_picture_of_a_path(tmp_path: pathlib.Path) -> None:
    """NumPy is prepared for it, by Python code that Ctrl-C must not end."""
    begin = 'assert "numpy" not in sys.modules\n'
    run(begin + 'interrupted(lambda: sheetsplat.render("builtin:head:64", image=image(6144)))', tmp_path)
    # About when a small one is complete.
    for after in (0.005, 0.01, 0.02, 0.04):
        draw = 'lambda: (sheetsplat.render("builtin:head:16", image=image(64)), time.sleep(10))'
        run(f"{begin}interrupted({draw}, {after})", tmp_path)


def test_reading(tmp_path: pathlib.Path) -> None:
    run('interrupted(lambda: sheetsplat.Volume("builtin:head:400"))', tmp_path)


@pytest.mark.parametrize("rest", ["", "time.sleep(8)"])
def test_pictures_that_are_saved(rest: str, tmp_path: pathlib.Path) -> None:
    """Neither a part of a file, nor the whole file later, nor a temporary one. A machine may be so fast that the picture was there before."""
    code = """
import numpy as np
picture = sheetsplat.Image(np.random.default_rng(1).random((2048, 2048, 4), np.float32))
interrupted(lambda: picture.save("a.png", depth=16), 0.1)
print(os.path.exists("a.png"))
"""
    was_there = run(code + rest, tmp_path).endswith("True\n")
    assert os.listdir(tmp_path) == ["a.png"] * was_there
    if was_there:
        assert sheetsplat.Image.open(tmp_path / "a.png").width == 2048


def test_turntables(tmp_path: pathlib.Path) -> None:
    pytest.importorskip("PIL.Image")
    arguments = 'count=100000, turn=360, image=image(64), progress=False'
    run(f'interrupted(lambda: sheetsplat.orbit("builtin:head:32", "a.gif", {arguments}), 1.0)', tmp_path)
    assert os.listdir(tmp_path) == []
    code = f"""
interrupted(lambda: sheetsplat.orbit("builtin:head:32", "%d.png", {arguments}), 1.0)
for name in os.listdir():
    sheetsplat.Image.open(name)
"""
    run(code, tmp_path)
    assert all(name.endswith(".png") for name in os.listdir(tmp_path))


def test_changes_of_a_scene(tmp_path: pathlib.Path) -> None:
    """A change that was interrupted, here while another thread draws, does not come later."""
    code = """
import numpy as np
view = sheetsplat.View("builtin:head:32", image=image(32))
before, scene = np.asarray(view.render()).copy(), view.scene
view.scene = scene.replace(image=image(1500))
thread = threading.Thread(target=view.render)
thread.start()
time.sleep(0.1)
interrupted(lambda: view.set(preset="mip"), 0.1)
assert view.scene == scene.replace(image=image(1500))
thread.join()
time.sleep(0.5)
assert view.render().width == 1500
view.scene = scene
assert (np.asarray(view.render()) == before).all()
"""
    run(code, tmp_path)
