// Helpers of the tests: the program itself beside the page, and steps that many tests take.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

export const { RIGIDENT_SITE, RIGIDENT_PROGRAM, RIGIDENT_PICTURES } = process.env;
export const EXAMPLES = new URL("../../docs/examples/", import.meta.url).pathname;
export const BRACKET = readFileSync(join(EXAMPLES, "bracket.csv"), "utf8");
export const BRACKET_RIG = readFileSync(join(EXAMPLES, "bracket.rig.toml"), "utf8");
export const SHARED = new URL("../../../shared/", import.meta.url).pathname;
export const place = mkdtempSync(join(tmpdir(), "rigident-web-"));

/** Runs the program itself on files of a new folder; returns its result. */
export function program(files, words) {
  const folder = mkdtempSync(join(place, "native-"));
  for (const [name, text] of Object.entries(files)) writeFileSync(join(folder, name), text);
  const ended = spawnSync(RIGIDENT_PROGRAM, words, { cwd: folder, encoding: "utf8", maxBuffer: 1 << 28 });
  return { status: ended.status, output: ended.stdout, errors: ended.stderr, folder };
}

/** Numbers of an object by their paths; those that differ from call to call are left out. */
export function numbers(object, path = "", found = new Map()) {
  for (const [key, value] of Object.entries(object ?? {})) {
    if (["elapsed_s", "date", "version"].includes(key)) continue;
    const own = `${path}.${key}`;
    if (typeof value === "number") found.set(own, value);
    else if (typeof value === "object") numbers(value, own, found);
    else found.set(own, value);
  }
  return found;
}

/** Compares two results: the same fields, and how far the numbers are apart, relative, and the worst estimate in parts of its U95. */
export function compare(ours, theirs) {
  const [a, b] = [numbers(ours), numbers(theirs)];
  assert.deepEqual([...a.keys()].sort(), [...b.keys()].sort());
  let [equal, worst] = [0, 0];
  for (const [key, value] of a) {
    const other = b.get(key);
    if (typeof value !== "number") continue;
    if (Object.is(value, other)) equal++;
    else worst = Math.max(worst, Math.abs(value - other) / Math.max(Math.abs(value), Math.abs(other)));
  }
  const values = (result) => result.parameters.map(({ value, u95 }) => [value, u95]);
  const off = values(ours).map(([value, u95], k) => Math.abs(value - values(theirs)[k][0]) / u95).filter(Number.isFinite);
  return { count: [...a.values()].filter((value) => typeof value === "number").length, equal, worst, off: Math.max(0, ...off) };
}

export const file = (name, text) => ({ name, mimeType: "text/plain", buffer: Buffer.from(text) });
export const choose = (page, ...files) => page.locator("#choose").setInputFiles(files);

/** Waits until the page's state contains these words; names the state and the complaints that are there if it never does. */
export async function state(page, words) {
  try {
    await page.locator("#state").filter({ hasText: words }).waitFor({ timeout: 60_000 });
  } catch {
    const seen = await page.locator("#state, .bad:visible, [role=alert]:visible").allTextContents();
    throw new Error(`the page never said "${words}" but ${JSON.stringify(seen)}`);
  }
}

/** Has the page forget its files, and waits until it has begun anew. */
export async function forget(page) {
  await Promise.all([page.waitForEvent("load"), page.locator("#forget").click()]);
  await page.getByText(/^rigident \d/).waitFor();
}

/** Downloads the file of a button. */
export async function downloaded(page, name) {
  const [got] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name, exact: true }).click()]);
  return readFileSync(await got.path(), "utf8");
}

export async function identify(page) {
  await page.locator("#identify").click();
  await page.locator("#answer").waitFor({ timeout: 120_000 });
}

/** A table of another program: other names, units in no place, a semicolon and a decimal comma. */
export function foreign() {
  const [, ...rows] = BRACKET.trim().split("\n");
  const comma = (row) => row.split(",").map((cell) => cell.replace(".", ",")).join(";");
  return ["Zeit;Kraft X;Kraft Y;Kraft Z;Moment X;Moment Y;Moment Z;a1;a2;a3;w1;w2;w3", ...rows.map(comma)].join("\r\n");
}
