"""Words beside pictures."""

import pathlib

import numpy as np
import pytest
import sheetsplat

ROOT = pathlib.Path(__file__).parents[2]
SOURCE = "builtin:marschner-lobb:12"
SIZE = {"width": 200, "height": 160}


def test_words_are_the_bytes_of_the_program() -> None:
    image = sheetsplat.render(SOURCE, image=SIZE, annotate=["scale", "colors"])
    expected = sheetsplat.Image.open(ROOT / "tests" / "fixtures" / "annotated.png")
    np.testing.assert_array_equal(image.to_uint8(), expected.to_uint8())
    np.testing.assert_array_equal(image, sheetsplat.render(SOURCE, image=SIZE, annotate="scale,colors"))


def test_views_keep_words_when_the_scene_changes() -> None:
    view = sheetsplat.View(SOURCE, image=SIZE, camera={"height": 20, "direction": [0, 1, 0]}, annotate="scale")
    first = np.asarray(view.render())
    second = np.asarray(view.render(camera={"height": 20, "direction": [1, 0, 0]}))
    assert first.shape == second.shape == (160, 200, 4)
    # The bar at the bottom is there in both.
    np.testing.assert_array_equal(first[-6:-4, :12], second[-6:-4, :12])
    assert first[-6:-4, 4:12].min() == 1
    turned = [np.asarray(picture) for picture in view.orbit(count=2)]
    assert turned[0].shape == (160, 200, 4)
    assert (turned[0] != turned[1]).any()


def test_errors_name_the_annotation() -> None:
    with pytest.raises(sheetsplat.SceneError, match="annotate: found axes, allowed: scale, colors, legend, sides"):
        sheetsplat.render(SOURCE, annotate="axes")
    with pytest.raises(sheetsplat.SceneError, match="annotate: sides: found a volume that states no patient"):
        sheetsplat.render(SOURCE, annotate="sides")
    with pytest.raises(sheetsplat.SceneError, match="annotate"):
        sheetsplat.View(SOURCE, annotate="scale").part(region=(0, 0, 8, 8))
    with pytest.raises(sheetsplat.SceneError, match="names of annotations"):
        sheetsplat.render(SOURCE, annotate=[3])  # type: ignore[list-item]
