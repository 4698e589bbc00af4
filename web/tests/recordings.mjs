// Recordings in the page: the answer is the program's, nothing is lost, and faults are named.

import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readFileSync, rmSync, truncateSync, writeFileSync } from "node:fs";
import { join } from "node:path";

import { BRACKET, BRACKET_RIG, EXAMPLES, SHARED, choose, compare, downloaded, file, foreign, forget, identify, place, program, state } from "./helpers.mjs";
import { SWINGING, SWINGING_RIG, swinging, twoLoggers } from "./swinging.mjs";
import { opened } from "./site.mjs";

export const tests = {
  async "the example is answered as by the program"(chromium, address) {
    const { page, errors } = await opened(chromium, address);
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
    assert.deepEqual(errors, []);
  },

  async "columns and units are picked from lists"(chromium, address) {
    const { page, errors } = await opened(chromium, address);
    await choose(page, file("messung.csv", foreign()));
    await page.locator("#understood-error").waitFor();
    const pick = (name, what) => page.getByRole("combobox", { name: `Meaning of column ${name}`, exact: true }).selectOption(what);
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

  async "faults of a file are named in the program's words"(chromium, address) {
    const { page } = await opened(chromium, address);
    const bad = BRACKET.replace("28.1008", "nan");
    await choose(page, file("bad.csv", bad), file("bad.rig.toml", BRACKET_RIG));
    await page.locator("#understood-error").waitFor();
    const native = program({ "bad.csv": bad, "bad.rig.toml": BRACKET_RIG }, ["identify", "bad.csv"]);
    assert.equal((await page.locator("#understood-error").textContent()).trim(), native.errors.replace(/^rigident: /, "").trim());
    await forget(page);
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

  async "a computation shows its progress, and is cancelled at once"(chromium, address) {
    const { page } = await opened(chromium, address);
    await choose(page, file("long.csv", swinging(60, 1000)), file("long.rig.toml", SWINGING_RIG));
    await state(page, "is understood");
    await page.locator("#identify").click();
    await page.locator("#progress").waitFor();
    // Its stage, and how much of it is done where that is known.
    await page.locator("#progress-words").filter({ hasText: /, \d+ s$/ }).waitFor({ timeout: 60_000 });
    assert.equal(await page.evaluate(() => document.activeElement.id), "cancel");
    const begun = Date.now();
    await page.keyboard.press("Enter");
    await state(page, "Cancelled. Nothing was kept.");
    const took = Date.now() - begun;
    assert.ok(took < 1000, `cancelled after ${took} ms`);
    assert.ok(await page.locator("#progress").isHidden());
    assert.equal(await page.evaluate(() => document.activeElement.id), "identify");
    // The worker's end is reported after the page's words.
    for (let n = 0; n < 100 && page.workers().length > 0; n++) await page.waitForTimeout(50);
    assert.equal(page.workers().length, 0);
    // Reading is cancelled likewise, and the next work runs.
    await choose(page, file("other.csv", swinging(300, 1000)));
    await page.locator("#progress").waitFor();
    // At once: what is shown moves meanwhile.
    await page.locator("#cancel").dispatchEvent("click");
    await state(page, "Cancelled: other.csv was not read.");
    await page.locator("#example").click();
    await state(page, "is understood");
    await identify(page);
  },

  async "a minute at 1 kHz takes at most three times the program's time"(chromium, address) {
    const { page } = await opened(chromium, address);
    const recording = swinging(60, 1000);
    await choose(page, file("minute.csv", recording), file("minute.rig.toml", SWINGING_RIG));
    await state(page, "is understood");
    await identify(page);
    const took = Number(/It took ([\d.]+) s/.exec(await page.locator("#state").textContent())[1]);
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const begun = Date.now();
    const native = program({ "minute.csv": recording, "minute.rig.toml": SWINGING_RIG }, ["identify", "minute.csv", "--json", "--out", "answer"]);
    const own = (Date.now() - begun) / 1000;
    console.log(`  page ${took} s, program ${own.toFixed(1)} s: ${(took / own).toFixed(2)} times`);
    const found = compare(ours, JSON.parse(native.output));
    assert.ok(found.off < 1e-9, `estimates differ by ${found.off} U95`);
    for (const [name, truth] of Object.entries(SWINGING)) {
      const { value, u95 } = ours.parameters.find((parameter) => parameter.name === name);
      assert.ok(Math.abs(value - truth) < u95, `${name}: ${value} ± ${u95}, is ${truth}`);
    }
    assert.ok(took <= 3 * own, `${took} s, and the program ${own} s`);
  },

  async "two loggers with clocks of their own are one recording, and their curves show it"(chromium, address) {
    const { page, errors } = await opened(chromium, address);
    // The IMU's logger began 250 s before the load cell's, and its crystal is 200 ppm fast.
    const texts = twoLoggers(swinging(20, 200), (t) => 250 + t * (1 + 2e-4));
    await choose(page, ...Object.entries(texts).map(([name, text]) => file(name, text)));
    await page.getByRole("radio", { name: /all tables as one recording/ }).check();
    await state(page, "The recording is understood");
    const words = await page.locator("#clocks-words").textContent();
    const rate = Number(/a second of its clock lasts ([\d.]+) s/.exec(words)[1]);
    assert.ok(Math.abs(rate - 1 / (1 + 2e-4)) < 2e-5, words);
    assert.equal(await page.locator("#clocks-chart path.curve").count(), 2);
    assert.match(await page.locator("#clocks-caption").textContent(), /force\.csv: length of the force.*imu\.csv: length of the acceleration/);
    await identify(page);
    const rig = await downloaded(page, "Download the rig file");
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const native = program({ ...texts, "together.rig.toml": rig }, ["identify", "together.rig.toml", "--json", "--out", "answer"]);
    const found = compare(ours, JSON.parse(native.output));
    assert.ok(found.off < 1e-6, `estimates differ by ${found.off} U95`);
    const mass = ours.parameters.find(({ name }) => name === "m");
    assert.ok(Math.abs(mass.value - SWINGING.m) < mass.u95, JSON.stringify(mass));
    // A shift by hand is in the rig file, and over a reload; the program still sets the rest by the motion.
    await page.locator("[data-shift='imu.csv']").fill("-250");
    await page.locator("[data-shift='imu.csv']").blur();
    await state(page, "The recording is understood");
    assert.match(await page.locator("#rig").inputValue(), /file = "imu.csv"\nclock_offset_s = -250\.0\n/);
    await page.waitForTimeout(300);
    await page.reload();
    await state(page, "The recording is understood");
    assert.equal(await page.locator("[data-shift='imu.csv']").inputValue(), "-250");
    // The rig file itself, chosen with both files, is the same recording.
    await forget(page);
    await choose(page, ...Object.entries({ ...texts, "run.rig.toml": rig }).map(([name, text]) => file(name, text)));
    await state(page, "run.rig.toml is understood");
    assert.equal(await page.locator("#clocks-chart path.curve").count(), 2);
    assert.deepEqual(errors, []);
  },

  async "loggers whose clocks nothing aligns are shown, and that is said"(chromium, address) {
    const { page } = await opened(chromium, address);
    // Another run of another motion: nothing aligns it.
    const texts = { ...twoLoggers(swinging(20, 200), (t) => t), "imu.csv": twoLoggers(swinging(15, 200, 1.7), (t) => 900 + t)["imu.csv"] };
    await choose(page, ...Object.entries(texts).map(([name, text]) => file(name, text)));
    await page.getByRole("radio", { name: /all tables as one recording/ }).check();
    await page.locator("#clocks-error").waitFor();
    assert.match(await page.locator("#clocks-error").textContent(), /do not overlap/);
    assert.match(await page.locator("#clocks-caption").textContent(), /each is drawn from its own beginning/);
    assert.ok(await page.locator("#job").isHidden());
  },

  async "a certificate is made, is a draft while something is missing, and is the program's"(chromium, address) {
    const { page, errors } = await opened(chromium, address);
    await page.locator("#example").click();
    await state(page, "is understood");
    await identify(page);
    await page.locator("#certificate-details > summary").click();
    await page.locator("#certify-number").fill("2026-117");
    await page.locator("#make-certificate").click();
    await page.locator("#certificate-words").filter({ hasText: "A draft: not stated: name of the laboratory" }).waitFor({ timeout: 60_000 });
    await page.frameLocator("#certificate-page").getByText("Draft of a certificate").first().waitFor();
    for (const label of await page.locator("#certificate-fields label").all()) {
      if (!(await label.isVisible()) || !(await label.textContent()).includes("*")) continue;
      const input = label.locator("input");
      if ((await input.inputValue()) === "") await input.fill("Beispiel & Söhne \"A\"");
    }
    await page.locator("#certify-measured_on").fill("2026-11-29");
    await page.locator("#make-certificate").click();
    await page.locator("#certificate-words").filter({ hasText: "The certificate is complete." }).waitFor({ timeout: 60_000 });
    assert.equal(await page.evaluate(() => document.activeElement.id), "certificate-words");
    const certificate = page.frameLocator("#certificate-page");
    await certificate.getByRole("heading", { name: "Certificate of measurement" }).waitFor();
    const shown = await downloaded(page, "Download certificate.html");
    const rig = await downloaded(page, "Download the rig file");
    const options = ["number=2026-117", "measured_on=2026-11-29", ...["laboratory", "laboratory_address", "place", "operator", "authorised_by", "customer", "customer_address", "part",
      "part_serial", "procedure", "conditions", "traceability"].map((key) => `${key}=Beispiel & Söhne "A"`)];
    const native = program({ "bracket.csv": BRACKET, "bracket.rig.toml": rig }, ["identify", "bracket.csv", "--json", "--out", "answer", "--certificate", "certificate.html",
      ...options.flatMap((words) => ["--certify", words])]);
    assert.equal(native.status, 0, native.errors);
    const dated = (text) => text.replace(/(Evaluated on<\/th><td>)[^<]*/, "$1");
    assert.equal(dated(shown), dated(readFileSync(join(native.folder, "certificate.html"), "utf8")));
    // Its hashes are those of the files, by another implementation.
    for (const text of [BRACKET, rig]) assert.ok(shown.includes(createHash("sha256").update(text).digest("hex")));
    await page.waitForTimeout(300);
    await page.reload();
    await page.locator("#certificate").waitFor();
    assert.equal(await page.locator("#certify-number").inputValue(), "2026-117");
    assert.deepEqual(errors, []);
  },

  async "a recording that cannot be true has no certificate"(chromium, address) {
    const { page } = await opened(chromium, address);
    const rows = BRACKET.trim().split("\n").map((row, n) => (n === 0 ? row : row.split(",").map((cell, k) => (k >= 4 && k <= 6 ? String(1000 * Number(cell)) : cell)).join(",")));
    await choose(page, file("wrong.csv", rows.join("\n")), file("wrong.rig.toml", BRACKET_RIG));
    await state(page, "is understood");
    await identify(page);
    assert.ok(await page.locator("#certificate").isHidden());
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
    const recording = readFileSync(join(SHARED, "data/endeffector_ati_gamma_imu/0-calibration_fts-accel.csv"), "utf8");
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
};
