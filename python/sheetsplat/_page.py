"""A page of one file that turns a volume without a network: the library as WebAssembly, the volume and the scene in it."""

from __future__ import annotations

import base64
import gzip
import html
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native as native
from ._checks import refused
from .errors import FileError, VolumeError
from .scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .volume import Volume

__all__ = ["page"]

#: The scripts and the library, compressed, which `web/build.mjs` puts here.
FILES = Path(__file__).with_name("page.bin")

#: The most voxels of all channels: browsers give a page about 2 GB.
_MOST_VOXELS = 1 << 27

_TEMPLATE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>
html, body {{ margin: 0; height: 100%; background: {background}; }}
canvas, img {{ position: fixed; width: 100%; height: 100%; object-fit: contain; touch-action: none; }}
p {{ position: fixed; margin: 1em; font: 16px sans-serif; color: #c00; }}
</style>
<img id="still" alt="{title}" src="data:image/png;base64,{still}">
<canvas id="view" tabindex="0" aria-label="{title}"></canvas>
<p id="problem" role="alert"></p>
<script type="application/octet-stream" id="files">{files}</script>
<script type="application/octet-stream" id="data">{data}</script>
<script type="module">
{script}
</script>
</html>
"""

# A page without an address may load scripts and start workers by addresses of their bytes, but no worker that is a module, and
# none that starts others.
_SCRIPT = """
async function unpacked(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
  const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(plain).arrayBuffer());
  const begin = 4 + new DataView(bytes.buffer).getUint32(0, true);
  const places = JSON.parse(new TextDecoder().decode(bytes.subarray(4, begin)));
  return Object.entries(places).map(([name, [from, to]]) => [name, bytes.subarray(begin + from, begin + to)]);
}
try {
  const files = Object.fromEntries(await unpacked("files"));
  const [page, code] = ["index.js", "worker.js"].map((name) => URL.createObjectURL(new Blob([files[name]], { type: "text/javascript" })));
  const { SheetSplat } = await import(page);
  const [worker, module] = [new Worker(code), await WebAssembly.compile(files["cpu_bg.wasm"])];
  const view = await SheetSplat.create(document.getElementById("view"), { backend: "cpu", worker, module });
  const { "scene.toml": scene, ...volume } = Object.fromEntries(await unpacked("data"));
  const given = Object.entries(volume).map(([name, data]) => ({ name, data }));
  const set = { "volume.path": "volume.nrrd", ...("labels.nrrd" in volume && { "volume.labels": "labels.nrrd" }) };
  await view.loadFile(given, { scene: new TextDecoder().decode(scene), set });
  document.getElementById("still").remove();
  view.on("error", (error) => { document.getElementById("problem").textContent = String(error); });
  document.documentElement.dataset.state = "drawn";
} catch (error) {
  document.getElementById("problem").textContent = String(error);
  document.documentElement.dataset.state = "failed";
}
"""


def page(volume: Volume, scene: Scene, still: bytes) -> str:
    """The page of a volume and a scene with everything stated, with a picture that stands in until it is drawn."""
    try:
        files = FILES.read_bytes()
    except OSError as error:
        allowed = "a wheel that was made after `npm run build` in the folder web"
        message = f"the page's files are not in this package, allowed: {allowed}"
        raise FileError(error.errno, message, str(FILES)) from error
    if volume.streamed:
        raise refused(VolumeError, "volume", "one that is streamed", "one in memory: a coarser level, or more memory")
    z, y, x = volume.shape
    if x * y * z * volume.channels > _MOST_VOXELS:
        found = f"{z}×{y}×{x} voxels of {volume.channels} channels"
        raise refused(VolumeError, "volume", found, f"at most {_MOST_VOXELS} in a page: a coarser level or a part")
    labels = native.label_array(volume._native)
    contents = {"scene.toml": _scene(scene).encode(), "volume.nrrd": _values(volume)}
    if labels is not None:
        contents["labels.nrrd"] = _nrrd(volume, labels, None)
    red, green, blue, _ = scene.to_dict()["image"]["background"]
    return _TEMPLATE.format(
        title=html.escape(f"Volume of {z}×{y}×{x} voxels"),
        background="rgb({:.0f} {:.0f} {:.0f})".format(*(255 * part for part in (red, green, blue))),
        still=base64.b64encode(still).decode(),
        files=base64.b64encode(files).decode(),
        data=base64.b64encode(gzip.compress(_packed(contents))).decode(),
        script=_SCRIPT,
    )


def _packed(contents: dict[str, bytes]) -> bytes:
    """Some files in one: the length of a table, the table of their places, and the files."""
    places, end = {}, 0
    for name, content in contents.items():
        places[name] = (end, end + len(content))
        end += len(content)
    table = json.dumps(places).encode()
    return len(table).to_bytes(4, "little") + table + b"".join(contents.values())


def _scene(scene: Scene) -> str:
    """The text of a scene that names no volume."""
    tables = scene.to_dict()
    for table in [tables, *tables.get("channel", [])]:
        table.pop("volume", None)
    return Scene(tables).to_toml()


def _values(volume: Volume) -> bytes:
    """The values of all channels, or the colours, as a file in the NRRD format."""
    import numpy as np

    colors = native.color_array(volume._native)
    if colors is not None:
        return _nrrd(volume, colors, "RGBA-color")
    channels = [_narrow(volume.values_of(number)) for number in range(volume.channels)]
    if len(channels) == 1:
        return _nrrd(volume, channels[0], None)
    return _nrrd(volume, np.stack(channels, axis=3), "list")


def _narrow(values: NDArray[np.float32]) -> NDArray[Any]:
    """Values in the fewest bytes that hold them."""
    import numpy as np

    if np.isfinite(values).all() and (values == np.floor(values)).all():
        for kind in (np.uint8, np.int16, np.uint16):
            limits = np.iinfo(kind)
            if limits.min <= values.min() and values.max() <= limits.max:
                return values.astype(kind)
    return values


def _nrrd(volume: Volume, array: NDArray[Any], of_first: str | None) -> bytes:
    """A file in the NRRD format of an array `[z, y, x]`, or `[z, y, x, number]` with a kind of these numbers."""
    import numpy as np

    types = {"f4": "float", "u1": "uint8", "i2": "int16", "u2": "uint16", "u8": "uint64"}
    header = ["NRRD0005", f"type: {types[array.dtype.str[1:]]}", f"dimension: {array.ndim}"]
    header.append("sizes: " + " ".join(map(str, reversed(array.shape))))
    spacing = volume.spacing[::-1]
    first = [] if of_first is None else ["none"]
    placement = native.placement(volume._native)
    if placement is not None:
        axes, origin = placement
        directions = [
            "({})".format(",".join(repr(float(part) * step) for part in axis)) for axis, step in zip(axes, spacing, strict=True)
        ]
        header += ["space: right-anterior-superior", "space directions: " + " ".join([*first, *directions])]
        header.append("space origin: ({})".format(",".join(repr(float(part)) for part in origin)))
    else:
        header.append("spacings: " + " ".join([*(["nan"] if first else []), *map(repr, spacing)]))
    if of_first is not None:
        header.append(f"kinds: {of_first} domain domain domain")
    header += ["endian: little", "encoding: raw"]
    content = np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()
    return "\n".join(header).encode() + b"\n\n" + content
