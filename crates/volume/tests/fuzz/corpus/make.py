"""Writes the volumes and the chunks beside this file, each by a program that is not sheetsplat.

pip install numpy "numcodecs[crc32c]"
"""

from pathlib import Path

import numcodecs
import numpy

FOLDER = Path(__file__).parent


def folder(name):
    path = FOLDER / name
    path.mkdir(exist_ok=True)
    return path


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


def npz():
    values = numpy.arange(24, dtype="i2").reshape(2, 3, 4)
    numpy.savez(folder("npz") / "stored.npz", values)
    numpy.savez_compressed(folder("npz") / "deflated.npz", a=values, b=values)


def raw():
    # Sizes, sample type and offset, then what fills them.
    (folder("raw") / "floats").write_bytes(bytes([3, 2, 4, 3, 1]) + b"." + numpy.arange(24, dtype="<f4").tobytes())
    (folder("raw") / "big-doubles").write_bytes(bytes([2, 2, 2, 0x80 | 0x04, 0]) + numpy.arange(8, dtype=">f8").tobytes())


def nrrd():
    header = "NRRD0005\ntype: int16\ndimension: 3\nsizes: 2 3 2\nspacings: 1 1 2\nendian: big\nencoding: raw\n# a comment\nkey:=value\n\n"
    (folder("nrrd") / "raw.nrrd").write_bytes(header.encode() + numpy.arange(12, dtype=">i2").tobytes())


zarr()
npz()
raw()
nrrd()
