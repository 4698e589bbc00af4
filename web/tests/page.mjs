// The page in a browser: its answers are the program's, nothing is sent, nothing is lost, and it says faults in words.

import assert from "node:assert/strict";
import { existsSync, rmSync } from "node:fs";

import { RIGIDENT_SITE, SHARED, place } from "./helpers.mjs";
import { tests as people } from "./people.mjs";
import { tests as recordings } from "./recordings.mjs";
import { asked, browser, serve } from "./site.mjs";
import { tests as use } from "./use.mjs";

const tests = { ...recordings, ...people, ...use };
const wanted = process.argv.slice(2);

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
    // Nothing is sent: everything that was asked for is a file of the page.
    for (const request of asked.splice(0)) {
      assert.ok(request.url().startsWith(site.address) && request.method() === "GET" && request.postData() === null, request.url());
    }
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
