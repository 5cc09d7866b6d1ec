// Statistics as a production engineer asks them: which gauge drifted, which part was the first, the list and the file of a range; and
// reports on paper. By pointer on a desktop, by keyboard alone, and on a phone.
import { strict as assert } from "node:assert";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { Daemon, Place, head } from "./daemon.js";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const SIZES = { desktop: { width: 1440, height: 900 }, phone: { width: 390, height: 844 } };
// Parts before and after the die wears out.
const [GOOD, WORN] = [34, 16];

const WORN_DIE = `${head(256)}[part]
kind = "sheet_metal"
defects = [{ kind = "dent", x = 0.0, y = -8.0, depth_mm = 0.1, diameter_mm = 30.0 }]
`;

export async function statistics({ browser, program, step, folder }) {
  const place = new Place();
  place.put("worn", WORN_DIE);
  let daemon = await Daemon.start(program, place);
  const { secret, url } = daemon;
  const open = async (viewport) => {
    const page = await (await browser.newContext({ viewport, acceptDownloads: true })).newPage();
    page.setDefaultTimeout(60000);
    await page.addInitScript(() => { window.print = () => { window.printed = (window.printed || 0) + 1; }; });
    await page.goto(url);
    await page.waitForSelector("#state[data-state=ready]");
    return page;
  };
  const page = await open(SIZES.desktop);
  const signIn = async () => {
    await page.click("#sign");
    await page.fill("#secret", secret);
    await page.click("#sign-in button[type=submit]");
    await page.waitForFunction(() => document.querySelector("#sign").textContent === "Sign out");
  };
  const measured = (count, from) => page.evaluate(async ([parts, first]) => {
    for (let part = first; part < first + parts; part += 1) {
      const answer = await fetch("/api/trigger", { method: "POST", body: JSON.stringify({ token: `part-${part}`, part_id: part, press_stroke: 10 * part }) });
      if (!answer.ok) throw new Error(await answer.text());
    }
  }, [count, from]);
  const DRIFT = "#statistics-rows tr:has(th button:text-is('deviation')) td:last-child button";
  const first = async (on) => Number((await on.textContent(DRIFT)).replace(/\D/g, ""));
  const accessible = async (on, what) => {
    await on.evaluate(AXE);
    for (const colorScheme of ["light", "dark"]) {
      for (const name of Object.keys(SIZES)) {
        await on.emulateMedia({ colorScheme });
        await on.setViewportSize(SIZES[name]);
        const { violations } = await on.evaluate((root) => window.axe.run(root, { runOnly: ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa", "best-practice"] }), what);
        assert.deepEqual(violations.map(({ id, nodes }) => [id, nodes[0].html]), [], `${what}, ${name}, ${colorScheme}`);
        assert.ok(await on.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth), `${name}: wider than the screen`);
        if (folder) await on.locator(what).screenshot({ path: join(folder, `${what.slice(1)}-${name}-${colorScheme}.png`) });
      }
    }
    await on.setViewportSize(SIZES.desktop);
    await on.emulateMedia({ colorScheme: "light" });
  };
  // Prints with a name in both sizes; answers with what is on the paper.
  const printed = async (on, kind) => {
    let shown = [];
    for (const format of ["A4", "Letter"]) {
      const before = await on.evaluate(() => window.printed || 0);
      await on.click(`[data-report=${kind}]`);
      await on.fill("#question-text", "Ann Other");
      await on.keyboard.press("Enter");
      await on.waitForFunction((count) => window.printed > count, before);
      await on.emulateMedia({ media: "print" });
      shown = await on.evaluate(() => [...document.querySelectorAll("main section, main form, main figure, header, footer, nav")].filter((one) => one.id && one.offsetParent).map((one) => one.id));
      const said = await on.textContent("#report-head");
      for (const words of ["serial", "fingerprint", "Calibration", "Program", "by Ann Other"]) assert.ok(said.includes(words), `${kind}: ${words} is missing in ${said}`);
      await on.emulateMedia({ media: null });
      // The browser ends the report when it has printed.
      const file = await on.pdf({ format, ...(folder ? { path: join(folder, `report-${kind}-${format}.pdf`) } : {}) });
      assert.ok(file.length > 9000 && file.toString("latin1").includes("/Type /Page"), `${kind}: ${file.length} bytes`);
      assert.equal(await on.evaluate(() => document.body.dataset.report), undefined);
    }
    return shown;
  };
  try {
    await step("which gauge drifted, and which part was the first, in two actions", async () => {
      await signIn();
      await measured(GOOD, 1);
      const address = new URL(url).host;
      await daemon.end();
      daemon = await Daemon.start(program, place, "worn", address);
      await page.reload();
      await page.waitForSelector("#state[data-state=ready]");
      await signIn();
      await measured(WORN, GOOD + 1);
      await page.click("nav a[href='#history']");
      await page.waitForSelector(DRIFT);
      const seq = await first(page);
      assert.ok(Math.abs(seq - (GOOD + 1)) <= 1, `it began with ${GOOD + 1}, not with ${seq}`);
      assert.equal(await page.locator("#statistics-rows td:last-child button").count(), 1, "only the deviation drifted");
      await page.click(DRIFT);
      await page.waitForSelector("#kept:not([hidden])");
      assert.ok((await page.textContent("#kept-facts")).includes(`Part${seq}`));
      await page.click("#kept-close");
    });

    await step("a repeated token has the same result, and is not measured again", async () => {
      const seqs = await page.evaluate(async () => {
        const ask = async () => (await (await fetch("/api/trigger", { method: "POST", body: JSON.stringify({ token: "part-1" }) })).json()).result.seq;
        const counted = async () => (await (await fetch("/api/snapshot")).json()).counters.sequence;
        const before = await counted();
        return [await ask(), await ask(), await counted() - before];
      });
      assert.deepEqual(seqs, [1, 1, 0]);
    });

    await step("a column of the chart opens its result, and several become the list and the file, by keys alone", async () => {
      await page.selectOption("#statistics-axis", "stroke");
      await page.waitForFunction(() => /as of/.test(document.querySelector("#statistics-progress").textContent));
      await page.focus("#statistics-rows th button");
      await page.keyboard.press("Enter");
      await page.waitForSelector("#run-chart .mean", { state: "attached" });
      await page.focus("#run-chart");
      await page.keyboard.press("End");
      assert.match(await page.textContent("#chart-cursor"), /stroke 500: 1 values/);
      await page.keyboard.press("Enter");
      await page.waitForFunction(() => document.querySelector("#kept-facts").textContent.includes("Press stroke500"));
      await page.focus("#run-chart");
      for (let column = 0; column < 8; column += 1) await page.keyboard.press("Shift+PageUp");
      const [from] = /stroke \d+/.exec(await page.textContent("#chart-cursor"))[0].match(/\d+/);
      await page.keyboard.press("Enter");
      const many = Math.floor((500 - Number(from)) / 10) + 1;
      await page.waitForFunction((count) => document.querySelectorAll("#history-rows tr").length === count, many);
      const [file] = await Promise.all([page.waitForEvent("download"), page.click("#history-csv")]);
      const lines = readFileSync(await file.path(), "utf8").trim().split("\n");
      assert.equal(lines.length, many + 1);
      await page.click("#filter-range-drop");
      await page.waitForFunction((count) => document.querySelectorAll("#history-rows tr").length === count, GOOD + WORN);
    });

    await step("statistics are accessible on both screens", async () => { await accessible(page, "#statistics"); });

    await step("parts, periods and studies are printed with what an audit asks", async () => {
      assert.deepEqual(await printed(page, "period"), ["report-head", "statistics", "chart-card", "statistics-yield"]);
      await page.click("#history-rows button.open");
      await page.waitForSelector("#kept:not([hidden])");
      assert.deepEqual(await printed(page, "part"), ["report-head", "kept"]);
      await page.click("nav a[href='#live']");
      assert.deepEqual(await printed(page, "live"), ["report-head", "verdict", "gauges", "picture", "counters"]);
      await page.click("nav a[href='#history']");
      await page.fill("#study-parts", "2");
      await page.fill("#study-trials", "2");
      await page.click("#study-begin button[type=submit]");
      await page.waitForSelector("#study:not([hidden])");
      assert.deepEqual(await printed(page, "study"), ["report-head", "study"]);
      await page.click("[data-report=study]");
      await accessible(page, "#question");
      await page.keyboard.press("Escape");
    });

    await step("shifts, days and weeks begin where they do by the clock on the wall", async () => {
      // A day of 23 hours; one hour before its end; a shift and a week over the turn of a year.
      for (const [now, period, since] of [
        ["2027-03-28T12:00:00+02:00", "day", "2027-03-28T00:00:00+01:00"],
        ["2027-03-28T23:30:00+02:00", "shift", "2027-03-28T22:00:00+02:00"],
        ["2027-10-31T03:30:00+01:00", "day", "2027-10-31T00:00:00+02:00"],
        ["2027-01-01T02:00:00+01:00", "shift", "2026-12-31T22:00:00+01:00"],
        ["2027-01-01T02:00:00+01:00", "week", "2026-12-28T00:00:00+01:00"],
        ["2027-04-01T10:00:00+02:00", "week", "2027-03-29T00:00:00+02:00"],
      ]) {
        const context = await browser.newContext({ viewport: SIZES.desktop, timezoneId: "Europe/Berlin" });
        const other = await context.newPage();
        await other.clock.setFixedTime(new Date(now));
        const asked = [];
        other.on("request", (request) => { if (request.url().includes("/api/statistics")) asked.push(new URL(request.url()).searchParams.get("since_us")); });
        await other.goto(`${url}/#history`);
        await other.waitForFunction(() => document.querySelector("#statistics-recipe").value !== "");
        await other.evaluate((value) => { const select = document.querySelector("#statistics-period"); select.value = value; select.dispatchEvent(new Event("change")); }, period);
        const wanted = String(1000 * Date.parse(since));
        for (let turn = 0; turn < 100 && !asked.includes(wanted); turn += 1) await new Promise((resolve) => { setTimeout(resolve, 50); });
        assert.ok(asked.includes(wanted), `${period} at ${now}: ${asked.map((us) => new Date(us / 1000).toISOString())} instead of ${since}`);
        await context.close();
      }
    });

    await step("a phone answers the same, in the dark", async () => {
      const phone = await open(SIZES.phone);
      await phone.emulateMedia({ colorScheme: "dark" });
      await phone.click("nav a[href='#history']");
      await phone.waitForSelector(DRIFT);
      assert.ok(Math.abs(await first(phone) - (GOOD + 1)) <= 1);
      await phone.close();
    });
  } finally {
    await daemon.end();
    place.remove();
  }
}
