"""Writes the images and the scenes beside this file, the images by programs that are not sheetsplat.

pip install numpy OpenEXR pillow
"""

from pathlib import Path

import numpy
import OpenEXR
from PIL import Image, PngImagePlugin

FOLDER = Path(__file__).parent
Y, X, C = numpy.meshgrid(range(5), range(7), range(4), indexing="ij")
PIXELS = ((X * 37 + Y * 11 + C * 23) % 64 / 63).astype("f4")
PIXELS[..., :3] *= PIXELS[..., 3:]


def folder(name):
    path = FOLDER / name
    path.mkdir(exist_ok=True)
    return path


def png():
    eight = (PIXELS * 255).round().astype("u1")
    golden = PngImagePlugin.PngInfo()
    golden.add_itxt("Adapter", "an adapter")
    golden.add_itxt("Driver", "a driver")
    images = {
        "rgba": Image.fromarray(eight, "RGBA"),
        "rgb": Image.fromarray(eight[..., :3].copy(), "RGB"),
        "grey": Image.fromarray(eight[..., 0].copy(), "L"),
        "grey-alpha": Image.fromarray(eight[..., 2:].copy(), "LA"),
        "grey-16": Image.fromarray((PIXELS[..., 0] * 65535).astype("u2")),
        "one-bit": Image.fromarray(eight[..., 0] > 99),
        "indexed": Image.fromarray(eight[..., :3].copy(), "RGB").quantize(4),
    }
    for name, image in images.items():
        image.save(folder("png-image") / f"{name}.png", optimize=True, pnginfo=golden if name == "rgb" else None)


def exr():
    header = lambda compression: {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    for name, compression, kind, channels in [
        ("none", "NO", "f4", "RGBA"),
        ("rle", "RLE", "f2", "RGBA"),
        ("zip", "ZIP", "f4", "RGB"),
        ("zips", "ZIPS", "f2", "RGB"),
        ("piz", "PIZ", "f2", "RGBA"),
        ("pxr24", "PXR24", "f4", "RGBA"),
        ("b44", "B44", "f2", "RGB"),
    ]:
        planes = {channel: PIXELS[..., at].astype(kind).copy() for at, channel in enumerate(channels)}
        OpenEXR.File(header(compression), planes).write(str(folder("exr-image") / f"{name}.exr"))


def npy():
    path = folder("npy-image")
    numpy.save(path / "c.npy", PIXELS)
    numpy.save(path / "fortran-big.npy", numpy.asfortranarray(PIXELS.astype(">f4")))
    numpy.save(path / "doubles.npy", PIXELS.astype("f8"))


def scenes():
    scenes = {
        "whole": """camera.direction=[0, 1, 0]\0[volume]
path = "a.nrrd"
spacing = [1.0, 1.0, 3.0]
[camera]
projection = "perspective"
direction = [0.3, 0.9, -0.2]
up = [0, 0, 1]
fov_y = 30.0
[image]
width = 640
height = 480
background = [0, 0, 0, 1]
[transfer]
color = [[0, [0, 0, 0]], [80, [0.9, 0.7, 0.6]]]
opacity = [[40, 0], [60, 0.8]]
gradient_opacity = [[0, 0], [10, 1]]
iso_ranges = [[40, 255]]
[shading]
light = [1, 2, 3]
[splatting]
slab_width = 0.5
compositing = "exponential"
order = "back-to-front"
""",
        "labels": """volume = { builtin = "head:16" }
clip.planes = [[1, 0, 0, 0.5]]
[[transfer.label]]
label = 3
visible = false
[[transfer.label]]
label = 5
color = [[0, [1, 0, 0]]]
""",
    }
    for name, text in scenes.items():
        (folder("scene") / name).write_text(text)


png()
exr()
npy()
scenes()
