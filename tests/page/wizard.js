// A technician with a phone: from a head that knows nothing of itself to a PASS and a FAIL, with a reload in each step.
import { strict as assert } from "node:assert";
import { execFile } from "node:child_process";
import { join } from "node:path";
import { promisify } from "node:util";
import { Daemon, Place } from "./daemon.js";

const PHONE = { width: 360, height: 780 }, DESKTOP = { width: 1280, height: 800 };
// The slowest step measures delay, response and noise.
const PATIENCE = 240000;
// Time over which live pictures are counted, and the fewest per second.
const LOOK_MS = 5000, RATE = 2;
// Poses that are tried, and the fewest that must be usable.
const POSES = 10, USED = 8;
// RMS of the heights against the truth of the simulator, mm.
const HEIGHTS = 0.05;

// Neither the poses and lenses of camera and projector nor gamma, blur and delay are known to the product.
const BARE = `calibrated = false
sub_rays = 2
[rig.camera]
angle_deg = 20.4
distortion = [-0.1, 0.12, 3e-4, -2e-4, 0.0]
[rig.projector]
angle_deg = -7.2
[noise]
noise_counts = 3.0
[optics]
gamma = 1.9
projector_blur_px = 0.8
camera_blur_px = 0.4
[timing]
flip_to_light_us = 21000
[part]
kind = "plane"
`;

export async function wizard({ browser, program, step, folder }) {
  const place = new Place(512);
  place.put("bare", BARE);
  let daemon = await Daemon.start(program, place, "bare");
  const context = await browser.newContext({ viewport: PHONE, hasTouch: true });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("response", (response) => { if (response.status() === 404) complaints.push(`${response.url()} is not there`); });

  const head = () => page.evaluate(async () => (await fetch("/api/head")).json());
  const state = async (name) => (await head()).steps.find((one) => one.name === name);
  const notice = (words) => page.waitForFunction((wanted) => !document.querySelector("#notice").hidden && document.querySelector("#notice").textContent.includes(wanted), words);
  const is = (name, wanted) => page.waitForSelector(`#step-${name}[data-state=${wanted}]`);
  const ended = (name) => page.waitForSelector(`#step-${name}[data-state=done], #step-${name}[data-state=failed]`);
  const words = (name) => page.locator(`#step-${name} .said li`).allTextContents();

  // The page knows the same after a reload: it is kept by the device.
  async function reload(name) {
    const before = await words(name);
    await page.reload();
    await ended(name);
    assert.deepEqual(await words(name), before, `${name} after a reload`);
  }

  async function run(name) {
    await page.waitForSelector(`#step-${name}[open] > button:not(.end):enabled`);
    // Reloaded as soon as the step has begun.
    await Promise.all([page.waitForResponse((response) => response.url().endsWith(`/steps/${name}`)), page.click(`#step-${name} > button:not(.end)`)]);
    await page.reload();
    await ended(name);
    const { state: outcome, said, remedy } = await state(name);
    assert.equal(outcome, "done", `${name}: ${said.join("; ")}: ${remedy}`);
    assert.ok((await words(name)).length > 0, `${name} says nothing`);
    await reload(name);
  }

  // While it is on its way, no step can begin.
  async function put(button, part) {
    await page.evaluate(() => { document.querySelector("#notice").hidden = true; });
    await page.click(button);
    await page.waitForSelector("#pose-take:disabled", { state: "attached" });
    await notice(part);
    await page.waitForSelector("#pose-take:enabled", { state: "attached" });
  }

  async function shot(name, form, target, opened) {
    if (!folder) return;
    const [size, colorScheme] = form.split("-");
    const other = await browser.newContext({ viewport: size === "phone" ? PHONE : DESKTOP, colorScheme });
    await other.addCookies(await context.cookies());
    const shown = await other.newPage();
    await shown.goto(`${daemon.url}/#head`);
    await shown.waitForSelector("#live-picture[data-number]");
    if (opened) await shown.evaluate((selector) => { document.querySelector(selector).open = true; }, opened);
    await shown.waitForTimeout(2500);
    await shown.evaluate((selector) => document.querySelector(selector).scrollIntoView({ block: "start" }), target);
    await shown.waitForTimeout(500);
    assert.ok(await shown.evaluate(() => !document.body.classList.contains("stale")), "two pages that show the live picture make the verdict stale");
    await shown.screenshot({ path: join(folder, `${name}-${form}.png`) });
    await other.close();
  }

  async function trigger(wanted) {
    await page.click("nav a[href='#live']");
    await page.waitForSelector("#trigger:enabled");
    const before = await page.textContent("#sequence");
    await page.click("#trigger");
    await page.waitForFunction((seq) => document.querySelector("#sequence").textContent !== seq, before);
    await page.waitForSelector(`#verdict[data-verdict=${wanted}]`);
  }

  // Takes the board in one of the simulator's poses, after `used` others; forgets it if it cannot be used, as it may be beside the light.
  async function pose(number, used) {
    await page.selectOption("#board-pose", String(number));
    await put("#board-place", "board is in place");
    await page.click("#pose-take");
    await page.waitForFunction((count) => document.querySelectorAll("#poses li").length === count, used + 1);
    await page.waitForSelector("#pose-take:enabled");
    const last = page.locator("#poses li").last();
    const said = await last.textContent();
    if (/✓ can be used.*11\d of 117 corners/.test(said)) return used + 1;
    console.log(`  ${said}`);
    assert.match(said, /cannot be used: .*\w/);
    await last.locator("button:has-text('Forget')").click();
    await page.waitForFunction((count) => document.querySelectorAll("#poses li").length === count, used);
    await page.waitForSelector("#pose-take:enabled");
    return used;
  }

  try {
    await step("a head that knows nothing of itself leads to its set-up", async () => {
      await page.goto(daemon.url);
      await page.waitForSelector("#view-head:not([hidden])");
      await page.waitForSelector("#bare:not([hidden])");
      assert.match(await page.textContent("#bare"), /step 1 of 7, Devices/);
      assert.ok(await page.locator("#step-devices").getAttribute("open") !== null, "the first step is closed");
      assert.ok(await page.isVisible("#live-locked"), "the live picture needs no session");
      assert.equal(await page.evaluate(async () => (await fetch("/api/head/live?show=white")).status), 401);
      await page.click("#live-sign");
      await page.fill("#secret", daemon.secret);
      await page.click("#sign-in button[type=submit]");
      await page.waitForSelector("#live-picture[data-number]");
    });

    await step(`the live picture comes at least ${RATE} times a second, and only while somebody looks`, async () => {
      const number = async () => Number(await page.getAttribute("#live-picture", "data-number"));
      const before = await number();
      await page.waitForTimeout(LOOK_MS);
      const rate = 1000 * (await number() - before) / LOOK_MS;
      console.log(`  ${rate.toFixed(1)} pictures a second`);
      assert.ok(rate >= RATE, `${rate} pictures a second`);
      assert.equal(await page.textContent("#stale-words"), "", "live pictures stop the heartbeat");
      assert.ok(await page.locator("#histogram rect").count() === 64);
      for (const [pitch, shown] of [[8, "fringes8"], [12, "fringes12"]]) {
        await page.selectOption("#live-show", shown);
        await page.waitForFunction((id) => /\d %/.test(document.querySelector(id).textContent), `#live-fringes${pitch}`);
      }
      await page.selectOption("#live-show", "white");
      await page.click("nav a[href='#device']");
      let asked = 0;
      const count = (request) => { if (request.url().includes("/api/head/live")) asked += 1; };
      page.on("request", count);
      // What was asked for before comes to its end, later on a busy machine.
      for (let seconds = 0, before = -1; before < asked && seconds < 10; seconds += 1) {
        before = asked;
        await page.waitForTimeout(1000);
      }
      asked = 0;
      await page.waitForTimeout(1500);
      page.off("request", count);
      assert.equal(asked, 0, "pictures are exposed while nobody looks");
      await page.click("nav a[href='#head']");
    });

    for (const [name, title] of [["devices", "devices"], ["aim", "aim and focus"], ["exposure", "exposure"], ["timing", "delay and response"]]) {
      await step(`step ${title} passes, and survives a reload while it runs and afterwards`, () => run(name));
      if (name === "devices") await shot("setup", "phone-light", "#setup");
    }

    await step("a pose without a board is useless and says why, and can be forgotten", async () => {
      await page.click("#pose-take");
      await page.waitForSelector("#poses li .bad");
      assert.match(await page.textContent("#poses"), /cannot be used: .*\w/);
      await page.click("[aria-label='Forget pose 1']");
      await page.waitForFunction(() => document.querySelectorAll("#poses li").length === 0);
    });

    await step("the board is taken in ten poses, which survive a reload", async () => {
      let used = 0;
      for (let number = 1; number <= POSES; number += 1) {
        const before = used;
        used = await pose(number, used);
        assert.ok(number < POSES || used > before, "the board in z = 0 cannot be used");
        if (number !== POSES / 2) continue;
        await shot("poses", "phone-dark", "#pose-next");
        await shot("poses", "desktop-light", "#step-geometry");
        await page.reload();
        await page.waitForFunction((count) => document.querySelectorAll("#poses li").length === count, used);
        assert.equal(await page.inputValue("#board-rows"), "13");
        assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth), "the page is wider than the phone");
      }
      assert.ok(used >= USED, `${used} poses can be used`);
      assert.ok((await head()).geometry.frame_covered > 0.2);
      const [download] = await Promise.all([page.waitForEvent("download"), page.click("#board-print")]);
      assert.equal(download.suggestedFilename(), "board.pdf");
    });

    await step("the geometry is solved, and its result survives a reload", async () => {
      await page.click("#step-geometry > button:not(.end)");
      await ended("geometry");
      const { state: outcome, said, remedy } = await state("geometry");
      assert.equal(outcome, "done", `${said.join("; ")}: ${remedy}`);
      assert.ok(await page.locator("#step-geometry").getAttribute("open") !== null, "a step that is done folds away with what it found");
      await shot("solved", "phone-light", "#pose-coverage", "#step-geometry");
      await reload("geometry");
      await page.waitForSelector("#geometry-result:not([hidden])", { state: "attached" });
      assert.match(await page.textContent("#result-camera"), /^0\.\d{3} px$/);
      assert.match(await page.textContent("#result-height"), /^\d+\.\d µm$/);
    });

    await step("the reference plane completes the calibration", async () => {
      await put("#plate-place", "plate is in place");
      await run("plane");
      assert.ok((await head()).calibrated);
      await page.waitForSelector("#bare", { state: "hidden" });
    });

    await step("the good part is taught and passes, a dented one fails", async () => {
      await put("#part-place", "part is in place");
      await page.click("#step-teach > button:not(.end)");
      await page.waitForSelector("#teaching:not([hidden])");
      await page.reload();
      await is("teach", "done");
      await shot("head", "desktop-dark", "header");
      await trigger("PASS");
      await page.selectOption("#defect-kind", "dent");
      await page.click("#defect-add");
      await put("#part-put", "part is in place");
      await trigger("FAIL");
    });

    await step("after a restart the head is calibrated, and the steps are closed", async () => {
      await daemon.end();
      daemon = await Daemon.start(program, place, "bare");
      await page.goto(`${daemon.url}/#head`);
      await is("teach", "done");
      assert.equal(await page.locator("#steps details[open]").count(), 0);
      assert.ok(await page.isHidden("#bare"));
      for (const name of ["devices", "timing", "geometry", "plane"]) assert.equal((await state(name)).state, "done", name);
    });

    await step(`heights are right within ${HEIGHTS} mm RMS`, async () => {
      await daemon.end();
      const call = (...options) => promisify(execFile)(program, options, { maxBuffer: 1 << 26 });
      const recording = join(place.folder, "recording");
      place.put("bare-metal", BARE.replace("plane", "sheet_metal"));
      await call("record", recording, "--config", join(place.folder, "bare-metal.toml"), "--quiet");
      const { stdout } = await call("measure", recording, "--out", join(place.folder, "measured"), "--json");
      const { score } = JSON.parse(stdout);
      console.log(`  ${score.rms_mm.toFixed(4)} mm RMS over ${score.scored} px`);
      assert.ok(score.rms_mm <= HEIGHTS && score.scored > 50000, JSON.stringify(score));
    });
    assert.deepEqual(complaints, [], "the browser complains");
  } catch (error) {
    console.error(daemon.log);
    await page.screenshot({ path: `${place.folder}.png`, fullPage: true }).catch(() => {});
    console.error(`a picture of the page lies at ${place.folder}.png; the browser said: ${complaints.join("; ")}`);
    throw error;
  } finally {
    await context.close();
    await daemon.end("SIGKILL");
    place.remove();
  }
}
