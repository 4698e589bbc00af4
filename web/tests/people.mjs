// People in the page: trials, markers, time line, answer.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";

import { SHARED, choose, compare, downloaded, file, program, state } from "./helpers.mjs";
import { opened } from "./site.mjs";

/** A motion's time line moves by keys, and its clock with it; the picture is not empty. */
async function plays(page, frame) {
  const motion = page.frameLocator(frame).first();
  const slider = motion.locator("#time");
  await slider.focus();
  await page.keyboard.press("Home");
  // It may be playing.
  if ((await motion.locator("#play").textContent()).trim() === "Pause") await motion.locator("#play").click();
  await slider.focus();
  await page.keyboard.press("Home");
  await motion.locator("#clock").filter({ hasText: /^0\.00 \// }).waitFor();
  const before = await motion.locator("#scene").screenshot();
  await page.keyboard.press("End");
  await motion.locator("#clock").filter({ hasNotText: /^0\.00 \// }).waitFor();
  const after = await motion.locator("#scene").screenshot();
  assert.ok(!before.equals(after), "the picture does not change");
}

export const tests = {
  async "shared_data: a person is answered as by the program"(chromium, address) {
    const { page } = await opened(chromium, address);
    const folder = join(SHARED, "data/human_btk_pig_60kg_functional");
    const trials = Object.fromEntries(["FunctionalWalk.c3d", "FunctionalStatic.c3d"].map((name) => [name, readFileSync(join(folder, name))]));
    await choose(page, ...Object.entries(trials).map(([name, buffer]) => ({ name, mimeType: "application/octet-stream", buffer })));
    await state(page, "A person's trials");
    // Markers and their segments, and the trial over time, before anything is computed.
    await page.locator("#markers-words").filter({ hasText: /Marker set: Plug-in Gait/ }).waitFor({ timeout: 60_000 });
    await plays(page, "#trial-motion");
    await page.locator("#markers-details > summary").click();
    const knee = page.locator("#markers tr").filter({ has: page.getByRole("rowheader", { name: "LKNE", exact: true }) });
    assert.match(await knee.textContent(), /l_thigh, by its name/);
    await page.locator("#height").fill("1.68");
    await page.locator("#identify").click();
    await page.locator("#answer").waitFor({ timeout: 600_000 });
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const native = program(trials, ["body", "identify", "FunctionalWalk.c3d", "--static", "FunctionalStatic.c3d", "--height-m", "1.68", "--json", "--out", "answer"]);
    const found = compare(ours, JSON.parse(native.output));
    console.log(`  ${found.equal} of ${found.count} numbers equal to the last bit; estimates within ${found.off.toExponential(1)} U95`);
    // Iterations of poses end at 1e-6 of a step, which the last digits of sines can move by one.
    assert.ok(found.off < 1e-3, `estimates differ by ${found.off} U95`);
    await plays(page, "#motions iframe");
  },

  async "shared_data: a person of TRC and MOT, with a marker whose name says nothing"(chromium, address) {
    const { page, errors } = await opened(chromium, address);
    const folder = join(SHARED, "data/human_gait2354_subject01_walk");
    const read = (name) => readFileSync(join(folder, name), "utf8");
    const walk = read("subject01_walk1.trc").replace("R.Shank.Upper", "M17");
    assert.ok(walk.includes("M17"));
    const trials = { "walk.trc": walk, "forces.mot": read("subject01_walk1_grf.mot"), "standing.trc": read("subject01_static.trc") };
    await choose(page, ...Object.entries(trials).map(([name, text]) => file(name, text)));
    await state(page, "A person's trials");
    assert.equal(await page.locator("[data-ground='walk.trc']").inputValue(), "forces.mot");
    assert.equal(await page.locator("[data-trial='standing.trc']").inputValue(), "static");
    await page.locator("#markers-words").filter({ hasText: /1 name is not known/ }).waitFor({ timeout: 60_000 });
    assert.match(await page.locator("#markers-words").textContent(), /forces of /);
    await plays(page, "#trial-motion");
    // Its name is shown where the pointer is; it is put on its segment.
    await page.locator("#markers-details > summary").click();
    await page.locator("[data-marker='M17']").selectOption("r_shank");
    assert.equal(await downloaded(page, "Download the file of markers"), "[marker.\"M17\"]\nsegment = \"r_shank\"\n");
    await page.locator("#mass").fill("72.6");
    await page.locator("#identify").click();
    await page.locator("#answer").waitFor({ timeout: 600_000 });
    const ours = JSON.parse(await downloaded(page, "Download result.json"));
    const marked = { ...trials, "page.markers.toml": "[marker.\"M17\"]\nsegment = \"r_shank\"\n" };
    const native = program(marked, ["body", "identify", "walk.trc", "--static", "standing.trc", "--ground", "forces.mot", "--mass-kg", "72.6", "--markers", "page.markers.toml", "--json", "--out", "answer"]);
    const found = compare(ours, JSON.parse(native.output));
    console.log(`  ${found.equal} of ${found.count} numbers equal to the last bit; estimates within ${found.off.toExponential(1)} U95`);
    assert.ok(found.off < 1e-3, `estimates differ by ${found.off} U95`);
    assert.deepEqual(errors, []);
  },

  async "a trial that cannot be read gives words"(chromium, address) {
    const { page } = await opened(chromium, address);
    await choose(page, file("walk.c3d", "this is no C3D file"));
    await page.locator("#person-error").waitFor();
    assert.match(await page.locator("#person-error").textContent(), /walk\.c3d/);
  },
};
