"""The page that shows golden images beside what was found."""

from __future__ import annotations

import base64
import html
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

__all__ = ["Compared", "page"]


class Compared(NamedTuple):
    """A picture that was compared with its golden; texts alone, so that it can be sent to another process."""

    name: str
    test: str
    #: The file and the line of the test that compared it.
    place: str
    golden: str
    left_in: str
    #: Why it failed; empty if it passed.
    report: str
    was_blessed: bool


_STYLE = """
body { font: 14px sans-serif; margin: 2em; }
img { image-rendering: pixelated; display: block; width: calc(var(--width) * var(--zoom, 1) * 1px); }
.pictures { display: flex; flex-wrap: wrap; gap: 1em; align-items: flex-start; }
figure { margin: 0; }
.scroll { overflow: auto; max-width: 90vw; max-height: 80vh; }
.scroll { background: repeating-conic-gradient(#999 0 25%, #bbb 0 50%) 0 0 / 16px 16px; }
.both { position: relative; width: max-content; cursor: ew-resize; touch-action: none; }
.both .golden { clip-path: inset(0 calc(100% - var(--at, 50%)) 0 0); }
.both .found { position: absolute; inset: 0 auto auto 0; clip-path: inset(0 0 0 var(--at, 50%)); }
.both::after { content: ""; position: absolute; inset: 0 auto 0 var(--at, 50%); border-left: 1px solid #f0f; }
"""

# The golden lies left of the slider and what was found right of it. All pictures of a comparison have one zoom.
_SCRIPT = """
for (const section of document.querySelectorAll("section")) {
  const zoom = section.querySelector("select"), slider = section.querySelector("input"), both = section.querySelector(".both");
  const set = (name, value) => section.style.setProperty(name, value);
  zoom.addEventListener("change", () => set("--zoom", zoom.value));
  for (const image of section.querySelectorAll("img")) {
    const known = () => image.style.setProperty("--width", image.naturalWidth);
    image.complete ? known() : image.addEventListener("load", known);
  }
  if (!slider) continue;
  slider.addEventListener("input", () => set("--at", slider.value + "%"));
  const follow = (event) => {
    if (event.type === "pointermove" && event.buttons === 0) return;
    const box = both.getBoundingClientRect();
    slider.value = 100 * (event.clientX - box.left) / box.width;
    slider.dispatchEvent(new Event("input"));
    event.preventDefault();
  };
  both.addEventListener("pointerdown", follow);
  both.addEventListener("pointermove", follow);
}
"""


def page(compared: Sequence[Compared], folder: Path, *, is_whole: bool) -> str:
    """The page of some comparisons: with all pictures inside, or with links to them from a folder."""
    failed = sum(bool(one.report) for one in compared)
    sections = "\n".join(_section(one, folder, is_whole) for one in sorted(compared, key=lambda one: not one.report))
    title = f"{failed} of {len(compared)} golden images failed" if is_whole else "Golden images that failed"
    return f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<style>{_STYLE}</style>
<h1>{title}</h1>
{sections}
<script>{_SCRIPT}</script>
</html>
"""


def _section(one: Compared, folder: Path, is_whole: bool) -> str:
    left = Path(one.left_in)
    files = {"golden": Path(one.golden)}
    if one.report:
        files |= {"found": left / f"{one.name}-actual.png", "difference": left / f"{one.name}-difference.png"}
    files = {kind: path for kind, path in files.items() if path.exists()}
    if not is_whole and "golden" in files:
        # The page stays complete when the folder is copied elsewhere, for instance from a CI run.
        files["golden"] = shutil.copyfile(files["golden"], left / f"{one.name}-golden.png")
    images = {kind: _image(path, kind, folder, is_whole) for kind, path in files.items()}
    slider, figures = "", ""
    if "golden" in images and "found" in images:
        slider = ' <label>golden <input type="range" min="0" max="100" value="50" step="any"> found</label>'
        both = f'<div class="both">{images["golden"]}{images["found"]}</div>'
        figures = f'<figure><div class="scroll">{both}</div><figcaption>golden | found</figcaption></figure>\n'
    figures += "\n".join(
        f'<figure><div class="scroll">{image}</div><figcaption>{kind}</figcaption></figure>' for kind, image in images.items()
    )
    zooms = "".join(f'<option value="{zoom}">{zoom}×</option>' for zoom in (1, 2, 4, 8, 16))
    outcome = "failed" if one.report else "blessed" if one.was_blessed else "passed"
    return f"""<section>
<h2>{html.escape(one.test)}: {html.escape(one.name)} {outcome}</h2>
<p>{html.escape(one.place)}</p>
<p><label>zoom <select>{zooms}</select></label>{slider}</p>
<div class="pictures">
{figures}
</div>
<pre>{html.escape(one.report)}</pre>
</section>"""


def _image(path: Path, kind: str, folder: Path, is_whole: bool) -> str:
    if is_whole:
        source = "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()
    else:
        source = html.escape(os.path.relpath(path, folder))
    return f'<img class="{kind}" src="{source}" alt="{kind}">'
