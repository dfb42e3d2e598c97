// Where the camera looks from, and the window of values by dragging with the right button.

const at = (id) => document.getElementById(id);

/** From the eye into the scene, and up: by a patient's RAS, or by the volume's axes. */
const SIDES = {
    "Front": [[0, -1, 0], [0, 0, 1]],
    "Back": [[0, 1, 0], [0, 0, 1]],
    "Left": [[1, 0, 0], [0, 0, 1]],
    "Right": [[-1, 0, 0], [0, 0, 1]],
    "Top": [[0, 0, -1], [0, 1, 0]],
    "Bottom": [[0, 0, 1], [0, 1, 0]],
};
const AXES = {
    "xy": [[0, 0, -1], [0, 1, 0]],
    "xz": [[0, 1, 0], [0, 0, 1]],
    "yz": [[-1, 0, 0], [0, 0, 1]],
    "yx": [[0, 0, 1], [1, 0, 0]],
    "zx": [[0, -1, 0], [1, 0, 0]],
    "zy": [[1, 0, 0], [0, 1, 0]],
};
const OBLIQUE = [[-1, -1, -1], [0, 0, 1]];

/** Shows a button for each side from which a volume is looked at: those of the patient, if the file states one. */
export function showSides({ orientation }, view) {
    const world = (ras) => orientation ? orientation.map((axis) => axis.reduce((sum, part, row) => sum + part * ras[row], 0)) : ras;
    const names = { ...(orientation ? SIDES : AXES), "Oblique": OBLIQUE };
    at("sides").replaceChildren(...Object.entries(names).map(([textContent, vectors]) => {
        const button = Object.assign(document.createElement("button"), { type: "button", textContent });
        button.addEventListener("click", () => view.move({ look: vectors.map(world) }));
        return button;
    }));
}

/** How much a drag over the picture's height multiplies the window's width by. */
const WIDER = 8;

/** Window and level: a drag to the right widens the range over which a channel's opacity and colours run, a drag down moves it to lower values. */
export class WindowLevel {
    #start;

    /** The settings of a drag by heights of the picture: the points of `channel` moved about their middle. `key` names its settings. */
    settings({ right, down, isGoingOn }, channel, key) {
        this.#start ??= { opacity: channel.opacity, color: channel.color, range: channel.range };
        const { opacity, color, range } = this.#start;
        if (!isGoingOn) this.#start = undefined;
        const [first, last] = [opacity[0][0], opacity.at(-1)[0]];
        const width = WIDER ** right;
        const level = (first + last) / 2 - down * (range[1] - range[0]);
        const moved = (points) => points.map(([value, ...rest]) => [level + (value - (first + last) / 2) * width, ...rest]);
        // A colour map runs over the visible values by itself.
        return { [key("opacity")]: moved(opacity), ...(channel.colormap ? {} : { [key("color")]: moved(color) }) };
    }
}
