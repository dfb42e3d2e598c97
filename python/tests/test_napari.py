"""The widget for napari, without a window: the layers and the camera are napari's own, drawn by nobody else."""

import os
import pathlib
import subprocess
import sys

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import numpy as np
import pytest

pytest.importorskip("napari", reason="napari is not installed")

from napari.components import ViewerModel
from npe2 import PluginManifest

import sheetsplat
from sheetsplat.napari import AS_IN_LAYER, RenderPicture


@pytest.fixture(scope="module", autouse=True)
def application():
    """Widgets need an application, which must outlive them."""
    from qtpy.QtWidgets import QApplication

    return QApplication.instance() or QApplication([])


def ball() -> np.ndarray:
    z, y, x = np.ogrid[-1:1:20j, -1:1:30j, -1:1:40j]
    # Brighter towards positive x, so that left and right differ.
    return (100 * np.clip(1 - x * x - y * y - z * z, 0, 1) * (1.5 + x)).astype(np.float32)


def widget_of(viewer: ViewerModel) -> RenderPicture:
    widget = RenderPicture(viewer)
    widget.reset_choices()
    widget.width_px.value, widget.height_px.value = 48, 32
    return widget


def test_the_manifest_names_the_widget() -> None:
    manifest = PluginManifest.from_distribution("sheetsplat")
    (command,), (widget,) = manifest.contributions.commands, manifest.contributions.widgets
    assert (widget.command, widget.display_name) == (command.id, "Render picture")
    assert command.python_name == f"{RenderPicture.__module__}:{RenderPicture.__name__}"


def test_the_package_imports_neither_napari_nor_qt() -> None:
    code = "import sys, sheetsplat; sys.exit(any(name in sys.modules for name in ('napari', 'qtpy', 'magicgui')))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_a_picture_as_the_viewer_shows_it() -> None:
    viewer = ViewerModel(ndisplay=3)
    layer = viewer.add_image(ball(), scale=(2, 1, 1), colormap="magma", contrast_limits=(10, 90))
    # Before napari 0.9 the viewer itself has the camera.
    camera = getattr(viewer, "scene", viewer).camera
    camera.angles = (10, 20, 30)
    widget = widget_of(viewer)
    assert widget.image_layer.value is layer and widget.preset.value == AS_IN_LAYER
    picture = widget.render()
    assert np.asarray(picture).shape == (32, 48, 4)
    # The same by hand: vectors in the order x, y, z, and the colours between the limits.
    magma = layer.colormap.map(np.linspace(0, 1, 65))[:, :3]
    values = np.linspace(10, 90, 65)
    by_hand = sheetsplat.render(
        ball(),
        spacing=(2, 1, 1),
        image={"width": 48, "height": 32},
        camera={"direction": list(camera.view_direction[::-1]), "up": list(camera.up_direction[::-1])},
        transfer={"color": [[v, np.clip(c, 0, 1).tolist()] for v, c in zip(values, magma)], "opacity": [[10, 0], [90, 1]]},
        splatting={"compositing": "exponential"},
    )
    assert np.asarray(picture).max() > 0.1
    # napari mirrors the world unless its depth axis points away.
    np.testing.assert_array_equal(np.asarray(picture), np.asarray(by_hand)[:, ::-1])
    camera.orientation = ("away", "down", "right")
    camera.angles = (0, 0, 0)
    unmirrored = widget.render()
    bright = np.asarray(unmirrored)[..., :3].sum(axis=(0, 2))
    # The x axis points to the right, and larger x is brighter.
    assert bright[24:].sum() > 1.1 * bright[:24].sum()


def test_larger_x_is_on_the_right_in_the_default_view() -> None:
    viewer = ViewerModel(ndisplay=3)
    viewer.add_image(ball())
    bright = np.asarray(widget_of(viewer).render())[..., :3].sum(axis=(0, 2))
    assert bright[24:].sum() > 1.1 * bright[:24].sum()


def test_presets_labels_and_further_axes() -> None:
    viewer = ViewerModel(ndisplay=3)
    stack = np.stack([ball(), 0.5 * ball()])
    viewer.add_image(stack, scale=(1, 1, 1, 1))
    widget = widget_of(viewer)
    widget.preset.value = "mip"
    viewer.dims.set_current_step(0, 1)
    second = np.asarray(widget.render())
    alone = ViewerModel(ndisplay=3)
    alone.add_image(stack[1])
    other = widget_of(alone)
    other.preset.value = "mip"
    np.testing.assert_array_equal(second, np.asarray(other.render()))
    labels = np.zeros((20, 30, 40), np.uint8)
    alone.add_labels(labels)
    other.label_layer.value = alone.layers[1]
    other.render()
    assert other.label_layer.value is alone.layers[1]


def test_a_pyramid_keeps_the_world_size() -> None:
    viewer = ViewerModel(ndisplay=3)
    viewer.add_image([ball(), ball()[::2, ::2, ::2]], multiscale=True)
    assert np.asarray(widget_of(viewer).render()).max() > 0.1


def test_pictures_are_saved(tmp_path: pathlib.Path) -> None:
    viewer = ViewerModel(ndisplay=3)
    viewer.add_image(ball())
    widget = widget_of(viewer)
    picture = widget.render()
    widget.path.value = tmp_path / "picture.npy"
    np.testing.assert_array_equal(np.load(tmp_path / "picture.npy"), np.asarray(picture))


def test_what_cannot_be_drawn_is_named() -> None:
    viewer = ViewerModel(ndisplay=3)
    widget = widget_of(viewer)
    with pytest.raises(sheetsplat.SceneError, match="layer: found none"):
        widget.render()
    viewer.add_image(np.zeros((4, 4)), name="flat")
    with pytest.raises(sheetsplat.SceneError, match="found 2 dimensions in 'flat'"):
        widget.render()
    viewer.layers.clear()
    viewer.add_image(ball(), rotate=30, name="turned")
    with pytest.raises(sheetsplat.SceneError, match="found 'turned', allowed: a layer that is neither turned"):
        widget.render()
