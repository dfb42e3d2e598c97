"""Words such as `cmap` and `view`, in place of keys of scene files."""

import inspect
import pickle
import typing

import numpy as np
import pytest

import sheetsplat
from sheetsplat import Scene, SceneError, View, Volume, render

SMALL = (40, 32)


def ball(size: int = 16) -> np.ndarray:
    z, y, x = np.ogrid[-1 : 1 : size * 1j, -1 : 1 : size * 1j, -1 : 1 : size * 1j]
    return np.round(100 * np.clip(1.2 - x * x - 2 * y * y - 3 * z * z, 0, 1))


class Nifti:
    """As much of an image of nibabel as is read: x to the left, y to the back, z to the head."""

    affine = np.array([[-1.0, 0, 0, -10], [0, -2.0, 0, -20], [0, 0, 3.0, 30], [0, 0, 0, 1]])
    dataobj = ball().T


def keys(source: object = None, **words: object) -> dict[str, typing.Any]:
    """The scene as it is drawn."""
    return View(ball() if source is None else source, **words).scene.to_dict()  # type: ignore[arg-type]


def test_ten_first_lines() -> None:
    """Lines in the words of PyVista and matplotlib do what they say."""
    values = ball()
    black = np.asarray(render(values, size=SMALL))
    assert black.shape == (32, 40, 4)
    assert render(values, size=24).width == 24
    np.testing.assert_array_equal(np.asarray(render(values, size=SMALL, background="white"))[0, 0], [1, 1, 1, 1])
    assert keys(cmap="magma") == keys(transfer={"colormap": "magma"})
    assert keys(colormap="magma") == keys(cmap="magma")
    clim = keys(cmap="gray", clim=[40, 90])["transfer"]
    assert clim["color"] == [[40, [0, 0, 0]], [90, [1, 1, 1]]] and clim["opacity"] == [[40, 0], [90, 1]]
    assert keys(cmap="gray", vmin=40, vmax=90)["transfer"] == clim
    assert keys(opacity="linear")["transfer"]["opacity"] == [[0, 0], [100, 1]]
    assert keys(opacity="linear_r", clim=(20, 60))["transfer"]["opacity"] == [[20, 1], [60, 0]]
    assert keys(opacity=[0, 0.1, 0.9])["transfer"]["opacity"] == [[0, 0], [50, 0.1], [100, 0.9]]
    sigmoid = keys(opacity="sigmoid")["transfer"]["opacity"]
    assert sigmoid[0] == [0, 0] and sigmoid[16] == [50, pytest.approx(0.5, abs=0.01)] and sigmoid[-1] == [100, 1]
    assert sigmoid[20][1] == round(255 / (1 + np.exp(-2.5))) / 255
    for view, direction, up in (("iso", [-1, -1, -1], [0, 0, 1]), ("xy", [0, 0, -1], [0, 1, 0]), ("yz", [-1, 0, 0], [0, 0, 1])):
        camera = keys(view=view)["camera"]
        assert (camera["direction"], camera["up"]) == (direction, up)
    assert keys(Nifti(), view="left") == keys(Nifti(), side="left") != keys(Nifti(), view="right")
    turned = keys(view="xz", azimuth=90)["camera"]["direction"]
    np.testing.assert_allclose(turned, [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(keys(view="xz", elevation=30)["camera"]["direction"], [0, 0.75**0.5, -0.5], atol=1e-12)
    near, far = View(values, zoom=2), View(values)
    height = far.scene.explicit(far.volume).to_dict()["camera"]["height"]
    assert near.scene.to_dict()["camera"]["height"] == height / 2
    assert len([*sheetsplat.orbit(values, count=2, size=16, cmap="hot", zoom=1.5)]) == 2


@pytest.mark.parametrize("view", ["xy", "xz", "yz", "yx", "zx", "zy"])
def test_axes_of_views(view: str) -> None:
    """The first axis points right and the second up: a voxel far along it is right of, or above, the middle."""
    for axis, (column, row) in zip(view, ((1, 0), (0, 1)), strict=True):
        values = np.zeros((9, 9, 9))
        place = [4, 4, 4]
        place["zyx".index(axis)] = 8
        values[tuple(place)] = 1
        picture = np.asarray(render(values, view=view, size=33, camera={"fit": "volume"}, opacity="linear", clim=(0, 1)))
        rows, columns = np.nonzero(picture[..., :3].sum(axis=2) > 0.1)
        right, up = columns.mean() - 16, 16 - rows.mean()
        assert right * column + up * row > 6 and abs(right * row + up * column) < 1.5, (axis, right, up)


def test_cmaps_of_matplotlib() -> None:
    matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    ends = keys(cmap="bone", clim=(0, 100))["transfer"]["color"]
    expected = matplotlib.colormaps["bone"](np.arange(0, 256, 5))[:, :3]
    np.testing.assert_allclose([color for _, color in ends], expected, rtol=1e-12)
    assert keys(cmap=lambda shares: np.stack([shares, shares, 0 * shares], axis=1), clim=(0, 1))["transfer"]["color"][-1][1] == [1, 1, 0]
    assert keys(cmap=matplotlib.colormaps["bone"], clim=(0, 100))["transfer"]["color"] == ends
    backwards = keys(cmap="bone_r", clim=(0, 100))["transfer"]["color"]
    np.testing.assert_allclose([color for _, color in backwards], [color for _, color in reversed(ends)], rtol=1e-12)
    # Over the visible values, as maps of scene files.
    assert keys(cmap="bone")["transfer"]["color"][0][0] == keys_of_map("gray")[0][0]


def keys_of_map(name: str) -> list[list[typing.Any]]:
    view = View(ball(), cmap=name)
    return view.scene.explicit(view.volume).to_dict()["transfer"]["color"]


def test_reversed_maps_and_colors() -> None:
    forward, backward = keys_of_map("plasma"), keys_of_map("plasma_r")
    assert [color for _, color in forward] == [color for _, color in reversed(backward)]
    assert [value for value, _ in forward] == [value for value, _ in backward]
    assert keys(cmap=["black", [1, 0, 0]], clim=(0, 10))["transfer"]["color"] == [[0, [0, 0, 0]], [10, [1, 0, 0]]]
    assert {"viridis", "viridis_r", "gray_r", "file"} <= set(sheetsplat.colormaps())
    for name in sheetsplat.colormaps():
        if name != "file":
            Scene(cmap=name, clim=(0, 1)).to_toml()


def test_one_end_of_the_range_is_the_volumes() -> None:
    assert keys(vmin=40)["transfer"]["opacity"] == [[40, 0], [100, 1]]
    assert keys(vmax=40)["transfer"]["opacity"] == [[0, 0], [40, 1]]
    with pytest.raises(SceneError, match="vmin: found values from 200 to 100"):
        View(ball(), vmin=200)


def test_words_are_the_same_everywhere() -> None:
    words = {"cmap": "hot_r", "clim": (20, 90), "size": SMALL, "view": "iso", "azimuth": 20, "zoom": 1.5}
    expected = np.asarray(render(ball(), **words))
    scene = Scene(**words)
    for again in (scene, pickle.loads(pickle.dumps(scene)), Scene(words), Scene().replace(**words), Scene(scene)):
        np.testing.assert_array_equal(render(ball(), scene=again), expected)
        assert again == scene
    view = View(ball(), size=SMALL)
    np.testing.assert_array_equal(view.render(**words), expected)
    # Each word is from where the camera would be, however often it is said.
    np.testing.assert_array_equal(view.render(azimuth=20, zoom=1.5), expected)
    np.testing.assert_array_equal(view.render(**{"image.width": SMALL[0]}), expected)
    np.testing.assert_array_equal(render(ball(), scene=view.scene.to_toml()), expected)
    turns = [np.asarray(image) for _, image in sheetsplat.sweep(ball(), {"azimuth": [0, 20]}, **{**words, "azimuth": 5})]
    np.testing.assert_array_equal(turns[1], expected)
    assert (turns[0] != expected).any()
    assert "zoom=1.5" in repr(scene) and "view" not in repr(scene).splitlines()[0]
    with pytest.raises(SceneError, match="azimuth, zoom: found words that depend on the volume"):
        scene.to_toml()
    explicit = scene.explicit(Volume(ball()))
    np.testing.assert_array_equal(render(ball(), scene=explicit), expected)


def test_the_last_one_counts() -> None:
    scene = Scene(cmap="hot", view="xy", azimuth=30, clim=(0, 1))
    assert scene.replace(cmap=None, azimuth=None, clim=None) == Scene(view="xy")
    assert scene.replace(view="iso", cmap=None, clim=None) == Scene(view="iso")
    assert Scene(clim=(10, 20)).replace(vmin=5) == Scene(vmin=5, vmax=20) == Scene(clim=(5, 20))
    assert Scene(vmin=5).replace(clim=(1, 2)) == Scene(clim=(1, 2))
    assert Scene(view="iso").replace(camera={"direction": [1, 0, 0]}).to_dict()["camera"]["direction"] == [1, 0, 0]
    colored = Scene(transfer={"color": [[0, [1, 0, 0]]]}).replace(cmap="hot")
    assert colored.to_dict()["transfer"] == {"colormap": "hot"}
    assert colored.replace(transfer={"color": [[0, [1, 0, 0]]]}).to_dict()["transfer"] == {"color": [[0, [1, 0, 0]]]}


@pytest.mark.parametrize(
    ("words", "key", "parts"),
    [
        ({"clim": (0, 1), "vmin": 0}, "clim", ["clim beside vmin", "one of clim and vmin"]),
        ({"cmap": "hot", "colormap": "hot"}, "colormap", ["colormap beside cmap"]),
        ({"view": "iso", "side": "front"}, "side", ["side beside view"]),
        ({"cmap": "hot", "transfer": {"color": [[0, [0, 0, 0]]]}}, "cmap", ["cmap beside transfer.color"]),
        ({"opacity": "linear", "transfer.opacity": [[0, 0]]}, "opacity", ["opacity beside transfer.opacity"]),
        ({"size": 8, "image": {"width": 8}}, "size", ["size beside image.width"]),
        ({"view": "xy", "camera": {"up": [0, 1, 0]}}, "view", ["view beside camera.up"]),
        ({"clim": (1, 0)}, "clim", ["(1, 0)", "the first less than the second"]),
        ({"clim": (0, float("nan"))}, "clim", ["nan"]),
        ({"clim": 5}, "clim", ["5"]),
        ({"clim": (0, 1), "preset": "xray"}, "clim", ["the preset xray"]),
        ({"clim": (0, 1), "opacity": [[0, 0], [1, 1]]}, "clim", ["opacity with values of its own"]),
        ({"cmap": "viridiss"}, "cmap", ["'viridiss' (perhaps viridis)", "viridis_r"]),
        ({"colormap": 5}, "colormap", ["5"]),
        ({"cmap": []}, "cmap", ["[]"]),
        ({"cmap": ["red", "nocolor"], "clim": (0, 1)}, "cmap", ["nocolor"]),
        ({"opacity": "sigmoids"}, "opacity", ["(perhaps sigmoid)", "linear_r"]),
        ({"opacity": [0, 2], "clim": (0, 1)}, "opacity", ["2", "[0, 1]"]),
        ({"opacity": [[0, 0], 1]}, "opacity", ["[[0, 0], 1]"]),
        ({"opacity": 0.5}, "opacity", ["0.5"]),
        ({"background": "wihte"}, "background", ["wihte"]),
        ({"size": (0, 5)}, "size", ["0"]),
        ({"size": (1, 2, 3)}, "size", ["(1, 2, 3)"]),
        ({"size": "800x600"}, "size", ["'800x600'"]),
        ({"view": "font"}, "view", ["'font' (perhaps front)", "iso"]),
        ({"zoom": 0}, "zoom", ["0", "above 0"]),
        ({"azimuth": float("inf")}, "azimuth", ["inf"]),
        ({"elevation": "up"}, "elevation", ["'up'"]),
        ({"cmpa": "hot"}, "cmpa", ["perhaps cmap"]),
        ({"back_ground": "white"}, "back_ground", ["perhaps background"]),
        ({"window_size": (8, 8)}, "window_size", ["perhaps size"]),
        ({"camera_position": "xy"}, "camera_position", ["perhaps view"]),
        ({"blending": "maximum"}, "blending", ["perhaps splatting={'compositing': ...}"]),
    ],
)
def test_errors_name_the_words(words: dict[str, typing.Any], key: str, parts: list[str]) -> None:
    for make in (lambda: Scene(**words), lambda: render(ball(), **words), lambda: Scene({**words})):
        with pytest.raises(SceneError) as caught:
            make()
        assert caught.value.key == key
        assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_errors_that_need_the_volume() -> None:
    for words, message in (
        ({"elevation": 89, "view": "iso"}, "elevation: found 89, which puts the eye .* allowed: at most 89"),
        ({"view": "front"}, "view: found a volume without orientation, allowed: .*iso, xy"),
        ({"side": "front"}, "side: found a volume without orientation"),
        ({"cmap": "file"}, "transfer.colormap"),
    ):
        with pytest.raises(SceneError, match=message):
            render(ball(), **words)  # type: ignore[arg-type]


def test_one_label_alone() -> None:
    """By name or number, of labels beside values and of a label map; the program's `--only` is the same."""
    tomato = Volume("builtin:tomato:24")
    alone = render(tomato, only="seeds", size=SMALL)
    assert alone == render(tomato, only=5, size=SMALL) == render(tomato, only="5", size=SMALL)
    assert alone == View(tomato, size=SMALL).render(only="seeds") != render(tomato, size=SMALL)
    look = Scene(size=SMALL, view="xz")
    expected = Scene._of(sheetsplat._native.only(look._native, tomato._native, "seeds"))
    assert render(tomato, scene=look, only="seeds") == render(tomato, scene=expected)
    near = View(tomato, only="seeds", size=SMALL, zoom=2, cmap="hot_r")
    height = View(tomato, only="seeds", size=SMALL, cmap="hot_r").scene.explicit(tomato).to_dict()["camera"]["height"]
    assert near.scene.to_dict()["camera"]["height"] == height / 2
    labels = np.zeros((12, 12, 12), np.int64)
    for number, label in enumerate((3, 100_000, 7)):
        labels[4 * number : 4 * number + 4, 2:10, 2:10] = label
    beside = Volume(labels % 11, labels=labels)
    table = [{"label": label, "visible": label == 100_000} for label in (0, 3, 7, 100_000)]
    assert render(beside, only=100_000, size=SMALL, preset="none") == render(
        beside, transfer={"label": table}, size=SMALL, preset="none"
    )
    label_map = Volume(np.where(labels == 100_000, 5, labels))
    assert keys(label_map, only=7, preset="labels")["transfer"]["iso_ranges"] == [[7, 7]]
    for source, label, message in (
        (tomato, "seed", 'only: found "seed", allowed: .*"seeds"'),
        (beside, 4, 'only: found "4", allowed: 0, 3, 7, 100000'),
        (ball(), 1, "only: found .*a label map, or a volume with labels"),
        (tomato, -1, "only: found -1, allowed: a whole number from 0"),
        (tomato, 1.5, "only: found 1.5"),
    ):
        with pytest.raises(SceneError, match=message):
            render(source, only=label)  # type: ignore[arg-type]


def test_misspelt_keywords_of_each_function() -> None:
    for call, meant in (
        (lambda: render(ball(), spacin=2), "spacing"),  # type: ignore[call-arg]
        (lambda: sheetsplat.orbit(ball(), cout=2), "count"),  # type: ignore[call-overload]
        (lambda: View(ball()).render(siz=2), "size"),  # type: ignore[call-arg]
        (lambda: View(ball()).set(zom=2), "zoom"),  # type: ignore[call-arg]
        (lambda: sheetsplat.sweep(ball(), {"azimut": [1]}), "azimuth"),
        (lambda: sheetsplat.sweep(ball(), {}, backend_="cpu"), "backend"),  # type: ignore[call-arg]
    ):
        with pytest.raises(SceneError, match=rf"an unknown keyword \(perhaps {meant}\)"):
            call()


def test_names() -> None:
    from sheetsplat import _settings as settings

    assert list(typing.get_args(settings.Preset)) == sheetsplat.presets()
    assert sheetsplat.__version__.count(".") == 2
    assert set(settings.VIEWS) < set(typing.get_args(settings.Side))
    for side in set(typing.get_args(settings.Side)) - set(settings.VIEWS):
        Scene(view=side)


@pytest.mark.parametrize("function", [render, View, View.render, View.set, Scene, Scene.replace, sheetsplat.orbit, sheetsplat.sweep])
def test_signatures_have_the_words(function: typing.Any) -> None:
    """Notebooks complete what a signature names."""
    names = set(inspect.signature(function).parameters)
    words = {"preset", "camera", "cmap", "clim", "vmin", "vmax", "opacity", "background", "size", "view", "side", "azimuth", "zoom"}
    assert words <= names
    assert ("backend" in names) == (function in (render, View, sheetsplat.orbit, sheetsplat.sweep))
