"""Writes apple.npy, colours of 8 bits indexed [z, y, x, 3], as photographed slices of an apple would be: `python apple.py`."""

import numpy

SIDE = 144
z, y, x = numpy.meshgrid(*[numpy.linspace(-1, 1, SIDE, dtype="f4")] * 3, indexing="ij")
angle, width = numpy.arctan2(y, x), numpy.hypot(x, y)
# The distance from the centre over that of the skin, which dents where the stem is and where the blossom was.
radius = numpy.hypot(width, z) / (0.62 + 0.2 * numpy.tanh(4 * width) + 0.02 * numpy.cos(5 * angle) * (z < 0))

colors = numpy.zeros((SIDE, SIDE, SIDE, 3), "f4")


def paint(where, color):
    colors[where] = numpy.broadcast_to(numpy.stack(numpy.broadcast_arrays(*color), axis=-1), colors.shape)[where]


streaks = 0.5 + 0.5 * numpy.sin(23 * angle + 4 * numpy.sin(5 * z))
paint(radius < 1, (0.75 + 0.15 * z, 0.12 + 0.45 * streaks * (0.4 + 0.5 * z), 0.08))
paint(radius < 0.95, (0.96 - 0.06 * radius, 0.92 - 0.04 * radius, 0.74))
# Five chambers around the core, each with a seed.
petal = width / (0.2 + 0.06 * numpy.cos(5 * angle))
paint(petal**2 + (z / 0.3) ** 2 < 1, (0.85, 0.8, 0.5))
fifth = (angle + numpy.pi / 5) % (2 * numpy.pi / 5) - numpy.pi / 5
along, across = width * numpy.cos(fifth), width * numpy.sin(fifth)
paint(((along - 0.15) / 0.06) ** 2 + (across / 0.045) ** 2 + (z / 0.14) ** 2 < 1, (0.55, 0.3, 0.12))
paint((width < 0.035) & (z > 0.3) & (z < 0.95), (0.36, 0.25, 0.12))

numpy.save("apple.npy", numpy.round(255 * colors.clip(0, 1)).astype("u1"))
