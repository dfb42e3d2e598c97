"""A widget for napari, "Render picture": a picture of a layer as the viewer's camera sees it.

Only napari imports this module; the package itself needs neither napari nor Qt.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from magicgui.widgets import ComboBox, Container, FileEdit, PushButton, SpinBox
from magicgui.widgets import Image as Preview
from napari.components import ViewerModel
from napari.layers import Image as ImageLayer
from napari.layers import Labels as LabelsLayer

from . import _native as native
from .errors import SceneError
from .image import Image
from .view import View

__all__ = ["RenderPicture"]

#: The choice that takes colours and contrast from the layer.
AS_IN_LAYER = "as in the layer"

#: Control points of a layer's colours.
COLORS = 65

#: Pixels of the window that a picture is at least wide in the widget.
PREVIEW = 320

#: Voxels of the finest resolution of a pyramid that is drawn.
MOST_VOXELS = 512**3


class RenderPicture(Container):  # type: ignore[misc]
    """The widget. `render` draws a picture, shows it and returns it; a script can call it too.

    Parameters
    ----------
    napari_viewer : napari.Viewer
        The viewer whose layers and camera are drawn.
    """

    def __init__(self, napari_viewer: ViewerModel) -> None:
        self._viewer = napari_viewer
        self.picture: Image | None = None
        self.image_layer = ComboBox(name="image_layer", label="layer", choices=lambda _: self._layers(ImageLayer))
        self.label_layer = ComboBox(
            name="label_layer", label="labels", choices=lambda _: self._layers(LabelsLayer), nullable=True
        )
        self.preset = ComboBox(name="preset", choices=[AS_IN_LAYER, *native.presets()])
        self.width_px = SpinBox(name="width_px", label="width", value=1024, min=1, max=32768)
        self.height_px = SpinBox(name="height_px", label="height", value=1024, min=1, max=32768)
        draw, self.preview = PushButton(text="Render picture"), Preview(name="preview", visible=False)
        self.path = FileEdit(name="path", label="save as", mode="w", filter="*.png *.exr *.npy", visible=False)
        self.path.native.setToolTip("A PNG, EXR or NPY file, written when its name is chosen")
        what = [self.image_layer, self.label_layer]
        super().__init__(
            widgets=[*what, self.preset, self.width_px, self.height_px, draw, self.preview, self.path]
        )
        draw.clicked.connect(self.render)
        self.path.changed.connect(self._save)
        for happening in (napari_viewer.layers.events.inserted, napari_viewer.layers.events.removed):
            happening.connect(self.reset_choices)

    def _layers(self, kind: type) -> list[Any]:
        return [layer for layer in self._viewer.layers if isinstance(layer, kind)]

    def render(self) -> Image:
        """Draws the chosen layer in the direction of the viewer's camera, and shows the picture in the widget."""
        layer, labels = self.image_layer.value, self.label_layer.value
        if layer is None:
            raise SceneError("layer: found none, allowed: an image layer of at least three dimensions", "layer")
        values = _grid(layer, self._viewer)
        tags = None if labels is None else _grid(labels, self._viewer)
        settings = _colors(layer) if self.preset.value == AS_IN_LAYER else {"preset": self.preset.value}
        camera, is_mirrored = _camera(getattr(self._viewer, "scene", self._viewer).camera)
        view = View(
            values,
            spacing=_spacing(layer, values.shape),
            labels=tags,
            image={"width": self.width_px.value, "height": self.height_px.value},
            camera=camera,
            **settings,
        )
        picture = view.render()
        if is_mirrored:
            array = np.ascontiguousarray(np.asarray(picture)[:, ::-1])
            picture = Image._of(array, picture.stats, picture._made_on, picture._inputs)
        self.picture = picture
        self.preview.value = picture.to_uint8()
        self.preview.min_width, self.preview.min_height = PREVIEW, PREVIEW * picture.height // picture.width
        self.preview.visible = self.path.visible = True
        return picture

    def _save(self, path: Any) -> None:
        if self.picture is not None and str(path) not in ("", "."):
            self.picture.save(path)


def _grid(layer: Any, viewer: ViewerModel) -> Any:
    """The values `[z, y, x]` of a layer; where it has more axes, those that the viewer shows now."""
    if getattr(layer, "rgb", False) or layer.ndim < 3:
        found = "colours" if getattr(layer, "rgb", False) else f"{layer.ndim} dimensions"
        allowed = "an image layer of at least three dimensions with one value per voxel"
        raise SceneError(f"layer: found {found} in {layer.name!r}, allowed: {allowed}", "layer", found, allowed)
    levels = list(layer.data) if layer.multiscale else [layer.data]
    shown = viewer.dims.point[-layer.ndim : -3] if layer.ndim > 3 else ()
    fitting = [level for level in levels if np.prod(level.shape[-3:]) <= MOST_VOXELS]
    level = fitting[0] if fitting else levels[-1]
    place = []
    for axis, world in enumerate(shown):
        # Axes before the last three are equally fine in every resolution.
        step = round((world - layer.translate[axis]) / layer.scale[axis])
        place.append(min(max(step, 0), level.shape[axis] - 1))
    return np.asarray(level[tuple(place)])


def _spacing(layer: Any, shape: tuple[int, ...]) -> tuple[float, ...]:
    """World units between voxels along z, y and x, of the resolution that is drawn."""
    finest = layer.data[0].shape if layer.multiscale else layer.data.shape
    linear = layer.affine.linear_matrix[-3:, -3:] @ layer.rotate[-3:, -3:] @ np.diag(layer.scale[-3:])
    lengths = np.abs(np.diag(linear))
    is_turned = not np.allclose(linear, np.diag(np.diag(linear)), atol=1e-6 * lengths.max()) or np.any(layer.shear != 0)
    if is_turned or not (np.diag(linear) > 0).all():
        allowed = "a layer that is neither turned, sheared nor mirrored"
        raise SceneError(f"layer: found {layer.name!r}, allowed: {allowed}", "layer", repr(layer.name), allowed)
    return tuple(float(step * size / drawn) for step, size, drawn in zip(lengths, finest[-3:], shape, strict=True))


def _camera(camera: Any) -> tuple[dict[str, Any], bool]:
    """The direction of the viewer's camera, and whether the viewer shows the world's mirror image.

    napari's vectors are in the order z, y, x, and so is its handedness: axes that are right-handed in this order are
    left-handed in the order x, y, z.
    """
    direction, up = ([float(part) for part in vector[::-1]] for vector in (camera.view_direction, camera.up_direction))
    return {"direction": direction, "up": up}, str(camera.handedness) != "left"


def _colors(layer: Any) -> dict[str, Any]:
    """A transfer function with the layer's colour map, contrast limits and gamma, whose opacity rises over the limits."""
    low, high = (float(limit) for limit in layer.contrast_limits)
    shares = np.linspace(0, 1, COLORS)
    colors = np.clip(layer.colormap.map(shares**layer.gamma)[:, :3], 0, 1)
    color = [[low + (high - low) * float(share), rgb.tolist()] for share, rgb in zip(shares, colors, strict=True)]
    opacity = [[low, 0], [high, float(layer.opacity)]]
    return {"transfer": {"color": color, "opacity": opacity}, "splatting": {"compositing": "exponential"}}
