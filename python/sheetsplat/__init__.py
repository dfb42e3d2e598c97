"""Pictures of 3D scalar volumes, without a display, a driver or a system package.

>>> import numpy as np
>>> import sheetsplat
>>> volume = np.random.default_rng(1).normal(size=(8, 8, 8))
>>> image = sheetsplat.render(volume, spacing=(2, 1, 1), image={"width": 64, "height": 64})
>>> image
<sheetsplat.Image of 64×64 pixels>
"""

import atexit
from typing import TYPE_CHECKING, Any

from . import _native
from ._colors import colormaps
from ._native import __version__, presets
from .comparison import Comparison, compare
from .errors import (
    DeviceError,
    FileError,
    GoldenError,
    ImageError,
    MergeError,
    RenderError,
    SceneError,
    SheetsplatError,
    SheetsplatWarning,
    VolumeError,
)
from .image import Image
from .part import Part, merge
from .scene import Scene
from .turntable import orbit, sweep
from .verification import Verification, verify
from .view import View, info, render
from .volume import Volume

__all__ = [
    "Comparison",
    "DeviceError",
    "FileError",
    "GoldenError",
    "Image",
    "ImageError",
    "MergeError",
    "Part",
    "RenderError",
    "Scene",
    "SceneError",
    "SheetsplatError",
    "SheetsplatWarning",
    "Verification",
    "View",
    "Volume",
    "VolumeError",
    "__version__",
    "colormaps",
    "compare",
    "info",
    "merge",
    "orbit",
    "presets",
    "render",
    "sweep",
    "verify",
]

atexit.register(_native.tidy)


if TYPE_CHECKING:
    from .widget import Widget as Widget
else:
    # Type checkers would take any name for one of this module.
    def __getattr__(name: str) -> Any:
        # Only the widget needs anywidget.
        if name == "Widget":
            from .widget import Widget

            return Widget
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), "Widget"])
