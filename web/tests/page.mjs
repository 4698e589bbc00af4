// The page in a browser: what it answers is what the program answers, nothing is sent, nothing is lost, and it says what is wrong.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, mkdirSync, readFileSync, rmSync, truncateSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { browser, opened, serve } from "./site.mjs";

const { RIGIDENT_SITE, RIGIDENT_PROGRAM, RIGIDENT_PICTURES } = process.env;
const EXAMPLES = new URL("../../docs/examples/", import.meta.url).pathname;
const BRACKET = readFileSync(join(EXAMPLES, "bracket.csv"), "utf8");
const BRACKET_RIG = readFileSync(join(EXAMPLES, "bracket.rig.toml"), "utf8");
const SHARED = new URL("../../../shared/", import.meta.url).pathname;
const place = mkdtempSync(join(tmpdir(), "rigident-web-"));
const wanted = process.argv.slice(2);

/** Runs the program itself on files of a new folder; returns its result. */
function program(files, words) {
  const folder = mkdtempSync(join(place, "native-"));
  for (const [name, text] of Object.entries(files)) writeFileSync(join(folder, name), text);
  const ended = spawnSync(RIGIDENT_PROGRAM, words, { cwd: folder, encoding: "utf8", maxBuffer: 1 << 28 });
  return { status: ended.status, output: ended.stdout, errors: ended.stderr, folder };
}

/** Numbers of an object by their paths; what differs from call to call is left out. */
function numbers(object, path = "", found = new Map()) {
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
function compare(ours, theirs) {
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

const file = (name, text) => ({ name, mimeType: "text/plain", buffer: Buffer.from(text) });
const choose = (page, ...files) => page.locator("#choose").setInputFiles(files);
const state = (page, words) => page.locator("#state").filter({ hasText: words }).waitFor({ timeout: 60_000 });

/** Downloads what a button gives. */
async function downloaded(page, name) {
  const [got] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name, exact: true }).click()]);
  return readFileSync(await got.path(), "utf8");
}

async function identify(page) {
  await page.locator("#identify").click();
  await page.locator("#answer").waitFor({ timeout: 120_000 });
}

/** A table of another program: other names, units in no place, a semicolon and a decimal comma. */
function foreign() {
  const [, ...rows] = BRACKET.trim().split("\n");
  const comma = (row) => row.split(",").map((cell) => cell.replace(".", ",")).join(";");
  return ["Zeit;Kraft X;Kraft Y;Kraft Z;Moment X;Moment Y;Moment Z;a1;a2;a3;w1;w2;w3", ...rows.map(comma)].join("\r\n");
}

const tests = {
  async "the example is answered as by the program"(chromium, address) {
    const { page, asked, errors } = await opened(chromium, address);
    await page.locator("#example").click();
    await state(page, "is understood");
    assert.match(await page.locator("#understood-words").textContent(), /1001 rows, 100 rows per second over 10 s, no gaps/);
    await identify(page);
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const native = program({ "bracket.csv": BRACKET, "bracket.rig.toml": BRACKET_RIG }, ["identify", "bracket.csv", "--json", "--out", "answer"]);
    const found = compare(ours, JSON.parse(native.output));
    console.log(`  ${found.equal} of ${found.count} numbers equal to the last bit; others within ${found.worst.toExponential(1)}; estimates within ${found.off.toExponential(1)} U95`);
    assert.ok(found.off < 1e-9, `estimates differ by ${found.off} U95`);
    const report = await downloaded(page, "Download report.html");
    const headings = (text) => text.match(/<h[1-3][^>]*>.*?<\/h[1-3]>/g);
    assert.ok(headings(report).length > 5);
    assert.deepEqual(headings(report), headings(readFileSync(join(native.folder, "answer/report.html"), "utf8")));
    await page.frameLocator("#report").getByRole("heading", { level: 1 }).waitFor();
    // Nothing is sent: everything that was asked for is a file of the page.
    for (const request of asked) {
      assert.ok(request.url().startsWith(address) && request.method() === "GET" && request.postData() === null, request.url());
    }
    assert.deepEqual(errors, []);
  },

  async "columns and units are picked from lists"(chromium, address) {
    const { page, errors } = await opened(chromium, address);
    await choose(page, file("messung.csv", foreign()));
    await page.locator("#understood-error").waitFor();
    const pick = (name, what) => page.getByRole("combobox", { name: `What column ${name} is`, exact: true }).selectOption(what);
    const unit = async (name, words) => {
      await page.getByRole("combobox", { name: `Unit of column ${name}`, exact: true }).selectOption(words);
      await page.waitForFunction(() => !document.querySelector("#state").textContent.startsWith("Reading"));
    };
    const all = { Zeit: ["t_s", "s"], "Kraft X": ["fx_n", "N"], "Kraft Y": ["fy_n", "N"], "Kraft Z": ["fz_n", "N"], "Moment X": ["mx_nm", "N m"],
      "Moment Y": ["my_nm", "N m"], "Moment Z": ["mz_nm", "N m"], a1: ["imu_ax_mps2", "m/s^2"], a2: ["imu_ay_mps2", "m/s^2"], a3: ["imu_az_mps2", "m/s^2"],
      w1: ["imu_gx_radps", "rad/s"], w2: ["imu_gy_radps", "rad/s"], w3: ["imu_gz_radps", "rad/s"] };
    for (const [name, [known, words]] of Object.entries(all)) {
      await pick(name, known);
      await page.waitForFunction(() => !document.querySelector("#state").textContent.startsWith("Reading"));
      await unit(name, words);
    }
    await state(page, "is understood");
    for (const [axis, mm] of [["x", "50"], ["y", "-20"], ["z", "30"]]) await page.locator(`#imu-${axis}`).fill(mm);
    for (const _ of [1, 2, 3, 4]) await page.getByRole("button", { name: "about z" }).click();
    assert.match(await page.locator("#sketch-words").textContent(), /x along \+x, y along \+y, z along \+z/);
    await identify(page);
    const rig = await downloaded(page, "Download the rig file");
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const native = program({ "messung.csv": foreign(), "messung.rig.toml": rig }, ["identify", "messung.csv", "--json", "--out", "answer"]);
    const found = compare(ours, JSON.parse(native.output));
    assert.ok(found.off < 1e-9, `estimates differ by ${found.off} U95`);
    // It is the bracket.
    const mass = ours.parameters.find(({ name }) => name === "m");
    assert.ok(Math.abs(mass.value - 3.2) < 3 * mass.u95, JSON.stringify(mass));
    assert.deepEqual(errors, []);
  },

  async "still poses by a level"(chromium, address) {
    const { page } = await opened(chromium, address);
    await page.locator("#by-level").click();
    // Weight and moments of 2 kg at (10, 20, 30) mm, by hand: F = −m g, M = r × F.
    const [m, g, r] = [2, 9.80665, [0.01, 0.02, 0.03]];
    const tilts = [[0, 0], [20, 0], [-20, 0], [0, 20], [0, -20], [15, 15], [-15, 10]];
    for (let n = 6; n < tilts.length; n++) await page.locator("#add-pose").click();
    for (const [n, [a, b]] of tilts.entries()) {
      const sin = [a, b].map((degrees) => Math.sin((degrees * Math.PI) / 180));
      const up = [...sin, Math.sqrt(1 - sin[0] ** 2 - sin[1] ** 2)];
      const force = up.map((x) => m * g * x);
      const moment = [r[1] * force[2] - r[2] * force[1], r[2] * force[0] - r[0] * force[2], r[0] * force[1] - r[1] * force[0]];
      const noise = (k) => 1e-3 * Math.sin(7 * n + 3 * k);
      const cells = [a, b, ...force.map((x, k) => (x + noise(k)).toFixed(4).replace(".", ",")), ...moment.map((x, k) => (x + 0.01 * noise(k + 3)).toFixed(6))];
      const inputs = page.locator(`#pose-table tbody tr:nth-child(${n + 1}) input`);
      for (const [k, cell] of cells.entries()) await inputs.nth(k).fill(String(cell));
    }
    await page.locator("#take-poses").click();
    await state(page, "is understood");
    await identify(page);
    const result = JSON.parse(await downloaded(page, "Download result.json"));
    const value = (name) => result.parameters.find((parameter) => parameter.name === name);
    for (const [name, truth] of [["m", 2], ["mcx", 0.02], ["mcy", 0.04], ["mcz", 0.06]]) {
      assert.ok(Math.abs(value(name).value - truth) < Math.max(value(name).u95, 2e-3), `${name}: ${JSON.stringify(value(name))}`);
    }
  },

  async "what is wrong is said in the program's words"(chromium, address) {
    const { page } = await opened(chromium, address);
    const bad = BRACKET.replace("28.1008", "nan");
    await choose(page, file("bad.csv", bad), file("bad.rig.toml", BRACKET_RIG));
    await page.locator("#understood-error").waitFor();
    const native = program({ "bad.csv": bad, "bad.rig.toml": BRACKET_RIG }, ["identify", "bad.csv"]);
    assert.equal((await page.locator("#understood-error").textContent()).trim(), native.errors.replace(/^rigident: /, "").trim());
    await page.locator("#forget").click();
    await page.getByText(/^rigident \d/).waitFor();
    await choose(page, file("empty.csv", ""));
    await state(page, "empty.csv is empty");
    await choose(page, { name: "noise.csv", mimeType: "text/csv", buffer: Buffer.from(Array.from({ length: 5000 }, (_, n) => (n * 7919) % 256)) });
    await page.locator("#understood-error").waitFor();
    assert.ok((await page.locator("#understood-error").textContent()).length > 20);
  },

  async "a recording that cannot be true has no good answer"(chromium, address) {
    const { page } = await opened(chromium, address);
    // The moments in N mm, though the header says N m.
    const rows = BRACKET.trim().split("\n").map((row, n) => (n === 0 ? row : row.split(",").map((cell, k) => (k >= 4 && k <= 6 ? String(1000 * Number(cell)) : cell)).join(",")));
    await choose(page, file("wrong.csv", rows.join("\n")), file("wrong.rig.toml", BRACKET_RIG));
    await state(page, "is understood");
    await identify(page);
    assert.match(await page.locator("#headline").textContent(), /cannot be true/);
    const said = JSON.parse(program({ "wrong.csv": rows.join("\n"), "wrong.rig.toml": BRACKET_RIG }, ["identify", "wrong.csv", "--json", "--out", "a"]).output);
    assert.equal(said.status, "implausible");
    for (const line of said.advice ?? []) assert.ok((await page.locator("#next").textContent()).includes(line), line);
  },

  async "a gigabyte gives words and the page goes on"(chromium, address) {
    const { page } = await opened(chromium, address);
    const large = join(place, "large.csv");
    writeFileSync(large, "t_s,fx_n\n");
    truncateSync(large, 1 << 30);
    const begun = Date.now();
    await page.locator("#choose").setInputFiles(large);
    await state(page, /large\.csv has 102\d MiB: this page reads/);
    assert.ok(Date.now() - begun < 20_000);
    rmSync(large);
    await page.locator("#example").click();
    await state(page, "is understood");
  },

  async "files, choices and answer are there after a reload"(chromium, address) {
    const { page } = await opened(chromium, address);
    const bare = BRACKET;
    await choose(page, file("body.csv", bare));
    await state(page, "is understood");
    await page.locator("#imu-x").fill("50");
    await page.getByRole("button", { name: "Turn 90° about x" }).click();
    const rig = await page.locator("#rig").inputValue();
    assert.match(rig, /position_m = \[0\.05, 0\.0, 0\.0\]/);
    await identify(page);
    await page.waitForTimeout(300);
    await page.reload();
    await page.locator("#answer").waitFor();
    await page.frameLocator("#report").getByRole("heading", { level: 1 }).waitFor();
    assert.equal(await page.locator("#rig").inputValue(), rig);
    await page.locator("#forget").click();
    await page.getByText("Ready. Choose a recording.").waitFor();
  },

  async "cancel ends the work, and the next one runs"(chromium, address) {
    const { page } = await opened(chromium, address);
    // Ten minutes at 100 Hz: long enough to be met in the middle.
    const [head, ...rows] = BRACKET.trim().split("\n");
    const many = Array.from({ length: 60 }, (_, n) => rows.map((row) => row.replace(/^[\d.]+/, (t) => (Number(t) + 10 * n).toFixed(2)))).flat();
    await choose(page, file("long.csv", [head, ...many].join("\n")), file("long.rig.toml", BRACKET_RIG));
    await state(page, "is understood");
    await page.locator("#identify").click();
    await page.locator("#cancel").click();
    await state(page, "Cancelled");
    await page.locator("#example").click();
    await state(page, "is understood");
  },

  async "keyboard, names for screen readers, 390 px"(chromium, address) {
    const { page } = await opened(chromium, address, { viewport: { width: 390, height: 844 } });
    await page.keyboard.press("Tab");
    assert.equal(await page.evaluate(() => document.activeElement.id), "choose");
    for (let n = 0; n < 5 && (await page.evaluate(() => document.activeElement.id)) !== "example"; n++) await page.keyboard.press("Tab");
    await page.keyboard.press("Enter");
    await state(page, "is understood");
    await page.locator("#identify").focus();
    await page.keyboard.press("Enter");
    await page.locator("#answer").waitFor({ timeout: 60_000 });
    assert.equal(await page.evaluate(() => document.activeElement.id), "headline");
    await choose(page, file("log.csv", foreign()));
    await page.locator("#understood-error").waitFor();
    await page.locator("#by-level").click();
    const nameless = await page.evaluate(() => [...document.querySelectorAll("button, input, select, textarea")].filter((field) =>
      field.offsetParent && !(field.labels?.length || field.getAttribute("aria-label") || field.textContent.trim())).map((field) => field.outerHTML));
    assert.deepEqual(nameless, []);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    assert.ok(wide <= 0, `${wide} px wider than the window`);
  },

  async "shared_cases: four exports of other programs are understood"(chromium, address) {
    const { page } = await opened(chromium, address);
    for (const name of ["Messung_01.csv", "messung_02.lvm", "ati_log.csv", "imu_logger.csv"]) {
      await choose(page, { name, mimeType: "text/plain", buffer: readFileSync(join(SHARED, "cases/exports", name)) });
      await state(page, `${name} is understood`);
      assert.match(await page.locator("#understood-words").textContent(), /rows per second/);
      await page.getByRole("button", { name: `Remove ${name}` }).click();
      await state(page, "Ready");
    }
  },

  async "shared_data: an end effector's still poses are answered as by the program"(chromium, address) {
    const { page } = await opened(chromium, address);
    const recording = readFileSync(join(SHARED, "data/endeffector_ati_gamma_imu/1-baseline_wrench.csv"), "utf8");
    const rig = readFileSync(join(EXAMPLES, "endeffector.rig.toml"), "utf8");
    await choose(page, file("wrench.csv", recording), file("endeffector.rig.toml", rig));
    await state(page, "is understood");
    await identify(page);
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const native = program({ "wrench.csv": recording, "wrench.rig.toml": rig }, ["identify", "wrench.csv", "--json", "--out", "answer"]);
    const found = compare(ours, JSON.parse(native.output));
    console.log(`  ${found.equal} of ${found.count} numbers equal to the last bit; estimates within ${found.off.toExponential(1)} U95`);
    assert.ok(found.off < 1e-9, `estimates differ by ${found.off} U95`);
  },

  async "shared_data: a person is answered as by the program"(chromium, address) {
    const { page } = await opened(chromium, address);
    const folder = join(SHARED, "data/human_btk_pig_60kg_functional");
    const trials = Object.fromEntries(["FunctionalWalk.c3d", "FunctionalStatic.c3d"].map((name) => [name, readFileSync(join(folder, name))]));
    await choose(page, ...Object.entries(trials).map(([name, buffer]) => ({ name, mimeType: "application/octet-stream", buffer })));
    await state(page, "A person's trials");
    await page.locator("#height").fill("1.68");
    await page.locator("#identify").click();
    await page.locator("#answer").waitFor({ timeout: 600_000 });
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const native = program(trials, ["body", "identify", "FunctionalWalk.c3d", "--static", "FunctionalStatic.c3d", "--height-m", "1.68", "--json", "--out", "answer"]);
    const found = compare(ours, JSON.parse(native.output));
    console.log(`  ${found.equal} of ${found.count} numbers equal to the last bit; estimates within ${found.off.toExponential(1)} U95`);
    // Iterations of poses end at 1e-6 of a step, which the last digits of sines can move by one.
    assert.ok(found.off < 1e-3, `estimates differ by ${found.off} U95`);
  },

  async "it works without a network once it was there"(chromium, address) {
    const { page, context } = await opened(chromium, address);
    await page.evaluate(() => navigator.serviceWorker.ready);
    await context.setOffline(true);
    await page.reload();
    await page.getByText(/^rigident \d/).waitFor();
    await page.locator("#example").click();
    await state(page, "is understood");
    await identify(page);
    await context.setOffline(false);
  },

  async "pictures"(chromium, address) {
    if (!RIGIDENT_PICTURES) return;
    mkdirSync(RIGIDENT_PICTURES, { recursive: true });
    for (const width of [1280, 390]) {
      for (const colorScheme of ["light", "dark"]) {
        const { page, context } = await opened(chromium, address, { viewport: { width, height: 900 }, colorScheme });
        await choose(page, file("body.csv", BRACKET));
        await state(page, "is understood");
        await page.locator("#imu-x").fill("50");
        await page.getByRole("button", { name: "about y" }).click();
        await page.screenshot({ path: join(RIGIDENT_PICTURES, `understood-${width}-${colorScheme}.png`), fullPage: true });
        await page.locator("#example").click();
        await state(page, "is understood");
        await identify(page);
        await page.screenshot({ path: join(RIGIDENT_PICTURES, `answer-${width}-${colorScheme}.png`), fullPage: true });
        await page.locator("#by-level").click();
        await page.locator("#pose-table input").first().fill("15");
        await page.screenshot({ path: join(RIGIDENT_PICTURES, `poses-${width}-${colorScheme}.png`), fullPage: true });
        await context.close();
      }
    }
  },
};

const site = await serve(RIGIDENT_SITE);
const chromium = await browser();
let failed = 0;
for (const [name, test] of Object.entries(tests)) {
  if (wanted.length > 0 && !wanted.some((words) => name.includes(words))) continue;
  const begun = Date.now();
  if (name.startsWith("shared_") && !existsSync(SHARED)) {
    console.log(`${process.env.CI ? "FAILED" : "skipped"} ${name}: it needs ../shared`);
    failed += process.env.CI ? 1 : 0;
    continue;
  }
  try {
    await test(chromium, site.address);
    console.log(`ok     ${((Date.now() - begun) / 1000).toFixed(1)} s  ${name}`);
  } catch (error) {
    failed++;
    console.log(`FAILED ${name}\n${error.stack}`);
  }
  for (const context of chromium.contexts()) await context.close();
}
await chromium.close();
site.close();
rmSync(place, { recursive: true, force: true });
process.exit(failed === 0 ? 0 : 1);
