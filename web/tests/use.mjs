// Use of the page by keyboard, by a screen reader, on a narrow screen, in the dark; and pictures to look at.

import assert from "node:assert/strict";
import { mkdirSync, readFileSync } from "node:fs";
import { join } from "node:path";

import { BRACKET, RIGIDENT_PICTURES, choose, file, foreign, forget, identify, state } from "./helpers.mjs";
import { opened } from "./site.mjs";
import { swinging, twoLoggers } from "./swinging.mjs";

/** Takes the page through its parts; `each` is called with the name of the part that is shown. */
async function parts(page, each) {
  await choose(page, file("body.csv", BRACKET));
  await state(page, "is understood");
  await page.locator("#imu-x").fill("50");
  await page.getByRole("button", { name: "about y" }).click();
  await each("understood");
  await page.locator("#rig-details > summary").click();
  await choose(page, file("log.csv", foreign()));
  await page.getByRole("radio", { name: "Identify from log.csv" }).check();
  await page.locator("#understood-error").waitFor();
  await each("questions");
  await page.locator("#example").click();
  await state(page, "is understood");
  await identify(page);
  await each("answer");
  await page.locator("#certificate-details > summary").click();
  await page.locator("#make-certificate").click();
  await page.locator("#certificate-words").waitFor({ timeout: 60_000 });
  await each("certificate");
  await page.locator("#by-level").click();
  await page.locator("#pose-table input").first().fill("15");
  await each("poses");
  await forget(page);
  const loggers = twoLoggers(swinging(10, 200), (t) => 40 + t);
  await choose(page, ...Object.entries(loggers).map(([name, text]) => file(name, text)));
  await page.getByRole("radio", { name: /all tables as one recording/ }).check();
  await page.locator("#clocks").waitFor({ timeout: 60_000 });
  await each("clocks");
  await forget(page);
  await choose(page, file("walk.trc", walking()));
  await page.locator("#markers-words").filter({ hasText: "frames" }).waitFor({ timeout: 60_000 });
  await page.locator("#markers-details").evaluate((details) => { details.open = true; });
  await each("person");
}

/** A few markers that move along, as TRC; one of them has a name that says nothing. */
function walking() {
  const labels = ["LASI", "RASI", "LPSI", "RPSI", "LKNE", "RKNE", "LANK", "RANK", "LSHO", "RSHO", "odd"];
  const at = [[0, 950, 120], [0, 950, -120], [-150, 950, 50], [-150, 950, -50], [0, 500, 100], [0, 500, -100], [0, 80, 100], [0, 80, -100], [0, 1400, 180], [0, 1400, -180], [50, 1200, 0]];
  const head = `PathFileType\t4\t(X/Y/Z)\twalk.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t100\t${labels.length}\tmm\t100\t1\t100\n`;
  const names = `Frame#\tTime\t${labels.map((name) => `${name}\t\t`).join("\t")}\n\t\t${labels.map((_, k) => `X${k + 1}\tY${k + 1}\tZ${k + 1}`).join("\t")}\n\n`;
  const rows = Array.from({ length: 100 }, (_, n) => `${n + 1}\t${(n / 100).toFixed(2)}\t${at.map(([x, y, z], k) => `${(x + 10 * n).toFixed(2)}\t${(y + 30 * Math.sin(n / 9 + k)).toFixed(2)}\t${z}`).join("\t")}`);
  return `${head}${names}${rows.join("\n")}\n`;
}

export const tests = {
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

  async "rules of accessibility hold on every part of the page, light and dark, wide and narrow"(chromium, address) {
    const rules = readFileSync(join(process.env.NODE_PATH, "axe-core/axe.min.js"), "utf8");
    for (const [width, colorScheme] of [[1280, "light"], [1280, "dark"], [390, "light"], [390, "dark"]]) {
      const { page, context } = await opened(chromium, address, { viewport: { width, height: 844 }, colorScheme });
      const check = async (part) => {
        await page.evaluate(rules);
        const broken = await page.evaluate(() => globalThis.axe.run(document, { iframes: false }).then(({ violations }) => violations.flatMap(({ id, nodes }) => nodes.map((node) => `${id}: ${node.html.slice(0, 160)}`))));
        assert.deepEqual(broken, [], `${part} at ${width} px, ${colorScheme}`);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(wide <= 0, `${part} is ${wide} px wider than ${width} px`);
      };
      await check("the beginning");
      await parts(page, check);
      await context.close();
    }
  },

  async "pictures"(chromium, address) {
    if (!RIGIDENT_PICTURES) return;
    mkdirSync(RIGIDENT_PICTURES, { recursive: true });
    for (const width of [1280, 390]) {
      for (const colorScheme of ["light", "dark"]) {
        const { page, context } = await opened(chromium, address, { viewport: { width, height: 900 }, colorScheme });
        await parts(page, async (part) => {
          await page.waitForTimeout(200);
          await page.screenshot({ path: join(RIGIDENT_PICTURES, `${part}-${width}-${colorScheme}.png`), fullPage: true });
        });
        await context.close();
      }
    }
  },
};
