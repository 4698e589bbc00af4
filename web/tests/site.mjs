// A server of static files on this computer, as any web server would serve the page, and a browser that looks at it.

import { createServer } from "node:http";
import { createRequire } from "node:module";
import { readFile } from "node:fs/promises";
import { join, normalize } from "node:path";

const TYPES = { html: "text/html", js: "text/javascript", css: "text/css", wasm: "application/wasm", csv: "text/csv", toml: "text/plain" };

/** Serves a folder; returns its address and how to end it. */
export async function serve(folder) {
  const server = createServer(async (request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://x").pathname));
    const name = path === "/" ? "index.html" : path.slice(1);
    try {
      const bytes = await readFile(join(folder, name));
      response.writeHead(200, { "content-type": TYPES[name.split(".").at(-1)] ?? "application/octet-stream" });
      response.end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { address: `http://127.0.0.1:${server.address().port}/`, close: () => server.close() };
}

/** Starts the browser. */
export function browser() {
  const { chromium } = createRequire(join(process.env.NODE_PATH, "x.js"))("playwright-core");
  return chromium.launch({ executablePath: `/usr/bin/${process.env.RIGIDENT_BROWSER}`, args: ["--no-sandbox"] });
}

/** Everything that pages asked the network for, of all tests until it is taken out. */
export const asked = [];

/** Opens the page anew, with nothing kept; its requests go into `asked`, its errors into `errors`. */
export async function opened(chromium, address, options = {}) {
  const context = await chromium.newContext({ viewport: { width: 1280, height: 900 }, acceptDownloads: true, ...options });
  const page = await context.newPage();
  const seen = { page, context, asked, errors: [] };
  context.on("request", (request) => {
    if (!request.url().startsWith("blob:") && !request.url().startsWith("data:")) asked.push(request);
  });
  page.on("pageerror", (error) => seen.errors.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") seen.errors.push(message.text());
  });
  await page.goto(address);
  await page.getByText(/^rigident \d/).waitFor();
  return seen;
}
