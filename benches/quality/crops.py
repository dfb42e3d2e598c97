#!/usr/bin/env python3
"""Makes the pictures of docs/sharp.md: crops of measured volumes by classification before and after splatting, and by VTK's GPU ray caster.

    cargo build --release
    python3 benches/fetch.py
    venv/bin/python benches/quality/crops.py --sheetsplat target/release/sheetsplat

The Python needs VTK and Pillow (benches/peers/vtk_bench.py says how they are installed); fetch.py gets the scenes and volumes.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile

from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[2]

# A scene, and the part of its picture that is shown: left, top, right, bottom, in pixels.
PARTS = {"ct-head-semi": (150, 150, 300, 310), "mr-head-opaque": (225, 335, 385, 445)}

SMOOTH = ["splatting.compositing=exponential", "splatting.classification=after"]
EXACT = [*SMOOTH, "splatting.interpolation=exact", "splatting.falloff=1", "shading.gradient=kernel"]

# The name of each picture, with our settings or VTK's sample distance.
PICTURES = {
    "before": ["splatting.compositing=exponential", "splatting.classification=before"],
    "after": SMOOTH,
    "after-half": [*SMOOTH, "splatting.slab_width=0.5"],
    "exact-half": [*EXACT, "splatting.slab_width=0.5"],
    "vtk": "1",
    "vtk-half": "0.5",
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sheetsplat", default=ROOT / "target/release/sheetsplat")
    parser.add_argument("--scenes", type=pathlib.Path, default=ROOT.parent / "shared/scenes")
    parser.add_argument("--to", type=pathlib.Path, default=ROOT / "docs/sharp")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        picture = pathlib.Path(folder) / "picture.png"
        for scene, part in PARTS.items():
            for name, settings in PICTURES.items():
                path = options.scenes / f"{scene}.toml"
                if isinstance(settings, str):
                    script = ROOT / "benches/peers/vtk_bench.py"
                    command = [sys.executable, script, path, "--frames", "1", "--step", settings, "--png", picture]
                else:
                    sets = [word for setting in settings for word in ("--set", setting)]
                    command = [options.sheetsplat, "render", path, "--backend", "cpu", *sets, "-o", picture]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
                crop = Image.open(picture).convert("RGB").crop(part)
                crop.resize((crop.width * 2, crop.height * 2), Image.Resampling.NEAREST).save(
                    options.to / f"{scene}-{name}.png", optimize=True)  # fmt: skip


main()
