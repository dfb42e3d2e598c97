#!/usr/bin/env python3
"""Downloads the public volumes that benches/RESULTS.md quotes, and writes them and their scene files where the benches look for them.

    python3 benches/fetch.py [FOLDER]

The default FOLDER is `../shared` beside the checkout. Volumes become NRRD files in FOLDER/data, scenes FOLDER/scenes/NAME.toml. Every volume's samples
are checked against the digest of those that were measured. benches/fetch.md says where the volumes come from, and their licences. Only Python's own library is needed.
"""

import array
import gzip
import hashlib
import pathlib
import struct
import sys
import urllib.request
import zlib

VTK = "https://raw.githubusercontent.com/pyvista/vtk-data/126ee90/Data"
NIFTI = "https://raw.githubusercontent.com/neurolabusc/VolumeRenderingData/d15be4d"
CT_HEAD = "https://raw.githubusercontent.com/yangrc1234/UnityIsoSurfaceVolumeRenderer/c7481a8/CThead"


def download(url):
    with urllib.request.urlopen(url) as answer:
        return answer.read()


def nifti(url):
    """The samples of a gzipped NIfTI-1 file of one byte a voxel, as they are stored."""
    whole = gzip.decompress(download(url))
    order = "<" if struct.unpack_from("<i", whole)[0] == 348 else ">"
    return whole[int(struct.unpack_from(order + "f", whole, 108)[0]):]


def slices(prefix, count, swap):
    """Files of 16-bit samples, one for each slice, as one volume in little-endian order."""
    samples = array.array("H", b"".join(download(f"{prefix}.{number}") for number in range(1, count + 1)))
    if swap:
        samples.byteswap()
    return samples.tobytes()


def metaimage(folder, name):
    """The samples of a MetaImage file whose data file is compressed."""
    header = dict(line.split("=", 1) for line in download(f"{folder}/{name}").decode().splitlines() if "=" in line)
    data = download(f"{folder}/" + next(value for key, value in header.items() if key.strip() == "ElementDataFile").strip())
    return zlib.decompress(data)


# Name: how to get the samples, their type, sizes and spacings, and the digest of the samples.
VOLUMES = {
    "bonsai": (lambda: nifti(f"{NIFTI}/OpenSciVis/bonsai.nii.gz"), "uint8", "256 256 256", "1 1 1",
               "d5c346c6c7507e88ba2bb93700d1223188f0566a93956ede73ea2df9559c2e4e"),
    "ct-head": (lambda: slices(f"{CT_HEAD}/CThead", 113, swap=True), "uint16", "256 256 113", "1 1 2",
                "8a378356d37fc55a977032375b1bd34298c0b137167dd0f05e025d66e0ae5d94"),
    "engine": (lambda: nifti(f"{NIFTI}/OpenSciVis/engine.nii.gz"), "uint8", "256 256 128", "1 1 1",
               "0824611d5656143ee2d6fb4ad5cec3b6f64e1736b34e66217f5375da9fb63575"),
    "frog-labels": (lambda: metaimage(f"{VTK}/froggy", "frogtissue.mhd"), "uint8", "500 470 136", "1 1 1.5",
                    "c8e8ece072131691d0f9a7718883c26d7cd1d5854372408ac5d3c954ed48c196"),
    "mr-head": (lambda: nifti(f"{NIFTI}/seg3D/MR.nii.gz"), "uint8", "160 232 160", "1 0.8984370231628418 0.8984370231628418",
                "2ac9c1b3d932408248856e2a221da9fed1a7b5446d1aa4dd205a9513a88329eb"),
    "quarter-head": (lambda: slices(f"{VTK}/headsq/quarter", 93, swap=False), "uint16", "64 64 93", "3.2 3.2 1.5",
                     "74011a3339b1a56ca85c8c6920a46c0f80bddcc660bd9f78512888e06c496ce3"),
}

# Name: the volume, the rest of its scene file, as TOML.
SCENES = {
    "bonsai-gradient": ("bonsai", """
camera = { direction = [0.3, 0.9, -0.2], height = 340.0 }
transfer.color = [[0, [0.2, 0.5, 0.15]], [45, [0.25, 0.55, 0.15]], [70, [0.45, 0.3, 0.15]], [120, [0.6, 0.45, 0.3]], [255, [0.85, 0.8, 0.75]]]
transfer.opacity = [[28, 0.0], [45, 0.6], [255, 0.95]]
transfer.gradient_opacity = [[2, 0.0], [12, 1.0]]
transfer.iso_ranges = [[28, 255]]
"""),
    "ct-head-opaque": ("ct-head", """
camera = { direction = [0.55, 0.80, 0.15], up = [0, 0, -1], height = 300.0 }
transfer.color = [[0, [0.92, 0.74, 0.62]], [1150, [0.95, 0.78, 0.66]], [1600, [1.0, 0.95, 0.85]]]
transfer.opacity = [[450, 0.0], [750, 0.9], [3300, 0.9]]
shading = { ambient = 0.2, diffuse = 0.75, specular = 0.15, shininess = 20 }
"""),
    "ct-head-semi": ("ct-head", """
camera = { direction = [0.55, 0.80, 0.15], up = [0, 0, -1], height = 300.0 }
transfer.color = [[0, [0.85, 0.55, 0.45]], [1100, [0.85, 0.55, 0.45]], [1350, [0.95, 0.9, 0.75]], [3300, [1.0, 1.0, 0.95]]]
transfer.opacity = [[400, 0.0], [700, 0.03], [1000, 0.01], [1250, 0.01], [1500, 0.5], [3300, 0.9]]
"""),
    "engine-semi": ("engine", """
camera = { direction = [0.6, 0.5, -0.62], height = 290.0 }
transfer.color = [[0, [0.5, 0.6, 0.7]], [130, [0.5, 0.62, 0.75]], [180, [0.95, 0.75, 0.35]], [255, [1.0, 0.85, 0.4]]]
transfer.opacity = [[70, 0.0], [100, 0.04], [150, 0.04], [190, 0.8], [255, 0.9]]
"""),
    "frog-organs": ("frog-labels", """
camera = { direction = [0.35, 0.25, -0.9], up = [0, -1, 0], height = 540.0 }
transfer.color = [[0, [0, 0, 0]], [1, [0.8, 0.2, 0.2]], [6, [0.9, 0.6, 0.3]], [11, [0.95, 0.95, 0.8]], [15, [0.3, 0.7, 0.4]], [20, [0.3, 0.5, 0.9]], [29, [0.8, 0.4, 0.8]]]
transfer.opacity = [[0, 0.0], [1, 0.25], [29, 0.25]]
"""),
    "mr-head-opaque": ("mr-head", """
camera = { direction = [-0.45, -0.85, -0.25], height = 260.0 }
transfer.color = [[0, [0.92, 0.74, 0.62]], [255, [0.98, 0.86, 0.76]]]
transfer.opacity = [[20, 0.0], [45, 0.9], [255, 0.9]]
"""),
    "quarter-head-perspective": ("quarter-head", """
camera = { projection = "perspective", direction = [0.5, 0.8, 0.1], up = [0, 0, -1], fov_y = 30.0, distance = 480.0 }
image = { width = 384, height = 384 }
transfer.color = [[0, [0.9, 0.75, 0.65]], [1200, [0.9, 0.75, 0.65]], [1500, [1.0, 0.95, 0.85]]]
transfer.opacity = [[500, 0.0], [900, 0.7], [4000, 0.9]]
splatting.compositing = "exponential"
"""),
}


def write_volume(folder, name):
    samples, kind, sizes, spacings, digest = VOLUMES[name]
    path = folder / f"{name}.nrrd"
    if path.exists():
        print(f"{path} is there already")
        return
    found = samples()
    if hashlib.sha256(found).hexdigest() != digest:
        sys.exit(f"{name}: the samples are not those that were measured")
    header = f"NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {sizes}\nendian: little\nencoding: gzip\nspacings: {spacings}\n\n"
    aside = path.with_suffix(".part")
    aside.write_bytes(header.encode() + gzip.compress(found, mtime=0))
    aside.rename(path)
    print(f"wrote {path}")


def write_scene(folder, name):
    volume, rest = SCENES[name]
    path = folder / f"{name}.toml"
    if path.exists():
        print(f"{path} is there already")
        return
    image = "" if "image =" in rest else "image = { width = 512, height = 512 }\n"
    path.write_text(f'volume.path = "../data/{volume}.nrrd"\n{image}{rest.lstrip()}')
    print(f"wrote {path}")


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[1] / ".." / "shared"
    for below, names, write in (("data", VOLUMES, write_volume), ("scenes", SCENES, write_scene)):
        folder = root / below
        folder.mkdir(parents=True, exist_ok=True)
        for name in names:
            write(folder, name)


if __name__ == "__main__":
    main()
