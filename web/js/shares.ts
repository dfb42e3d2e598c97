// How several workers share a frame: columns of whole tiles, whose widths follow the times that they take.

/** Columns of a tile of the native backend; shares that end between tiles are drawn without waste. */
const TILE = 32;

/** A part of a picture: x, y, width and height. */
export type Part = [number, number, number, number];

export class Shares {
    /** Where shares begin and end, in shares of the picture's width. */
    #cuts: number[];

    constructor(count: number) {
        this.#cuts = Array.from({ length: count + 1 }, (_, at) => at / count);
    }

    /** A frame's shares: columns of whole tiles, at least one each, so that narrow pictures have fewer. */
    of(width: number, height: number): Part[] {
        const cuts = this.#cuts;
        const tiles = Math.ceil(width / TILE);
        const count = Math.min(cuts.length - 1, tiles);
        const ends = Array.from({ length: count + 1 }, (_, at) => {
            const wanted = Math.round(cuts[Math.round((at * (cuts.length - 1)) / count)]! * tiles);
            return Math.max(at, Math.min(wanted, tiles - count + at));
        });
        return ends.slice(1).map((end, at) => {
            const first = ends[at]! * TILE;
            return [first, 0, Math.min(end * TILE, width) - first, height];
        });
    }

    /** Moves the cuts so that all shares of the next frame take the same time, if work is spread evenly within each. */
    balance(parts: Part[], milliseconds: number[], width: number): void {
        const cuts = this.#cuts;
        if (parts.length < cuts.length - 1) return;
        const times = milliseconds.map((time) => Math.max(time, 0.1));
        const total = times.reduce((sum, time) => sum + time, 0);
        const found = [0];
        let [passed, at] = [0, 0];
        for (let cut = 1; cut < parts.length; cut++) {
            const wanted = (total * cut) / parts.length;
            while (passed + times[at]! < wanted) passed += times[at++]!;
            const [first, , columns] = parts[at]!;
            found.push((first + (columns * (wanted - passed)) / times[at]!) / width);
        }
        // Half way, since times vary.
        this.#cuts = [...found, 1].map((cut, at) => (cut + cuts[at]!) / 2);
    }
}
