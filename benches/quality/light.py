#!/usr/bin/env python3
"""Makes docs/guide/light-peers.png: a translucent head with shadows alone, by light sheets, by VTK's volumetric shadows and by a path tracer, and prints PSNR.

    cargo build --release
    python3 benches/fetch.py
    python3 -m venv V && V/bin/pip install mitsuba==3.9.1 vtk==9.7.2 numpy pynrrd pillow
    V/bin/python benches/quality/light.py --sheetsplat target/release/sheetsplat

The path tracer is Mitsuba's `volpath` with single scattering. It gets the field that splatting reconstructs (SPEC §5), twice as fine as the voxels, and |n·l| as
its albedo, so that it sees the same opacities and the same light. `--samples` says how far it has converged.
"""

import argparse
import pathlib
import subprocess
import tempfile

import mitsuba as mi
import nrrd
import numpy as np
import vtkmodules.all as vtk
import vtkmodules.vtkRenderingOpenGL2
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401
from PIL import Image
from vtkmodules.util import numpy_support

ROOT = pathlib.Path(__file__).resolve().parents[2]
SIZE, HEIGHT = 256, 250.0
DIRECTION, UP = np.array([0.45, -0.85, -0.25]), np.array([0.0, 0.0, 1.0])
LIGHT = np.array([0.8, 0.5, 0.4])
OPACITY, ALBEDO = [[35, 0.0], [60, 0.08]], [0.95, 0.85, 0.75]
FALLOFF, RADIUS = 2.0, 2


def gradient_of(values, spacing):
    """Central differences, one-sided at the border (SPEC §3), of an array over x, y, z."""
    return np.stack(np.gradient(values, *spacing), -1)


def finer(amounts):
    """The sum of Gaussians at voxels, with two samples for each voxel."""
    for axis in range(3):
        count = amounts.shape[axis]
        at = (np.arange(2 * count) - 0.5) / 2
        offset = at[:, None] - np.arange(count)[None]
        weights = np.where(np.abs(offset) < RADIUS, np.exp(-FALLOFF * offset**2), 0) * np.sqrt(FALLOFF / np.pi)
        amounts = np.moveaxis(np.tensordot(weights, amounts, (1, axis)), 0, axis)
    return amounts


def path_traced(values, spacing, samples):
    mi.set_variant("scalar_rgb")
    alpha = np.interp(values, *np.transpose(OPACITY))
    amount = -np.log1p(-np.minimum(alpha, 0.9999)) / min(spacing)
    gradient = gradient_of(values, spacing)
    length = np.linalg.norm(gradient, axis=-1)
    toward = np.abs(gradient @ LIGHT) / np.linalg.norm(LIGHT) / np.maximum(length, 1e-12)
    sigma, scattered = finer(amount), finer(amount * toward)
    box = np.array(values.shape) * spacing
    place = mi.ScalarTransform4f().translate(-box / 2).scale(box)

    def grid(data):
        data = np.ascontiguousarray(data.transpose(2, 1, 0)[..., None], np.float32)
        return {"type": "gridvolume", "grid": mi.VolumeGrid(data), "to_world": place, "raw": True}

    medium = {"type": "heterogeneous", "sigma_t": grid(sigma), "albedo": grid(scattered / np.maximum(sigma, 1e-9)), "scale": 1.0}
    eye = mi.ScalarTransform4f().look_at(-1000 * DIRECTION, [0, 0, 0], UP) @ mi.ScalarTransform4f().scale([HEIGHT / 2, HEIGHT / 2, 1])
    light = {"type": "directional", "direction": (-LIGHT).tolist(), "irradiance": {"type": "rgb", "value": 4 * np.pi}}
    cube = {"type": "cube", "to_world": place.translate(0.5).scale(0.5), "bsdf": {"type": "null"}, "interior": medium}
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}}
    sensor = {"type": "orthographic", "to_world": eye, "film": film, "sampler": {"type": "independent", "sample_count": samples}}
    scene = {"type": "scene", "integrator": {"type": "volpath", "max_depth": 2, "rr_depth": 100}, "sensor": sensor, "light": light, "head": cube}
    return np.array(mi.render(mi.load_dict(scene)))[..., :3] * ALBEDO


def by_vtk(values, spacing):
    image = vtk.vtkImageData()
    image.SetDimensions(*values.shape)
    image.SetSpacing(*spacing)
    image.SetOrigin(*(-(np.array(values.shape) - 1) / 2 * spacing))
    image.GetPointData().SetScalars(numpy_support.numpy_to_vtk(np.ascontiguousarray(values.transpose(2, 1, 0)).ravel(), deep=True))
    look, opacity, color = vtk.vtkVolumeProperty(), vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
    for value, alpha in OPACITY:
        opacity.AddPoint(value, alpha)
    color.AddRGBPoint(0, *ALBEDO)
    look.SetScalarOpacity(opacity)
    look.SetColor(color)
    look.SetInterpolationTypeToLinear()
    look.SetScalarOpacityUnitDistance(min(spacing))
    look.ShadeOn()
    look.SetAmbient(0)
    look.SetDiffuse(1)
    look.SetSpecular(0)
    mapper = vtk.vtkOpenGLGPUVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.SetGlobalIlluminationReach(1)
    mapper.SetVolumetricScatteringBlending(2)
    volume, renderer, window, light = vtk.vtkVolume(), vtk.vtkRenderer(), vtk.vtkRenderWindow(), vtk.vtkLight()
    volume.SetMapper(mapper)
    volume.SetProperty(look)
    renderer.AddVolume(volume)
    light.SetPosition(*(1000 * LIGHT))
    light.SetLightTypeToSceneLight()
    renderer.AddLight(light)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(HEIGHT / 2)
    camera.SetPosition(*(-1000 * DIRECTION))
    camera.SetViewUp(*UP)
    window.SetOffScreenRendering(1)
    window.SetSize(SIZE, SIZE)
    window.AddRenderer(renderer)
    renderer.ResetCameraClippingRange()
    window.Render()
    pixels = vtk.vtkUnsignedCharArray()
    window.GetPixelData(0, 0, SIZE - 1, SIZE - 1, 0, pixels, 0)
    return numpy_support.vtk_to_numpy(pixels).reshape(SIZE, SIZE, 3)[::-1] / 255


def by_sheets(program, values, spacing, folder, shadow):
    nrrd.write(str(folder / "head.nrrd"), values.astype(np.uint8), {"spacings": list(spacing)})
    (folder / "scene.toml").write_text(f"""
volume.path = "head.nrrd"
camera = {{direction = {DIRECTION.tolist()}, height = {HEIGHT}}}
image = {{width = {SIZE}, height = {SIZE}}}
transfer = {{color = [[0, {ALBEDO}]], opacity = {OPACITY}}}
shading = {{light = {LIGHT.tolist()}, ambient = 0, diffuse = 1, specular = 0, shadow = {shadow}, shadow_spread = 0, light_step = 1}}
splatting = {{compositing = "exponential", classification = "before", opacity_threshold = 1, slab_width = 0.5}}
""")
    subprocess.run([program, "render", folder / "scene.toml", "--backend", "cpu", "-o", folder / "image.npy"], check=True)
    return np.load(folder / "image.npy")[..., :3]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sheetsplat", default=ROOT / "target/release/sheetsplat")
    parser.add_argument("--volume", default=ROOT.parent / "shared/data/mr-head.nrrd")
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--to", type=pathlib.Path, default=ROOT / "docs/guide/light-peers.png")
    options = parser.parse_args()
    values, header = nrrd.read(str(options.volume))
    spacing = 2 * np.array(header["spacings"])
    values = values[::2, ::2, ::2].astype(float)
    with tempfile.TemporaryDirectory() as folder:
        sheets, unshadowed = (by_sheets(options.sheetsplat, values, spacing, pathlib.Path(folder), shadow) for shadow in (1, 0))
    traced = path_traced(values, spacing, options.samples)
    peer = by_vtk(values, spacing)

    # Noise would decide the maximum.
    peak = np.quantile(traced, 0.999)

    def psnr(image):
        return 10 * np.log10(peak**2 / np.mean((image - traced) ** 2))

    print(f"to the path tracer: {psnr(sheets):.1f} dB, without shadows {psnr(unshadowed):.1f} dB, VTK {psnr(peer):.1f} dB")
    strip = np.concatenate([sheets, peer, traced], 1) / peak
    Image.fromarray((np.clip(strip, 0, 1) * 255 + 0.5).astype(np.uint8)).save(options.to, optimize=True)


main()
