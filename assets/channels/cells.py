"""Writes cells.npy, an embryo of 1, 2, 4 and 8 cells as a microscope would see it: 8 bits indexed [t, c, z, y, x]. Channels are membranes, nuclei and
mitochondria. `python cells.py`."""

import numpy

SIDE = 112
random = numpy.random.default_rng(4)
z, y, x = numpy.meshgrid(*[numpy.linspace(-1, 1, SIDE, dtype="f4")] * 3, indexing="ij")
CUBE = numpy.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], "f4")
# The cells' centres, x first, and their radius.
STAGES = [
    (numpy.zeros((1, 3), "f4"), 0.72),
    (numpy.array([[-0.36, 0.05, 0], [0.36, -0.05, 0.05]], "f4"), 0.55),
    (0.29 * CUBE[[0, 3, 5, 6]], 0.44),
    (0.33 * CUBE, 0.36),
]


def turned(centers):
    """Seen along no axis of the cells."""
    cosine, sine = numpy.cos(0.5), numpy.sin(0.5)
    about_z = numpy.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    about_x = numpy.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    return centers @ (about_x @ about_z).T


def stage(centers, radius):
    distances = numpy.stack([numpy.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2) for a, b, c in turned(centers)])
    nearest = distances.min(0)
    inside = nearest < radius
    membranes = numpy.exp(-(((nearest - radius) / 0.025) ** 2))
    if len(centers) > 1:
        between = numpy.partition(distances, 1, axis=0)[1] - nearest
        membranes = numpy.maximum(membranes, inside * numpy.exp(-((between / 0.035) ** 2)))
    texture = 0.7 + 0.3 * numpy.sin(23 * x + 3 * y) * numpy.sin(19 * y - 4 * z) * numpy.sin(21 * z + 5 * x)
    nuclei = texture / (1 + numpy.exp((nearest - 0.4 * radius) / 0.015))
    threads = numpy.sin(31 * x + 4 * numpy.sin(9 * z)) * numpy.sin(29 * y + 4 * numpy.sin(8 * x)) * numpy.sin(27 * z + 4 * numpy.sin(7 * y))
    cytoplasm = inside & (nearest > 0.5 * radius) & (nearest < 0.9 * radius)
    mitochondria = cytoplasm * (threads > 0.45) * (0.5 + threads)
    channels = numpy.stack([membranes, nuclei, mitochondria])
    # Photons.
    return random.poisson(8 + 170 * channels.clip(0, 1)).clip(0, 255).astype("u1")


numpy.save("cells.npy", numpy.stack([stage(*of) for of in STAGES]))
