"""The keyword arguments that say what a picture shows and how, as type checkers and editors see them."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Vector = Sequence[float] | NDArray[Any]
    Ramp = Sequence[Sequence[Any]] | NDArray[Any]

__all__ = ["VIEWS", "Arguments", "Backend", "Opacity", "Preset", "Settings", "Side", "completed"]

Backend = Literal["cpu", "gpu", "auto", "reference"]

Preset = Literal[
    "ct-skin", "ct-bone", "ct-vessels", "mr-head", "xray", "mip", "confocal", "labels", "fusion", "photo", "none"
]

Side = Literal["front", "back", "left", "right", "top", "bottom", "iso", "xy", "xz", "yz", "yx", "zx", "zy"]

Opacity = Literal["sigmoid", "linear", "linear_r"]

#: The names of `view` by axes: the direction from the eye into the scene, and the screen's up.
VIEWS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "iso": ((-1, -1, -1), (0, 0, 1)),
    "xy": ((0, 0, -1), (0, 1, 0)),
    "xz": ((0, 1, 0), (0, 0, 1)),
    "yz": ((-1, 0, 0), (0, 0, 1)),
    "yx": ((0, 0, 1), (1, 0, 0)),
    "zx": ((0, -1, 0), (1, 0, 0)),
    "zy": ((1, 0, 0), (0, 1, 0)),
}


class Camera(TypedDict, total=False):
    """The table ``[camera]``."""

    direction: Vector
    up: Vector
    center: Vector
    height: float
    fit: Literal["object", "volume"]
    projection: Literal["orthographic", "perspective"]
    fov_y: float
    distance: float
    near: float


class Picture(TypedDict, total=False):
    """The table ``[image]``."""

    width: int
    height: int
    background: str | Vector


class Clip(TypedDict, total=False):
    """The table ``[clip]``."""

    planes: Sequence[Vector] | NDArray[Any]
    crop: Sequence[Vector] | NDArray[Any]
    shade_faces: bool


class Transfer(TypedDict, total=False):
    """The table ``[transfer]``."""

    color: Ramp
    opacity: Ramp
    colormap: str
    gradient_opacity: Ramp
    iso_ranges: Sequence[Vector]
    label: Sequence[Mapping[str, Any]]


class Shading(TypedDict, total=False):
    """The table ``[shading]``."""

    enabled: bool
    light: str | Vector
    ambient: float
    diffuse: float
    specular: float
    shininess: float
    gradient: Literal["differences", "kernel", "membership"]
    occlusion: float
    occlusion_spread: float
    shadow: float
    shadow_spread: float
    light_step: float


class Splatting(TypedDict, total=False):
    """The table ``[splatting]``."""

    method: Literal["image-aligned", "axis-aligned", "composite-every-sample"]
    radius: float
    falloff: float
    slab_width: float
    slab_profile: Literal["cubic", "linear"]
    classification: Literal["after", "before"]
    interpolation: Literal["smooth", "exact", "auto"]
    footprint: Literal["summed-area", "sections"]
    compositing: Literal["linear", "exponential", "xray", "maximum", "minimum", "average", "surface"]
    order: Literal["front-to-back", "back-to-front"]
    opacity_threshold: float
    culling: bool
    tiles: bool
    rasterizer: Literal["auto", "tiles", "quads"]
    footprint_box: Literal["rectangle", "parallelogram"]
    experimental: Mapping[str, float]


class Settings(TypedDict, total=False):
    """The settings that `Scene` takes: the tables of a scene file, and words for some of their keys."""

    # Any mapping is a table, too, so that a dictionary that was made elsewhere is no error. Editors complete the keys of the
    # typed ones.
    preset: Preset
    volume: Mapping[str, Any]
    channel: Sequence[Mapping[str, Any]]
    camera: Camera | Mapping[str, Any]
    image: Picture | Mapping[str, Any]
    clip: Clip | Mapping[str, Any]
    transfer: Transfer | Mapping[str, Any]
    shading: Shading | Mapping[str, Any]
    splatting: Splatting | Mapping[str, Any]
    # A name, a colour map of matplotlib or colours.
    cmap: Any
    colormap: Any
    clim: Vector | None
    vmin: float | None
    vmax: float | None
    opacity: Opacity | Sequence[float | Vector] | NDArray[Any] | None
    background: str | Vector | None
    size: int | Sequence[int] | None
    view: Side | None
    side: Side | None
    azimuth: float | None
    elevation: float | None
    zoom: float | None
    only: str | int | None


class Arguments(Settings, total=False):
    """The arguments that `View` takes beside its source."""

    spacing: float | Sequence[float] | None
    labels: Any
    scene: Any
    backend: Backend
    adapter: str | None
    memory: int | str | None
    progress: bool
    index: str | os.PathLike[str] | None
    annotate: str | Sequence[str]
    light: str | os.PathLike[str] | None


_F = TypeVar("_F", bound=Callable[..., Any])


def completed(function: _F) -> _F:
    """The function, with the names of all its keyword arguments in its signature, which notebooks complete and `help` shows."""
    signature = inspect.signature(function)
    *stated, rest = signature.parameters.values()
    # The annotation is ``Unpack[...]`` of one of the tables above.
    kinds: type = Arguments if "Arguments" in str(rest.annotation) else Settings
    names = [name for name in kinds.__annotations__ if name not in signature.parameters]
    words = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in names]
    function.__signature__ = signature.replace(parameters=[*stated, *words, rest])  # type: ignore[attr-defined]
    return function
