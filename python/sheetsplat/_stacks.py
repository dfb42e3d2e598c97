"""Arrays of four and five dimensions without names, in the order of files `.npy`: colours, channels and times."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ._checks import volume_refused as refused
from ._checks import whole
from .errors import VolumeError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["ALLOWED", "MOST_CHANNELS", "Colors", "channels_at", "colors", "is_colors", "time_of"]

#: The most channels that a file may have.
MOST_CHANNELS = 64

ALLOWED = "three dimensions z, y, x; z, y, x and 3 or 4 of a colour; c, z, y, x; or t, c, z, y, x"


class Colors(NamedTuple):
    """The colours of voxels."""

    #: `[z, y, x, 4]`, contiguous.
    numbers: NDArray[np.float32]
    #: The type of the numbers: ``u1`` and ``u2`` are shares of 255 and 65535, ``f4`` shares of 1.
    kind: str


def is_colors(shape: tuple[int, ...]) -> bool:
    """Whether the last of four dimensions is a colour."""
    return len(shape) == 4 and shape[3] in (3, 4)


def colors(values: NDArray[Any]) -> Colors:
    """The colours that an array `[z, y, x, 3 or 4]` holds: integers, or floating-point numbers from 0 to 1."""
    import numpy as np

    allowed = "uint8, uint16, other integers from 0 to 255, or floating-point numbers from 0 to 1"
    kind = values.dtype.kind
    if kind not in "iuf":
        raise refused("dtype", f"colours of {values.dtype}", allowed)
    full, name = (1, "f4") if kind == "f" else (65535, "u2") if values.dtype.itemsize == 2 and kind == "u" else (255, "u1")
    least, most = (values.min(), values.max()) if values.size else (0, 0)
    # NaN is a hole, and lets itself be compared with nothing.
    if least < 0 or most > full:
        raise refused("colours", f"{values.dtype} from {least:g} to {most:g}", allowed)
    numbers = np.full((*values.shape[:3], 4), full, dtype=np.float32)
    numbers[..., : values.shape[3]] = values
    return Colors(numbers, name)


def time_of(number: int | None, times: int) -> int:
    """The time that is drawn: the first of several without a number, with a warning."""
    if number is None:
        if times > 1:
            from ._warnings import warn

            warn(f"array: {times} times: the first is drawn")
        return 0
    number = whole("time", number, 0, 2**32 - 1, VolumeError)
    if number >= times:
        raise refused("time", str(number), f"0 to {times - 1}")
    return number


def channels_at(count: int, channel: int | None) -> range:
    """The numbers of the channels that are drawn: one, or all."""
    if channel is None:
        return range(count)
    number = whole("channel", channel, 0, 2**32 - 1, VolumeError)
    if number >= count:
        raise refused("channel", str(number), f"0 to {count - 1}")
    return range(number, number + 1)
