"""Writes the images, the raw volume and the scenes beside this file, each by a program that is not sheetsplat.

pip install numpy numcodecs OpenEXR pillow
"""

from pathlib import Path

import numcodecs
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


def zarr():
    values = numpy.arange(256, dtype="<u2")
    chunk = numpy.concatenate([values[64 * z + 8 * y :][:4] for z in range(2) for y in range(4)])
    codecs = {
        0: [numcodecs.Blosc(name, 9, shuffle) for name in ("blosclz", "lz4", "zlib", "zstd") for shuffle in (1, 2)],
        1: [numcodecs.GZip()],
        2: [numcodecs.Zstd()],
        3: [numcodecs.Zlib()],
        4: [numcodecs.BZ2()],
        5: [numcodecs.CRC32C(location="end")],
    }
    for kind, of_kind in codecs.items():
        for number, codec in enumerate(of_kind):
            (folder("zarr") / f"chunk-{kind}-{number}").write_bytes(bytes([kind]) + bytes(codec.encode(values)))
    # A shard of which two chunks are stored.
    code = bytes(numcodecs.Zstd().encode(chunk))
    index = numpy.full((8, 2), -1, "<i8")
    index[0] = index[5] = 0, len(code)
    (folder("zarr") / "shard").write_bytes(bytes([8]) + code + index.tobytes())


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
    values = numpy.arange(24, dtype="i2").reshape(2, 3, 4)
    numpy.savez(folder("npz") / "stored.npz", values)
    numpy.savez_compressed(folder("npz") / "deflated.npz", a=values, b=values)


def raw():
    # Sizes, sample type and offset, then what fills them.
    (folder("raw") / "floats").write_bytes(bytes([3, 2, 4, 3, 1]) + b"." + numpy.arange(24, dtype="<f4").tobytes())
    (folder("raw") / "big-doubles").write_bytes(bytes([2, 2, 2, 0x80 | 0x04, 0]) + numpy.arange(8, dtype=">f8").tobytes())


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


def nrrd():
    header = "NRRD0005\ntype: int16\ndimension: 3\nsizes: 2 3 2\nspacings: 1 1 2\nendian: big\nencoding: raw\n# a comment\nkey:=value\n\n"
    (folder("nrrd") / "raw.nrrd").write_bytes(header.encode() + numpy.arange(12, dtype=">i2").tobytes())


png()
zarr()
exr()
npy()
raw()
scenes()
nrrd()
