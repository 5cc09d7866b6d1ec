// A guided study as a quality engineer makes it: begun, interrupted by a restart, one trial taken again, with the report that the
// command line prints of the same values.
import { strict as assert } from "node:assert";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { Daemon, Place } from "./daemon.js";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const SIZES = { desktop: { width: 1440, height: 900 }, phone: { width: 390, height: 844 } };

export async function studies({ browser, program, step, folder, full }) {
  const [parts, names, trials] = full ? [10, ["A", "B", "C"], 3] : [3, ["A", "B"], 2];
  const all = parts * names.length * trials;
  const place = new Place();
  let daemon = await Daemon.start(program, place);
  const { secret } = daemon;
  const page = await (await browser.newContext({ viewport: SIZES.desktop })).newPage();
  page.setDefaultTimeout(60000);
  const enter = async () => {
    await page.waitForSelector("#state[data-state=ready]");
    await page.click("#sign");
    await page.fill("#secret", secret);
    await page.click("#sign-in button[type=submit]");
    await page.waitForFunction(() => document.querySelector("#sign").textContent === "Sign out");
    await page.click("nav a[href='#history']");
  };
  // Takes trials until so many are there.
  const until = async (count) => {
    for (let at = Number((await page.textContent("#study-count")).split(" ")[0]); at < count; at += 1) {
      await page.waitForSelector("#study-trigger:enabled");
      await page.click("#study-trigger");
      await page.waitForFunction((wanted) => document.querySelector("#study-count").textContent.startsWith(`${wanted} of`), at + 1);
    }
  };
  const accessible = async () => {
    await page.evaluate(AXE);
    for (const colorScheme of ["light", "dark"]) {
      for (const name of Object.keys(SIZES)) {
        await page.emulateMedia({ colorScheme });
        await page.setViewportSize(SIZES[name]);
        const { violations } = await page.evaluate(() => window.axe.run("#study, #studies", { runOnly: ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa", "best-practice"] }));
        assert.deepEqual(violations.map(({ id, nodes }) => [id, nodes[0].html]), [], `${name}, ${colorScheme}`);
        assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth), `${name}: wider than the screen`);
        if (folder) await page.locator("#study").screenshot({ path: join(folder, `study-${name}-${colorScheme}.png`) });
      }
    }
    await page.setViewportSize(SIZES.desktop);
    await page.emulateMedia({ colorScheme: "light" });
  };
  try {
    await step("a guided study asks for each trial, and goes on after a restart", async () => {
      await page.goto(daemon.url);
      await enter();
      await page.waitForSelector("#study-slots input");
      await page.fill("#study-parts", String(parts));
      await page.fill("#study-appraisers", names.join(", "));
      await page.fill("#study-trials", String(trials));
      await page.click("#study-begin button[type=submit]");
      await page.waitForSelector("#study:not([hidden])");
      assert.equal(await page.textContent("#study-next"), `Next: part 1, appraiser ${names[0]}, trial 1`);
      await page.click("#study-run");
      await until(2);
      assert.equal(await page.textContent("#study-next"), `Now: part 3, appraiser ${names[0]}, trial 1`);
      await until(Math.floor(all / 2));
      const address = new URL(daemon.url).host;
      await daemon.end("SIGKILL");
      daemon = await Daemon.start(program, place, "good", address);
      await page.reload();
      await enter();
      await page.click("#study-rows button.open");
      await page.waitForFunction((count) => document.querySelector("#study-count").textContent.startsWith(`${count} of`), Math.floor(all / 2));
      assert.equal(await page.textContent("#study-run"), "Go on");
      await page.click("#study-run");
      await until(all);
      await page.waitForSelector("#study-report section");
    });

    await step("one trial is taken again, and the report is that of the command line, bit by bit", async () => {
      const before = await page.textContent("#study-table tbody button");
      await page.click("#study-table tbody button");
      await page.waitForSelector("#study-trigger:enabled");
      await page.click("#study-trigger");
      await page.waitForFunction((old) => document.querySelector("#study-table tbody button").textContent !== old, before);
      const answer = async (path) => page.evaluate(async (at) => (await fetch(at)).text(), path);
      const values = join(place.folder, "values.csv");
      writeFileSync(values, await answer("api/studies/1/values.csv"));
      const printed = execFileSync(program, ["study", "grr", values, "--json"], { encoding: "utf8" });
      assert.equal(JSON.stringify(JSON.parse(await answer("api/studies/1/report.json"))), JSON.stringify(JSON.parse(printed)));
      const verdicts = await page.locator("#study-report .tag").allTextContents();
      assert.deepEqual(verdicts, JSON.parse(printed).studies.map(({ judgement }) => judgement.verdict));
    });

    await step("the study is accessible, light and dark, on a phone and a desktop", accessible);
    await step("the report on paper has what is folded on the screen", async () => {
      const folded = () => page.locator("#study-report details:not([open])").count();
      const before = await folded();
      assert.ok(before > 0);
      await page.evaluate(() => { window.print = () => {}; });
      await page.click("[data-report=study]");
      await page.keyboard.press("Enter");
      await page.waitForFunction(() => document.body.dataset.report === "study");
      assert.equal(await folded(), 0);
      await page.emulateMedia({ media: "print" });
      assert.ok(await page.isVisible("#study-report details table"));
      await page.emulateMedia({ media: null });
      await page.evaluate(() => window.dispatchEvent(new Event("afterprint")));
      assert.equal(await folded(), before);
    });
  } finally {
    await page.context().close();
    await daemon.end("SIGKILL");
    place.remove();
  }
}
