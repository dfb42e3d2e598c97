#!/usr/bin/env python3
"""Times scenes by turns with our backends and VTK's ray casters, and prints a table of medians.

    cargo build --release
    python3 benches/peers/by_turns.py SCENE.toml… --vtk-python venv/bin/python --backends cpu gpu --mappers cpu

Each round runs every program once on every scene, so that a change in the machine's speed meets all of them; vtk_bench.py says how VTK is installed.
Scenes are drawn with `exponential` compositing, which is what ray casters compute. `--record FILE` appends one line of JSON for every median, with the keys that
history.md describes.
"""

import argparse
import datetime
import json
import pathlib
import platform
import statistics
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--sheetsplat", type=pathlib.Path, default=HERE.parent.parent / "target/release/sheetsplat")
    parser.add_argument("--backends", nargs="*", default=["cpu", "gpu"])
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="another setting for our backends")
    parser.add_argument("--vtk-python", help="a Python with VTK; without it only our backends are timed")
    parser.add_argument("--mappers", nargs="*", default=["cpu", "gpu"])
    parser.add_argument("--frames", type=int, default=7)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--machine", default=f"{platform.machine()}, {platform.processor() or platform.system()}")
    parser.add_argument("--record", type=pathlib.Path, metavar="FILE")
    return parser.parse_args()


def commands(options):
    """What is timed: a name, and the command for a scene. Each prints one line of JSON with median_frame_ms."""
    for backend in options.backends:
        settings = [word for setting in ["splatting.compositing=exponential", *options.set] for word in ("--set", setting)]
        yield f"sheetsplat {backend}", lambda scene, backend=backend, settings=settings: [
            str(options.sheetsplat), "bench", str(scene), "--frames", str(options.frames), "--rotate", "1", "--backend", backend, *settings]  # fmt: skip
    if options.vtk_python:
        for mapper in options.mappers:
            yield f"VTK {mapper}", lambda scene, mapper=mapper: [
                options.vtk_python, str(HERE / "vtk_bench.py"), str(scene), "--mapper", mapper, "--frames", str(options.frames), "--rotate", "1"]  # fmt: skip


def timed(command):
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if run.returncode != 0:
        sys.exit(f"by_turns.py: {' '.join(command)}: exit code {run.returncode}")
    return json.loads(run.stdout.splitlines()[-1])["median_frame_ms"]


def main():
    options = arguments()
    programs = list(commands(options))
    times = {}
    for _ in range(options.rounds):
        for scene in options.scenes:
            for name, command in programs:
                times.setdefault((scene.stem, name), []).append(timed(command(scene)))
    medians = {key: statistics.median(values) for key, values in times.items()}
    print("| scene |", " | ".join(f"{name}, ms" for name, _ in programs), "|")
    print("|---" * (len(programs) + 1) + "|")
    for scene in options.scenes:
        print(f"| {scene.stem} |", " | ".join(f"{medians[scene.stem, name]:.0f}" for name, _ in programs), "|")
    if options.record:
        commit = subprocess.run(["git", "-C", HERE, "rev-parse", "--short=10", "HEAD"], stdout=subprocess.PIPE, text=True, check=True)
        with open(options.record, "a", encoding="utf-8") as file:
            for (scene, program), value in medians.items():
                line = {
                    "date": datetime.date.today().isoformat(),
                    "commit": commit.stdout.strip(),
                    "machine": options.machine,
                    "scene": scene,
                    "program": program,
                    "settings": options.set,
                    "quantity": "median_frame_ms",
                    "value": round(value, 2),
                }
                file.write(json.dumps(line, ensure_ascii=False) + "\n")


main()
