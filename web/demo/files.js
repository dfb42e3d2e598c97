// Files in and out: what was dropped or chosen, and downloads.

/** Files that systems add to folders. */
const CLUTTER = /^(\..*|thumbs\.db|desktop\.ini)$/i;

/** The files that were dropped, those of folders among them. Must be called before the event's listeners have returned. */
export async function dropped(transfer) {
    const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter((entry) => entry);
    if (!entries.some((entry) => entry.isDirectory)) return [...transfer.files];
    return within((await Promise.all(entries.map((entry) => inside(entry, "")))).flat());
}

/** The files of a folder that was chosen. */
export function chosen(files) {
    return within([...files].map((data) => ({ name: data.webkitRelativePath || data.name, data })));
}

/** All files in an entry of a file system, with their paths. */
async function inside(entry, folder) {
    const name = folder + entry.name;
    if (entry.isFile) return [{ name, data: await new Promise((resolve, reject) => entry.file(resolve, reject)) }];
    const reader = entry.createReader();
    const found = [];
    // Browsers give a folder's entries a hundred at a time.
    for (;;) {
        const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
        if (some.length === 0) break;
        found.push(...some);
    }
    return (await Promise.all(found.map((each) => inside(each, `${name}/`)))).flat();
}

/** Files with their paths in the folder that they have in common. */
function within(files) {
    let kept = files.filter(({ name }) => !name.split("/").some((part) => CLUTTER.test(part)));
    for (;;) {
        const folder = kept[0]?.name.match(/^[^/]+\//)?.[0];
        if (!folder || !kept.every(({ name }) => name.startsWith(folder))) return kept;
        kept = kept.map(({ name, data }) => ({ name: name.slice(folder.length), data }));
    }
}

/** Lets the browser save a file. */
export function save(blob, name) {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
