#!/usr/bin/env python3
"""Renders one of our scene files with VTK, without a window, and prints its times as one line of JSON.

It compares sheetsplat with VTK's two volume ray casters on the same machine:

    apt-get install -y libegl1 libgl1-mesa-dri libosmesa6
    python3 -m venv venv && venv/bin/pip install vtk==9.7.2 numpy pynrrd pillow
    venv/bin/python vtk_bench.py SCENE.toml --mapper gpu

`--mapper gpu` is vtkOpenGLGPUVolumeRayCastMapper, on the machine's OpenGL (llvmpipe without a GPU); `--mapper cpu` is
vtkFixedPointVolumeRayCastMapper. Every frame turns the camera as `sheetsplat bench --rotate` does, and is finished and read back before the clock stops.
Opacities are per smallest voxel spacing, like ours. Run both programs alternately, because a machine's speed varies.
"""

import argparse
import json
import os
import pathlib
import statistics
import time
import tomllib


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("--mapper", choices=["gpu", "cpu"], default="gpu")
    parser.add_argument("--frames", type=int, default=7)
    parser.add_argument("--rotate", type=float, default=1.0, help="degrees between frames")
    parser.add_argument("--step", type=float, default=1.0, help="sample distance, in smallest voxel spacings")
    parser.add_argument("--size", type=int, help="width and height, instead of the scene's")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--png", type=pathlib.Path, help="where to save the first frame")
    return parser.parse_args()


def load(scene, folder):
    """The scene's NRRD file as a VTK image around the origin, and its smallest spacing."""
    import nrrd
    import numpy as np
    import vtkmodules.all as vtk
    from vtkmodules.util.numpy_support import numpy_to_vtk

    values, header = nrrd.read(str(folder / scene["volume"]["path"]))
    spacing = np.array(scene["volume"].get("spacing", header.get("spacings", [1.0, 1.0, 1.0])), dtype=float)
    image = vtk.vtkImageData()
    image.SetDimensions(*map(int, values.shape))
    image.SetSpacing(*spacing)
    image.SetOrigin(*(-(np.array(values.shape) - 1) / 2 * spacing))
    # In VTK, x is fastest.
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values.T).ravel(), deep=True))
    return image, float(spacing.min())


def appearance(scene, unit):
    """The scene's transfer function and material."""
    import vtkmodules.all as vtk

    transfer, shading = scene["transfer"], scene.get("shading", {})
    opacity, color = vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
    for value, alpha in transfer["opacity"]:
        opacity.AddPoint(value, alpha)
    for value, rgb in transfer["color"]:
        color.AddRGBPoint(value, *rgb)
    volume_property = vtk.vtkVolumeProperty()
    volume_property.SetScalarOpacity(opacity)
    volume_property.SetColor(color)
    volume_property.SetInterpolationTypeToLinear()
    volume_property.SetScalarOpacityUnitDistance(unit)
    if "gradient_opacity" in transfer:
        by_gradient = vtk.vtkPiecewiseFunction()
        for magnitude, factor in transfer["gradient_opacity"]:
            by_gradient.AddPoint(magnitude, factor)
        volume_property.SetGradientOpacity(by_gradient)
    if shading.get("enabled", True):
        volume_property.ShadeOn()
        volume_property.SetAmbient(shading.get("ambient", 0.2))
        volume_property.SetDiffuse(shading.get("diffuse", 0.7))
        volume_property.SetSpecular(shading.get("specular", 0.2))
        volume_property.SetSpecularPower(shading.get("shininess", 20))
    return volume_property


def caster(options, image, unit):
    import vtkmodules.all as vtk

    if options.mapper == "gpu":
        mapper = vtk.vtkOpenGLGPUVolumeRayCastMapper()
    else:
        mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        mapper.SetNumberOfThreads(options.threads)
        mapper.SetInteractiveSampleDistance(options.step * unit)
    # No shortcuts: one ray per pixel, one sample per step.
    mapper.AutoAdjustSampleDistancesOff()
    mapper.SetImageSampleDistance(1.0)
    mapper.SetSampleDistance(options.step * unit)
    mapper.SetInputData(image)
    return mapper


class Stage:
    """A window in memory with the volume under a headlight."""

    def __init__(self, options, scene, folder):
        import vtkmodules.all as vtk

        image, self.unit = load(scene, folder)
        self.loaded = time.perf_counter()
        self.size = (options.size, options.size) if options.size else (scene["image"]["width"], scene["image"]["height"])
        volume = vtk.vtkVolume()
        volume.SetMapper(caster(options, image, self.unit))
        volume.SetProperty(appearance(scene, self.unit))
        self.renderer = vtk.vtkRenderer()
        self.renderer.SetBackground(*scene["image"].get("background", [0, 0, 0, 1])[:3])
        self.renderer.AddVolume(volume)
        light = vtk.vtkLight()
        light.SetLightTypeToHeadlight()
        light.SetAmbientColor(1, 1, 1)
        self.renderer.AddLight(light)
        self.window = vtk.vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(*self.size)
        self.window.AddRenderer(self.renderer)
        self.pixels = vtk.vtkUnsignedCharArray()
        self.camera = scene["camera"]

    def draw(self, degrees):
        """One frame, turned right-handed about `up`, read back as rows from the top."""
        import numpy as np
        from vtkmodules.util.numpy_support import vtk_to_numpy

        ahead, up = (np.array(self.camera.get(key, default), dtype=float) for key, default in (("direction", [0, 1, 0]), ("up", [0, 0, 1])))
        ahead, up, angle = ahead / np.linalg.norm(ahead), up / np.linalg.norm(up), np.radians(degrees)
        ahead = ahead * np.cos(angle) + np.cross(up, ahead) * np.sin(angle) + up * (up @ ahead) * (1 - np.cos(angle))
        camera = self.renderer.GetActiveCamera()
        camera.SetFocalPoint(0, 0, 0)
        camera.SetViewUp(*up)
        if self.camera.get("projection") == "perspective":
            camera.ParallelProjectionOff()
            camera.SetViewAngle(self.camera.get("fov_y", 30.0))
            camera.SetPosition(*(-self.camera["distance"] * ahead))
        else:
            camera.ParallelProjectionOn()
            camera.SetPosition(*(-1000 * self.unit * ahead))
            camera.SetParallelScale(self.camera["height"] / 2)
        self.renderer.ResetCameraClippingRange()
        self.window.Render()
        width, height = self.size
        self.window.GetPixelData(0, 0, width - 1, height - 1, 0, self.pixels, 0)
        return vtk_to_numpy(self.pixels).reshape(height, width, 3)[::-1].copy()

    def driver(self):
        lines = (self.window.ReportCapabilities() or "").splitlines()
        found = [line.split(":", 1)[1].strip() for line in lines if line.startswith("OpenGL renderer string:")]
        return found[0] if found else None


def peak_rss_mib():
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) // 1024 for line in lines if line.startswith("VmHWM"))


def main():
    options = arguments()
    # A cache on disk would hide the cost of a first frame.
    os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
    start = time.perf_counter()
    import vtkmodules.all as vtk
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401

    vtk.vtkSMPTools.Initialize(options.threads)
    vtk.vtkMultiThreader.SetGlobalDefaultNumberOfThreads(options.threads)
    scene = tomllib.loads(options.scene.read_text())
    stage = Stage(options, scene, options.scene.parent)
    first = stage.draw(0)
    drawn = time.perf_counter()
    times = []
    for frame in range(1, options.frames + 1):
        before = time.perf_counter()
        stage.draw(frame * options.rotate)
        times.append((time.perf_counter() - before) * 1000)
    if options.png:
        from PIL import Image

        Image.fromarray(first).save(options.png)
    print(json.dumps({
        "peer": f"vtk-{options.mapper}",
        "version": vtk.vtkVersion.GetVTKVersion(),
        "driver": stage.driver(),
        "scene": options.scene.name,
        "size": stage.size,
        "step": options.step,
        "load_ms": round((stage.loaded - start) * 1000),
        "first_frame_ms": round((drawn - stage.loaded) * 1000),
        "median_frame_ms": round(statistics.median(times), 1),
        "min_frame_ms": round(min(times), 1),
        "max_frame_ms": round(max(times), 1),
        "peak_rss_mib": peak_rss_mib(),
    }))


if __name__ == "__main__":
    main()
