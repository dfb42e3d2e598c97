// A static file server of web/ for the tests and the demo, under a sub-path as where pages are often put:
//   node tests/serve.mjs [port]
import { createReadStream, statSync } from "node:fs";
import { createServer } from "node:http";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

/** The path below which everything lies. */
export const BASE = "/some/where/";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const types = {
    ".css": "text/css",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript",
    ".mjs": "text/javascript",
    ".svg": "image/svg+xml",
    ".wasm": "application/wasm",
};

/** Serves a folder; `url` is its address. */
export async function serve(port = 0, root = web) {
    const server = createServer((request, response) => {
        const path = decodeURIComponent(new URL(request.url, "http://localhost").pathname);
        const file = path.startsWith(BASE) ? join(root, normalize(path.slice(BASE.length))) : "";
        const at = path.endsWith("/") ? join(file, "index.html") : file;
        try {
            if (!at.startsWith(root) || !statSync(at).isFile()) throw new Error();
        } catch {
            response.writeHead(404).end("no such file");
            return;
        }
        response.writeHead(200, { "content-type": types[extname(at)] ?? "application/octet-stream", "cache-control": "no-store" });
        createReadStream(at).pipe(response);
    });
    await new Promise((resolve) => server.listen(port, "localhost", resolve));
    return { server, url: `http://localhost:${server.address().port}${BASE}` };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
    const { url } = await serve(Number(process.argv[2] ?? 8080));
    console.log(`${url}demo/`);
}
