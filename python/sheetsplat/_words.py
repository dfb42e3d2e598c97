"""Words for keys of scenes, such as `cmap` and `view`: the one place that turns them into these keys.

Some words are keys as they stand. Others depend on the volume, and become keys once it is known: a range of values that is
not stated, a side of the patient, and angles and a zoom from where the camera would be.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _colors as colors
from . import _native as native
from ._checks import finite, refused, whole
from ._settings import VIEWS, Arguments, Settings
from .errors import SceneError

if TYPE_CHECKING:
    from .volume import Volume

__all__ = ["ARGUMENTS", "OF_CAMERA", "SETTINGS", "Said", "check_names", "merged", "plain", "settled", "split", "stated"]


class Said(NamedTuple):
    """A word's value, and the name by which it was said."""

    name: str
    value: Any


#: Words that have two names.
_ALIASES = {"colormap": "cmap", "side": "view"}

#: The keys that words are, by the words. A word and one of its keys in one call are an error; in two calls the last one counts.
_KEYS = {
    "cmap": ("transfer.color", "transfer.colormap"),
    "clim": ("transfer.opacity",),
    "vmin": ("transfer.opacity",),
    "vmax": ("transfer.opacity",),
    "opacity": ("transfer.opacity",),
    "background": ("image.background",),
    "size": ("image.width", "image.height"),
    "view": ("camera.direction", "camera.up"),
}

#: The words that start from keys, which may be stated beside them; stated later, the keys replace these words.
_FROM_KEYS = {
    "azimuth": ("camera.direction", "camera.up"),
    "elevation": ("camera.direction", "camera.up"),
    "zoom": ("camera.height", "camera.distance", "camera.projection"),
    "only": (),
}

_WORDS = {*_KEYS, *_FROM_KEYS}

#: The words that place the camera.
OF_CAMERA = ("view", "side", "azimuth", "elevation", "zoom")

#: The sides of a patient, which depend on the volume.
_SIDES = ("front", "back", "left", "right", "top", "bottom")

#: Presets whose opacities are no window of values.
_WITHOUT_WINDOW = ("xray", "labels", "photo")

#: The words of other programs, and ours.
_FOREIGN = {
    "alpha": "opacity",
    "bg": "background",
    "blending": "splatting={'compositing': ...}",
    "camera_position": "view",
    "color": "transfer={'color': ...}",
    "contrast_limits": "clim",
    "cpos": "view",
    "height": "size",
    "palette": "cmap",
    "rendering": "preset",
    "resolution": "size",
    "scalar_bar": "annotate='colors'",
    "shade": "shading={'enabled': ...}",
    "show_scalar_bar": "annotate='colors'",
    "width": "size",
    "window": "clim",
    "window_size": "size",
}


def check_names(settings: Iterable[Any], known: Iterable[str]) -> None:
    """Refuses a keyword argument that is none, and names the one that it resembles."""
    names = [*known]
    for key in settings:
        first = key.split(".")[0].split("[")[0] if isinstance(key, str) else key
        if first in names or not isinstance(key, str) or not first.strip() or "=" in key:
            continue
        near = _FOREIGN.get(first) or next(iter(difflib.get_close_matches(first, names, n=1)), None)
        found = "an unknown keyword" + (f" (perhaps {near})" if near else "")
        raise refused(SceneError, key, found, ", ".join(names))


#: The names of all settings, and with them those of a view's other arguments.
SETTINGS = tuple(Settings.__annotations__)
ARGUMENTS = tuple(Arguments.__annotations__)


def split(flat: Mapping[Any, Any]) -> tuple[dict[str, Said], dict[Any, Any]]:
    """The words and the other settings of a call, all of them by whole keys."""
    words: dict[str, Said] = {}
    keys: dict[Any, Any] = {}
    for name, value in flat.items():
        word = _ALIASES.get(name, name) if isinstance(name, str) else name
        if word not in _WORDS:
            keys[name] = value
        elif word in words:
            raise _together(name, words[word].name)
        else:
            words[word] = Said(name, value)
    if "clim" in words:
        for name in ("vmin", "vmax"):
            if name in words and words["clim"].value is not None and words[name].value is not None:
                raise _together("clim", name)
    for word, said in words.items():
        for key in keys:
            if said.value is not None and _is_one_of(key, _KEYS.get(word, ())):
                raise _together(said.name, key)
    return {word: _checked(word, said) for word, said in words.items()}, keys


def _together(one: str, other: str) -> Exception:
    return refused(SceneError, one, f"{one} beside {other}", f"one of {one} and {other}")


def _is_one_of(key: Any, keys: Iterable[str]) -> bool:
    """Whether a key is one of some, an element of one, or a table of one."""
    if not isinstance(key, str):
        return False
    return any(key == of or key.startswith((f"{of}.", f"{of}[")) or of.startswith(f"{key}.") for of in keys)


def merged(old: Mapping[str, Said], new: Mapping[str, Said], keys: Iterable[Any]) -> dict[str, Said]:
    """The words after a call that states some words and keys: the last one counts."""
    keys = [*keys]
    words = {
        word: said
        for word, said in old.items()
        if not any(_is_one_of(key, (*_KEYS.get(word, ()), *_FROM_KEYS.get(word, ()))) for key in keys)
    }
    if "view" in new:
        # Angles start from the side that is looked at.
        words.pop("azimuth", None)
        words.pop("elevation", None)
    if "clim" in new:
        words.pop("vmin", None)
        words.pop("vmax", None)
    if ("vmin" in new or "vmax" in new) and "clim" in words:
        said = words.pop("clim")
        words |= {name: Said(name, end) for name, end in zip(("vmin", "vmax"), said.value, strict=True)}
    words |= new
    # None takes a word back.
    return {word: said for word, said in words.items() if said.value is not None}


def _checked(word: str, said: Said) -> Said:
    """A word whose value is allowed as far as that does not depend on the volume."""
    name, value = said
    if value is None:
        return said
    if word in ("vmin", "vmax", "azimuth", "elevation"):
        value = finite(name, value)
    elif word == "clim":
        value = _range(name, value)
    elif word == "size":
        value = _size(name, value)
    elif word == "only":
        if not isinstance(value, str):
            value = str(whole(name, value, 0, 2**64 - 1))
    elif word == "zoom":
        value = finite(name, value)
        if value <= 0:
            raise refused(SceneError, name, repr(said.value), "a number above 0")
    elif word == "view":
        allowed = [*_SIDES, *VIEWS]
        if value not in allowed:
            near = difflib.get_close_matches(value, allowed, n=1) if isinstance(value, str) else []
            found = f"{value!r} (perhaps {near[0]})" if near else repr(value)
            raise refused(SceneError, name, found, ", ".join(allowed))
    elif word == "cmap":
        value = colors.color_map(name, value)
    elif word == "opacity":
        value = colors.opacities(name, value)
    return Said(name, value)


def _range(name: str, value: Any) -> tuple[float, float]:
    try:
        ends = [float(end) for end in value]
    except (TypeError, ValueError):
        ends = []
    if len(ends) != 2 or not ends[0] < ends[1]:
        raise refused(SceneError, name, repr(value), "two numbers, the first less than the second")
    return finite(name, ends[0]), finite(name, ends[1])


def _size(name: str, value: Any) -> tuple[int, int]:
    try:
        sides: list[Any] = [*value]
    except TypeError:
        sides = [value, value]
    if isinstance(value, str) or len(sides) != 2:
        raise refused(SceneError, name, repr(value), "pixels of a square, or a width and a height")
    width, height = (whole(name, side, 1, 2**31 - 1) for side in sides)
    return width, height


def plain(bare: native.Scene, words: Mapping[str, Said]) -> tuple[native.Scene, dict[str, Said]]:
    """A scene with the words that are other names of keys, whatever the other words and the volume are; and these others."""
    keys: dict[str, Any] = {}
    rest = dict(words)
    if "size" in words:
        keys["image.width"], keys["image.height"] = rest.pop("size").value
    if "background" in words:
        keys["image.background"] = rest.pop("background").value
    if "view" in words and words["view"].value in VIEWS:
        keys["camera.direction"], keys["camera.up"] = ([*vector] for vector in VIEWS[rest.pop("view").value])
    return (_replaced(bare, words, keys) if keys else bare), rest


def stated(bare: native.Scene, words: Mapping[str, Said]) -> tuple[native.Scene, list[str]]:
    """A scene with the words that are keys without the volume, and the names of the others."""
    keys: dict[str, Any] = {}
    ends = _ends(words)
    if ends is not None:
        keys |= _transfer(words, ends)
    elif "cmap" in words and isinstance(words["cmap"].value, str) and not _has_ends(words):
        keys["transfer.colormap"] = words["cmap"].value
    if "opacity" in words and isinstance(words["opacity"].value[0], list):
        keys["transfer.opacity"] = words["opacity"].value
    scene = _replaced(bare, words, keys) if keys else bare
    if _has_ends(words):
        _check_window(scene, words)
    return scene, [said.name for word, said in words.items() if not _is_known(word, words, ends)]


def _is_known(word: str, words: Mapping[str, Said], ends: tuple[float, float] | None) -> bool:
    """Whether a word needs no volume."""
    said = words[word]
    if word in ("vmin", "vmax"):
        return ends is not None
    if word == "cmap":
        return ends is not None or (isinstance(said.value, str) and not _has_ends(words))
    if word == "opacity":
        return ends is not None or isinstance(said.value[0], list)
    return word not in _FROM_KEYS and word != "view"


def _has_ends(words: Mapping[str, Said]) -> bool:
    return any(word in words for word in ("clim", "vmin", "vmax"))


def _ends(words: Mapping[str, Said], of_volume: tuple[float, float] | None = None) -> tuple[float, float] | None:
    """The range of values that the words state, of which the volume's own may be an end."""
    if "clim" in words:
        low, high = words["clim"].value
        return low, high
    least, most = of_volume if of_volume is not None else (None, None)
    low = words["vmin"].value if "vmin" in words else least
    high = words["vmax"].value if "vmax" in words else most
    if low is None or high is None or not _has_ends(words):
        return None
    if not low < high:
        name = "vmin" if "vmin" in words else "vmax"
        found = f"values from {low:g} to {high:g}"
        allowed = "a minimum below the maximum; one that is not stated is that of the volume's values"
        raise refused(SceneError, name, found, allowed)
    return low, high


def _transfer(words: Mapping[str, Said], ends: tuple[float, float]) -> dict[str, Any]:
    """The keys of colours and opacities over a range of values."""
    keys: dict[str, Any] = {}
    if "cmap" in words and words["cmap"].value != "file":
        cmap = words["cmap"].value
        evenly = (native.colormap(cmap) or []) if isinstance(cmap, str) else cmap
        keys["transfer.color"] = colors.over(evenly, *ends)
    elif "cmap" in words:
        # A palette states the values of its colours itself.
        keys["transfer.colormap"] = "file"
    if "opacity" not in words:
        keys["transfer.opacity"] = [[ends[0], 0.0], [ends[1], 1.0]]
    elif not isinstance(words["opacity"].value[0], list):
        keys["transfer.opacity"] = colors.over(words["opacity"].value, *ends)
    return keys


def _check_window(scene: native.Scene, words: Mapping[str, Said]) -> None:
    """Refuses a range of values where nothing lies over it, or where opacities are no window of values."""
    name = next(words[word].name for word in ("clim", "vmin", "vmax") if word in words)
    if "opacity" not in words:
        preset = tomllib.loads(scene.to_toml(".")).get("preset")
        if preset in _WITHOUT_WINDOW:
            allowed = "another preset, as this one's opacities are no window of values; or opacity beside it"
            raise refused(SceneError, name, f"{name} and the preset {preset}", allowed)
    elif "cmap" not in words and isinstance(words["opacity"].value[0], list):
        found = f"{name} beside opacity with values of its own"
        raise refused(SceneError, name, found, "opacities without values, or cmap beside it")


def settled(
    bare: native.Scene, words: Mapping[str, Said], of: Volume, all_around: bool, annotate: Sequence[str]
) -> native.Scene:
    """A scene with all words as the keys that they are for a volume."""
    scene, unknown = stated(bare, words)
    if not unknown:
        return scene
    volume = of._native
    if "only" in words:
        scene = _alone(scene, words["only"].value, volume)
    scene = _colored(scene, words, of)
    if "view" in words:
        scene = _seen(scene, words["view"], volume)
    angles = [words[name].value if name in words else 0.0 for name in ("azimuth", "elevation")]
    if any(angles):
        direction, up = native.eye(scene, volume, *angles)
        scene = scene.replaced({"camera.direction": direction, "camera.up": up})
    if "zoom" in words:
        camera = tomllib.loads(scene.explicit(volume, all_around, [*annotate]).to_toml("."))["camera"]
        key = "height" if camera["projection"] == "orthographic" else "distance"
        scene = _replaced(scene, words, {f"camera.{key}": camera[key] / words["zoom"].value}, "zoom")
    return scene


def _alone(scene: native.Scene, label: str, volume: native.Volume) -> native.Scene:
    """A scene with one label alone, and with the appearance that it leaves open stated."""
    tables = tomllib.loads(native.only(scene, volume, label).to_toml("."))
    # The volume goes on to choose the camera.
    keys = {key: table for key, table in tables.items() if key not in ("camera", "image", "volume")}
    return scene.replaced(keys)


def _seen(scene: native.Scene, side: Said, volume: native.Volume) -> native.Scene:
    """A scene seen from a side of the patient."""
    try:
        camera = tomllib.loads(scene.seen_from(volume, side.value).to_toml("."))["camera"]
    except SceneError as error:
        allowed = f"{error.allowed}, or view= by axes: {', '.join(VIEWS)}"
        raise refused(SceneError, side.name, error.found, allowed) from error
    return scene.replaced({"camera.direction": camera["direction"], "camera.up": camera["up"]})


def _colored(scene: native.Scene, words: Mapping[str, Said], volume: Volume) -> native.Scene:
    """A scene with colours and opacities over ranges of values that the volume has."""
    if not {"cmap", "opacity", "vmin", "vmax"} & words.keys() or _ends(words) is not None:
        return scene
    least, most = volume._ends()
    if _has_ends(words):
        ends = _ends(words, (least, most))
        return _replaced(scene, words, _transfer(words, ends)) if ends is not None else scene
    if "opacity" in words and not isinstance(words["opacity"].value[0], list):
        scene = _replaced(scene, words, {"transfer.opacity": colors.over(words["opacity"].value, least, most)})
    if "cmap" in words and not isinstance(words["cmap"].value, str):
        scene = _replaced(scene, words, {"transfer.color": colors.over(words["cmap"].value, *_visible(scene, volume._native))})
    return scene


def _visible(scene: native.Scene, volume: native.Volume) -> tuple[float, float]:
    """The range over which a colour map of scene files lies: the visible values, of all channels."""
    spread = tomllib.loads(scene.replaced({"transfer.colormap": "gray"}).explicit(volume, False, []).to_toml("."))
    ramps = [table["transfer"]["color"] for table in spread.get("channel", [spread])]
    return min(ramp[0][0] for ramp in ramps), max(ramp[-1][0] for ramp in ramps)


def _replaced(scene: native.Scene, words: Mapping[str, Said], keys: dict[str, Any], word: str | None = None) -> native.Scene:
    """A scene with the keys that words are; an error names the word."""
    try:
        return scene.replaced(keys)
    except SceneError as error:
        # Opacities over a range are wrong themselves, not the range.
        order = sorted(words, key=lambda of: of in ("clim", "vmin", "vmax"))
        names = [words[of].name for of in order if _is_one_of(error.key, _KEYS.get(of, ()))]
        if word is None and not names:
            raise
        name = words[word].name if word is not None else names[0]
        raise refused(SceneError, name, error.found, str(error.allowed)) from error
