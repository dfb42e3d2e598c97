"""Parts of pictures."""

import pickle

import numpy as np
import pytest

import sheetsplat
from sheetsplat import MergeError, Part, SceneError, View, merge

SETTINGS = {"image": {"width": 40, "height": 32}, "splatting": {"opacity_threshold": 1}}


@pytest.fixture
def view():
    return View("builtin:head:32", **SETTINGS)


def farthest(merged, whole):
    """The largest difference of pictures, the first of which shows something."""
    merged, whole = np.asarray(merged), np.asarray(whole)
    assert np.isfinite(merged).all()
    assert whole[..., 3].max() > 0.5
    return np.abs(merged - whole).max()


@pytest.mark.parametrize("classification", ["before", "after"])
@pytest.mark.parametrize("compositing", ["linear", "exponential", "xray", "maximum"])
def test_parts_merge_to_the_picture(classification, compositing):
    # Noise, because rounding decides which of equal sheets in homogeneous matter is the greatest.
    noise = np.random.default_rng(1).normal(size=(20, 24, 22))
    view = View(noise, **SETTINGS)
    view.set(splatting={"classification": classification, "compositing": compositing})
    regions = [(0, 0, 40, 10), (0, 10, 23, 22), (23, 10, 17, 22)]
    parts = [view.part(slabs=slabs, region=region) for slabs in [(-900, 3), (3, 900)] for region in regions]
    assert farthest(merge(reversed(parts)), view.render()) < 1e-6


def test_a_split_merges_to_the_picture(view):
    pieces = view.split(6)
    assert len(pieces) == 6
    assert farthest(merge(view.part(**piece) for piece in pieces), view.render()) < 1e-6


def test_parts_are_pickled_and_saved(view, tmp_path):
    front, back = view.part(slabs=(-900, 0)), view.part(slabs=(0, 900))
    sent = pickle.loads(pickle.dumps(front))
    assert (sent.slabs, sent.region, sent.stats) == (front.slabs, front.region, front.stats)
    assert sent.stats["voxels_total"] > 0
    for name in ["back.exr", "back.npz"]:
        back.save(tmp_path / name)
        saved = Part.open(tmp_path / name)
        np.testing.assert_array_equal(merge([saved, sent]), merge([front, back]))
    assert "slabs (0, " in repr(saved)


def test_what_does_not_fit_together_is_named(view, tmp_path):
    front, back = view.part(slabs=(-900, 0)), view.part(slabs=(0, 900))
    with pytest.raises(MergeError, match="slabs"):
        merge([front])
    with pytest.raises(MergeError, match="slabs"):
        merge([front, back, back])
    with pytest.raises(ValueError):
        merge([])
    view.set(camera={"direction": [1, 0, 0]})
    with pytest.raises(MergeError, match="scene"):
        merge([front, view.part(slabs=(0, 900))])
    with pytest.raises(SceneError, match="region") as caught:
        view.part(region=(0, 0, 41, 1))
    assert caught.value.key == "region"
    with pytest.raises(SceneError, match="count"):
        view.split(0)
    with pytest.raises(sheetsplat.FileError):
        Part.open(tmp_path / "none.exr")
    with pytest.raises(TypeError):
        Part()


def test_light_from_a_file_gives_the_same_pictures(tmp_path):
    look = {
        "transfer": {"opacity": [[40, 0], [70, 0.6]]},
        "shading": {"light": [-1, -2, 2], "shadow": 0.8},
        "image": {"width": 40, "height": 30},
    }
    view, path = sheetsplat.View("builtin:head:24", **look), tmp_path / "light.npz"
    view.save_light(path)
    lit = sheetsplat.View("builtin:head:24", light=path, **look)
    np.testing.assert_array_equal(lit.render(), view.render())
    assert "light_ms" in view.render().stats and "light_ms" not in lit.render().stats
    with pytest.raises(sheetsplat.SceneError, match=r"shadow\.spread"):
        lit.set(shading={"shadow_spread": 0.25})
    np.testing.assert_array_equal(lit.render(), view.render())
    with pytest.raises(sheetsplat.ImageError, match="extension"):
        view.save_light(tmp_path / "light.png")
    with pytest.raises(sheetsplat.SceneError, match="without light sheets"):
        sheetsplat.View("builtin:nerve:16").save_light(path)
