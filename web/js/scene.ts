// Scenes as JavaScript objects, written as the text of a scene file.

/** A value in a scene: what TOML has, in JavaScript's types. */
export type SceneValue = string | number | boolean | SceneValue[] | { [key: string]: SceneValue | undefined };

/** A scene by the keys of scene files (docs/guide/scene-files.md), such as `{ preset: "ct-bone", image: { background: [1, 1, 1, 1] } }`. */
export type SceneObject = { [key: string]: SceneValue | undefined };

/** The text of a scene: an object's, or the text itself. */
export function sceneText(scene: string | SceneObject): string {
    if (typeof scene === "string") return scene;
    return entries(scene).map(([key, value]) => `${key} = ${value}\n`).join("");
}

/** The keys of settings that are taken out of a scene. */
export function removed(settings: { [key: string]: SceneValue | null | undefined }): string[] {
    return Object.entries(settings).filter(([, value]) => value === null).map(([key]) => key);
}

/** Settings as `KEY=VALUE`. */
export function overrides(settings: { [key: string]: SceneValue | null | undefined }): string[] {
    const stated = Object.entries(settings).filter(([, value]) => value !== undefined && value !== null);
    return stated.map(([key, value]) => `${key}=${toml(value as SceneValue, key)}`);
}

function entries(table: SceneObject): [string, string][] {
    const stated = Object.entries(table).filter(([, value]) => value !== undefined && value !== null);
    return stated.map(([key, value]) => [JSON.stringify(key), toml(value as SceneValue, key)]);
}

function toml(value: SceneValue, key: string): string {
    switch (typeof value) {
        case "string":
            return JSON.stringify(value).replace(/\u007f/g, "\\u007F");
        case "boolean":
            return String(value);
        case "number":
            if (Number.isNaN(value)) return "nan";
            if (!Number.isFinite(value)) return value > 0 ? "inf" : "-inf";
            return Number.isInteger(value) && !Number.isSafeInteger(value) ? `${value.toExponential()}` : String(value);
        case "object":
            if (Array.isArray(value)) return `[${value.map((item) => toml(item, key)).join(", ")}]`;
            return `{ ${entries(value).map(([name, item]) => `${name} = ${item}`).join(", ")} }`;
        default:
            throw new TypeError(`scene: ${key}: found a ${typeof value}, allowed: strings, numbers, booleans, arrays and objects`);
    }
}
