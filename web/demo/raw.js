// Files of bare samples, whose form the user states.

const at = (id) => document.getElementById(id);

/** Whether files are one of bare samples. */
export function isBare(files) {
    return files.length === 1 && /\.(raw|bin|dat)$/i.test(files[0].name);
}

/** Asks for the form of a file's samples. Returns the scene that names them, or nothing if the user gives up. */
export async function askForm(file) {
    const dialog = at("raw");
    at("raw-name").textContent = `${file.name}: ${(file.data ?? file).size.toLocaleString("en")} bytes`;
    dialog.returnValue = "";
    dialog.showModal();
    await new Promise((resolve) => dialog.addEventListener("close", resolve, { once: true }));
    if (dialog.returnValue !== "open") return undefined;
    const number = (id) => Number(at(id).value);
    return {
        volume: {
            path: file.name,
            dims: ["raw-x", "raw-y", "raw-z"].map(number),
            type: at("raw-type").value,
            endian: at("raw-endian").value,
            offset: number("raw-offset"),
        },
    };
}
