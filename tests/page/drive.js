// Drives the page in a real headless Chromium, as a technician would: node drive.js PROGRAM CHROMIUM [PICTURES]
//
// With a third argument it also takes screenshots for the documentation, into that folder. With the word "full" a study has 90 trials.
import { strict as assert } from "node:assert";
import { chromium } from "playwright-core";
import { access } from "./access.js";
import { Daemon, Place } from "./daemon.js";
import { editor } from "./editor.js";
import { forms } from "./forms.js";
import { part } from "./part.js";
import { pictures } from "./pictures.js";
import { recipes } from "./recipes.js";
import { statistics } from "./statistics.js";
import { studies } from "./studies.js";
import { view } from "./view.js";
import { wizard } from "./wizard.js";

const [program, browserPath, folder] = process.argv.slice(2).filter((word) => word !== "full");
// Longest wait for anything that must happen.
const PATIENCE = 30000;
// Largest layout shift of the page by Chromium's measure; up to 0.1 is rated good.
const JUMPS = 0.02;
// Two missing events of one second, the delay of the network, and one check by the page.
const STALE_WITHIN = 4000;

const place = new Place();
const browser = await chromium.launch({ executablePath: browserPath, args: ["--no-sandbox"] });
let daemon = await Daemon.start(program, place);
const page = await (await browser.newContext({ viewport: { width: 1280, height: 800 } })).newPage();
page.setDefaultTimeout(PATIENCE);
// Lets a test stop the heartbeat of the measuring task, and sums up the layout shifts of the page.
await page.addInitScript(() => {
  const parse = JSON.parse;
  JSON.parse = (text) => {
    const value = parse(text);
    if (window.heldStill && value && value.heartbeat !== undefined) {
      value.heartbeat = 7;
      window.standsStill = true;
    }
    return value;
  };
  window.jumped = 0;
  new PerformanceObserver((list) => list.getEntries().forEach((entry) => { window.jumped += entry.value; })).observe({ type: "layout-shift" });
});
const complaints = [];
page.on("pageerror", (error) => complaints.push(error.message));
page.on("console", (message) => {
  // What the network says while the daemon is away, and refusals that are tested, are no faults of the page; what is not
  // there is reported below.
  if (message.type() === "error" && !/Failed to load resource|ERR_/.test(message.text())) complaints.push(message.text());
});

page.on("response", (response) => { if (response.status() === 404) complaints.push(`${response.request().method()} ${response.url()} is not there`); });

async function step(name, run) {
  const began = Date.now();
  await run();
  console.log(`${name}: ${Date.now() - began} ms`);
}

const verdict = (word) => page.waitForFunction((wanted) => document.querySelector("#verdict").dataset.verdict === wanted && !document.body.classList.contains("stale"), word);
const number = async () => Number((await page.textContent("#sequence")).replace(/\D/g, ""));

async function trigger() {
  const before = await number();
  await page.waitForSelector("#trigger:enabled");
  await page.click("#trigger");
  await page.waitForFunction((seq) => Number(document.querySelector("#sequence").textContent.replace(/\D/g, "")) > seq, before);
}

async function signIn(secret) {
  await page.fill("#secret", secret);
  await page.click("#sign-in button[type=submit]");
}

try {
  await step("the page shows the station", async () => {
    await page.goto(daemon.url);
    await page.waitForSelector("#state[data-state=ready]");
    assert.equal(await page.textContent("#word"), "NO RESULT");
  });

  await step("a change asks for the secret, a wrong one is refused, the right one is accepted", async () => {
    await page.click("#trigger");
    await page.waitForSelector("#sign-in:not([hidden])");
    await signIn("AAAAA-AAAAA-AAAAA-AAAAA");
    await page.waitForFunction(() => document.querySelector("#sign-words").textContent.includes("not the secret"));
    assert.equal(await page.textContent("#word"), "NO RESULT");
    await signIn(daemon.secret);
    await verdict("PASS");
    assert.equal(await page.textContent("#sign"), "Sign out");
    const cookies = await page.context().cookies();
    assert.ok(cookies[0].httpOnly && cookies[0].sameSite === "Strict", JSON.stringify(cookies));
  });

  await step("pictures, gauges, times and trends are there", async () => {
    await trigger();
    await verdict("PASS");
    for (const layer of ["deviation", "modulation", "height"]) {
      await page.click(`[data-layer=${layer}]`);
      await page.waitForFunction(() => document.querySelector("#no-picture").hidden);
      // The picture of the layer before is there until this one comes.
      const unit = layer === "modulation" ? "counts" : "mm";
      const due = Date.now() + PATIENCE;
      for (let words = ""; !words.includes(unit) && !words.includes("nothing measured");) {
        await page.mouse.move(1, 1);
        await page.hover("#map");
        words = await page.textContent("#cursor");
        assert.ok(Date.now() < due, `${layer}: ${words}`);
      }
    }
    assert.ok(await page.locator("#gauge-rows tr").count() >= 2);
    assert.ok(await page.locator("#gauge-rows .trend path.line").count() >= 2);
    assert.match(await page.textContent("#total"), /\d+ m?s/);
    const stages = await page.locator("#stages li").allTextContents();
    assert.deepEqual(stages.map((stage) => stage.replace(/[\d.]+ [mµ]?s$/, "")), ["waiting", "exposure", "alignment", "phase, height, gauges", "judgement", "hand-over"]);
    for (const id of ["#processing", "#processor-time"]) assert.match(await page.textContent(id), /\d+ m?s/);
  });

  await step("a dent in the simulated part fails, without it the moved part passes", async () => {
    const put = async () => {
      await page.click("#part-put");
      await page.waitForFunction(() => document.querySelector("#notice").textContent.includes("part is in place") && !document.querySelector("#part-put").disabled);
      await page.evaluate(() => { document.querySelector("#notice").textContent = ""; });
    };
    assert.equal(await page.locator("#part-material option").count(), 5);
    await page.selectOption("#part-material", "matte");
    await page.selectOption("#defect-kind", "dent");
    await page.click("#defect-add");
    assert.equal(await page.locator("#part-defects input").count(), 4);
    await put();
    await trigger();
    await verdict("FAIL");
    await page.click("#part-defects button");
    await page.fill("#place-0", "0.3");
    await put();
    await trigger();
    await verdict("PASS");
    assert.equal(await page.inputValue("#part-material"), "matte");
    await page.fill("#place-0", "0");
    await put();
  });

  await step("nothing jumps when results come", async () => {
    await page.evaluate(() => { window.jumped = 0; });
    for (let cycle = 0; cycle < 3; cycle += 1) {
      const before = await number();
      await page.evaluate(() => fetch("/api/trigger", { method: "POST" }));
      await page.waitForFunction((seq) => Number(document.querySelector("#sequence").textContent.replace(/\D/g, "")) > seq, before);
      await page.waitForSelector("#state[data-state=ready]");
    }
    const jumped = await page.evaluate(() => window.jumped);
    assert.ok(jumped < JUMPS, `the page jumped by ${jumped}`);
  });

  await view({ browserPath, page, url: daemon.url, step, folder });

  await step("a limit that is edited on the page changes the verdict", async () => {
    await page.click("nav a[href='#recipes']");
    await page.click("#recipe-rows tr button:has-text('Edit')");
    await page.waitForSelector("#editor-regions .handle");
    await page.click("#editor-gauges .row:has-text('deviation')");
    const limits = page.locator("#editor-gauges input[aria-label^='lowest deviation']");
    // A text that is not a number is refused at its field, naming the gauge.
    await limits.first().fill("");
    await limits.first().pressSequentially("1e999");
    await page.click("#editor-form button[type=submit]");
    assert.match(await limits.first().evaluate((field) => field.validationMessage), /^lowest deviation.* in mm: write a number from -214748\.3647 to 214748\.3647$/);
    assert.ok(await page.isVisible("#editor"));
    await limits.first().fill("0.2");
    // A lower limit above the upper one: no part would pass. The page says so, and nothing is stored.
    await page.click("#editor-form button[type=submit]");
    await page.waitForFunction(() => /deviation.*passes no part/.test(document.querySelector("#editor-problems").textContent) && document.querySelector("#editor-words").textContent !== "");
    await page.locator("#editor-gauges input[aria-label^='highest deviation']").first().fill("0.3");
    await page.click("#editor-form button[type=submit]");
    await page.waitForFunction(() => document.querySelector("#notice").textContent.includes("stored"));
    await page.click("nav a[href='#live']");
    await page.waitForSelector("#state[data-state=ready]");
    await trigger();
    await verdict("FAIL");
    assert.match(await page.textContent("#sentence"), /deviation .* mm too low/);
    // The region of the gauge that failed, and the worst place in it.
    await page.waitForSelector("#outlines polygon.fail", { state: "attached" });
    await page.waitForSelector("#outlines circle.most", { state: "attached" });
  });

  await step("a region is dragged on the picture", async () => {
    await page.click("nav a[href='#recipes']");
    await page.click("#recipe-rows tr button:has-text('Edit')");
    await page.waitForSelector("#editor-regions .handle");
    const offer = (kind) => page.locator("#gauge-kinds button", { hasText: new RegExp(`^${kind}$`) }).click();
    const unit = (symbol) => page.waitForSelector(`#editor-gauges .opened label:has-text("up to + (${symbol})")`);
    await page.uncheck("#choose-0");
    await offer("placement");
    await unit("°");
    await page.locator("#editor-gauges select[aria-label^=component]").selectOption("z");
    await unit("mm");
    await page.check("#choose-0");
    await offer("deviation");
    const handle = page.locator("#editor-regions .handle").first();
    const box = await handle.boundingBox();
    const label = await handle.getAttribute("aria-label");
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + 40, box.y + 30, { steps: 4 });
    await page.mouse.up();
    const moved = await page.locator("#editor-regions .handle").first().getAttribute("aria-label");
    assert.notEqual(moved, label);
    await page.locator("#editor-regions .handle").first().focus();
    await page.keyboard.press("ArrowLeft");
    assert.notEqual(await page.locator("#editor-regions .handle").first().getAttribute("aria-label"), moved);
    await page.click("#editor-form button[type=submit]");
    await page.waitForFunction(() => document.querySelector("#editor").hidden);
    await page.waitForSelector("#state[data-state=ready]");
    await page.click("nav a[href='#live']");
    await trigger();
    await page.waitForFunction(() => document.querySelector("#gauge-rows").textContent.includes("frame deviation"));
    assert.match(await page.textContent("#gauge-rows"), /placement 1/);
  });

  await recipes({ page, step, verdict, trigger });

  await step("teaching shows its progress and what it gained", async () => {
    await page.click("nav a[href='#recipes']");
    await page.fill("#teach-as", "7");
    await page.click("#teach button");
    await page.waitForSelector("#teaching:not([hidden])");
    await page.waitForFunction(() => document.querySelector("#teach-bar").value > 0.2);
    await page.waitForSelector("#comparison:not([hidden])");
    const rows = await page.locator("#comparison-rows tr").allTextContents();
    assert.equal(rows.length, 2);
    assert.match(rows.join(), /µm.*%/);
    assert.match(await page.textContent("#comparison-limits"), /^Good parts deviate by up to 0\.0\d\d ± 0\.0\d\d mm; the limit was set to ±0\.15 mm\. Deviations are means over 3 × 3 pixels.* a dent of \d+\.\d mm across is seen at nine tenths of its depth/);
    await page.waitForFunction(() => /recipe 7 · .* is active/.test(document.querySelector("#other-words").textContent));
    await page.click("nav a[href='#live']");
    await trigger();
    await verdict("PASS");
    assert.match(await page.textContent("#recipe-name"), /^recipe 7 · /);
  });

  const load = async (number) => {
    await page.click("nav a[href='#recipes']");
    await page.click(`[aria-label='Load recipe ${number}']`);
    await page.waitForFunction((wanted) => document.querySelector("#recipe-rows tr.active td").textContent === wanted, String(number));
    await page.click("nav a[href='#live']");
  };

  await step("a verdict of another recipe than the active one names its own and is covered", async () => {
    const measured = await page.textContent("#recipe");
    await load(1);
    await page.waitForSelector("body.other");
    assert.equal(await page.textContent("#recipe"), measured, "the recipe beside the verdict is the one that measured it");
    assert.match(await page.textContent("#other-words"), /^PASS no\. \d+ is of recipe 7 · .*; recipe 1 · .* is active$/);
    assert.equal(await page.evaluate(() => getComputedStyle(document.querySelector("#other")).opacity), "1");
    assert.doesNotMatch(await page.title(), /PASS/);
    if (folder) await page.screenshot({ path: `${folder}/other-desktop-light.png` });
    await page.setViewportSize({ width: 390, height: 844 });
    for (const name of ["recipes", "live"]) {
      await page.click(`nav a[href='#${name}']`);
      await page.waitForSelector(`body[data-view=${name}]`);
      if (folder) await page.screenshot({ path: `${folder}/other-phone-${name}.png` });
      const cut = await page.evaluate(() => {
        const whole = document.querySelector("#verdict").getBoundingClientRect();
        const parts = [...document.querySelectorAll("#other > *")].map((part) => part.getBoundingClientRect());
        return parts.filter((part) => part.top < whole.top || part.bottom > whole.bottom || part.left < whole.left || part.right > whole.right).length;
      });
      assert.equal(cut, 0, `the cover is cut off on a phone in ${name}`);
    }
    await page.setViewportSize({ width: 1280, height: 800 });
    await trigger();
    await page.waitForSelector("body:not(.other)");
    assert.match(await page.textContent("#recipe-name"), /^recipe 1 · /);
    await load(7);
    await page.waitForSelector("body.other");
    await trigger();
    await verdict("PASS");
    await page.waitForSelector("body:not(.other)");
  });

  await step("a trigger that would measure with another recipe than the PLC's is refused in words", async () => {
    await page.waitForSelector("#trigger:enabled");
    await daemon.writeRegister(2, 77);
    await page.waitForSelector("#trigger:disabled");
    assert.equal(await page.textContent("#state-words"), "another recipe is asked for");
    assert.equal(await page.textContent("#word"), "last: PASS", "no verdict looks live while no part would be measured");
    assert.match(await page.textContent("#refusal"), /the PLC selects recipe 77, recipe 7 is active: load recipe 77/);
    const [status, words] = await page.evaluate(async () => {
      const answer = await fetch("/api/trigger", { method: "POST" });
      return [answer.status, (await answer.json()).error];
    });
    assert.equal(status, 409);
    assert.match(words, /selects recipe 77/);
    if (folder) {
      await page.screenshot({ path: `${folder}/refused-desktop-light.png` });
      await page.setViewportSize({ width: 390, height: 844 });
      await page.screenshot({ path: `${folder}/refused-phone-light.png`, fullPage: true });
      await page.setViewportSize({ width: 1280, height: 800 });
    }
    await daemon.writeRegister(2, 0);
    await page.waitForSelector("#trigger:enabled");
    assert.ok(await page.locator("#refusal").isHidden());
  });

  await step("without frames there is no picture, and no complaint either", async () => {
    await page.click("nav a[href='#registers']");
    const before = await number();
    await page.evaluate(() => fetch("/api/trigger", { method: "POST" }));
    await page.waitForFunction((seq) => Number(document.querySelector("#sequence").textContent.replace(/\D/g, "")) > seq, before);
    await page.waitForSelector("#state[data-state=ready]");
    await page.evaluate(() => fetch("/api/recipes/1/load", { method: "POST" }));
    await page.waitForFunction(() => /recipe 1 .* is active/.test(document.querySelector("#other-words").textContent));
    await page.waitForSelector("#state[data-state=ready]");
    await page.click("nav a[href='#live']");
    await page.waitForFunction(() => document.querySelector("#no-picture").textContent.includes("gone"));
  });

  await step("registers, history, log and changes are shown", async () => {
    await page.click("nav a[href='#registers']");
    await page.waitForFunction(() => document.querySelector("#register-rows").textContent.includes("RESULT_SEQ"));
    await page.click("nav a[href='#device']");
    await page.waitForFunction(() => document.querySelector("#change-lines").textContent.includes("teach recipe"));
    assert.ok((await page.textContent("#log-lines")).includes("taught recipe 7"));
    await page.click("nav a[href='#history']");
    await page.waitForFunction(() => /\d+ FAIL/.test(document.querySelector("#history-counts").textContent));
    await page.selectOption("#filter-verdict", "FAIL");
    await page.click("#filter button");
    await page.waitForFunction(() => {
      const tags = Array.from(document.querySelectorAll("#history-rows .tag"));
      return tags.length > 0 && tags.every((tag) => tag.textContent === "FAIL");
    });
    await page.click("nav a[href='#live']");
  });

  await step("a stored result opens with its values and pictures, or says why it has none", async () => {
    await page.click("nav a[href='#history']");
    const kept = page.locator("#history-rows tr", { has: page.locator("a[download]") }).first();
    await kept.locator("button.open").click();
    await page.waitForSelector("#kept:not([hidden])");
    for (const layer of ["deviation", "modulation", "height"]) {
      await page.click(`[data-kept=${layer}]`);
      await page.waitForFunction(() => document.querySelector("#kept-words").hidden);
      assert.ok(await page.evaluate(() => document.querySelector("#kept-map").width) > 100, layer);
    }
    assert.equal(await page.textContent("#kept-verdict"), "FAIL");
    assert.ok(await page.locator("#kept-gauges tr").count() >= 2);
    assert.match(await page.textContent("#kept-gauges"), /± .* mm.*✗ low/);
    assert.match(await page.textContent("#kept-facts"), /the head is simulated/);
    await page.click("#kept-close");
    await page.waitForSelector("#kept", { state: "hidden" });
    await page.selectOption("#filter-verdict", "PASS");
    await page.click("#filter button");
    await page.waitForFunction(() => Array.from(document.querySelectorAll("#history-rows .tag")).every((tag) => tag.textContent === "PASS"));
    await page.locator("#history-rows button.open").first().click();
    await page.waitForFunction(() => document.querySelector("#no-frames").textContent.includes("not kept"));
    assert.ok(await page.locator("#kept-pictures").isHidden());
    await page.click("#kept-close");
    await page.selectOption("#filter-verdict", "");
    await page.click("nav a[href='#live']");
  });

  await step("results are dated, by the browser that signed in where the clock is not synchronised, and dates filter them", async () => {
    const unsynced = await page.evaluate(async () => (await (await fetch("/api/snapshot")).json()).warnings.includes("clock not synchronised"));
    await page.click("nav a[href='#history']");
    const day = (more) => page.evaluate((more) => {
      const at = new Date(Date.now() + 86400000 * more);
      return `${at.getFullYear()}-${String(at.getMonth() + 1).padStart(2, "0")}-${String(at.getDate()).padStart(2, "0")}`;
    }, more);
    await page.fill("#filter-from", await day(-1));
    await page.fill("#filter-to", await day(0));
    await page.click("#filter button");
    await page.waitForFunction(() => document.querySelector("#history-csv").href.includes("until_us"));
    await page.waitForFunction(() => document.querySelectorAll("#history-rows tr").length > 5);
    const when = page.locator("#history-rows td:nth-child(2)").first();
    assert.match(await when.textContent(), unsynced ? /^≈ \d{4}-/ : /^\d{4}-/);
    assert.match(await when.getAttribute("title") || "", unsynced ? /browser of a signed-in user/ : /^$/);
    const lines = await page.evaluate(async () => (await (await fetch(document.querySelector("#history-csv").href)).text()).trim().split("\r\n"));
    assert.ok(lines[0].includes("time_source") && lines[1].includes(unsynced ? ",browser," : ",clock,"), lines[1]);
    await page.fill("#filter-from", await day(1));
    await page.fill("#filter-to", "");
    await page.click("#filter button");
    await page.waitForFunction(() => document.querySelector("#history-counts").textContent.startsWith("no result"));
    await page.fill("#filter-from", "");
    await page.click("#filter button");
    await page.waitForFunction(() => document.querySelectorAll("#history-rows tr").length > 5);
    await page.click("nav a[href='#live']");
  });

  await forms({ browser, page, url: daemon.url, step });

  await step("files can be taken along", async () => {
    for (const [selector, name] of [["a[href='api/last/cloud.ply']", /\.ply$/], ["a[href='api/last/gauges.csv']", /\.csv$/]]) {
      const [download] = await Promise.all([page.waitForEvent("download"), page.click(selector)]);
      assert.match(download.suggestedFilename(), name);
    }
  });

  await step("a daemon that hangs makes the verdict STALE, and fresh again when it goes on", async () => {
    await verdict("PASS");
    daemon.signal("SIGSTOP");
    await page.waitForSelector("body.stale", { timeout: STALE_WITHIN });
    const opacity = await page.evaluate(() => getComputedStyle(document.querySelector("#stale")).opacity);
    assert.equal(opacity, "1");
    assert.match(await page.title(), /STALE/);
    daemon.signal("SIGCONT");
    await page.waitForSelector("body:not(.stale)");
    await verdict("PASS");
  });

  await step("a measuring task whose heartbeat stands still makes the verdict STALE", async () => {
    await page.evaluate(() => { window.heldStill = true; });
    // It stands still from the next event on, which comes within a second.
    await page.waitForFunction(() => window.standsStill);
    await page.waitForSelector("body.stale", { timeout: STALE_WITHIN });
    assert.match(await page.textContent("#stale-words"), /heartbeat stands still/);
    await page.evaluate(() => { window.heldStill = false; });
    await page.waitForSelector("body:not(.stale)");
  });

  await step("the cover comes by itself when the scripts hang", async () => {
    // The page's scripts are stopped; only the browser's animation still runs.
    await page.evaluate(() => { for (let id = 0; id < 10000; id += 1) clearInterval(id); });
    daemon.signal("SIGSTOP");
    await page.waitForFunction(() => getComputedStyle(document.querySelector("#stale")).opacity === "1", null, { timeout: STALE_WITHIN });
    assert.equal(await page.evaluate(() => document.body.classList.contains("stale")), false);
    daemon.signal("SIGCONT");
    await page.reload();
    await page.waitForSelector("#state[data-state=ready]");
    await verdict("PASS");
  });

  await step("a daemon that is gone makes the verdict STALE, and the page finds the next one", async () => {
    const address = new URL(daemon.url).host;
    await daemon.end("SIGKILL");
    await page.waitForSelector("body.stale", { timeout: STALE_WITHIN });
    daemon = await Daemon.start(program, place, "dented", address);
    assert.equal(daemon.secret, undefined, "the secret is shown once");
    await page.waitForSelector("body:not(.stale)");
    await page.waitForSelector("#state[data-state=ready]");
    assert.equal(await page.textContent("#word"), "NO RESULT", "results of before the restart are no verdict");
  });

  assert.deepEqual(complaints, [], "the browser complains");
  await editor({ browser, program, step, folder });
  await part({ browser, program, step, folder });
  await statistics({ browser, program, step, folder });
  await studies({ browser, program, step, folder, full: process.argv.includes("full") });
  await access({ browser, program, step, folder });
  await wizard({ browser, program, step, folder });
  if (folder) await step("pictures", () => pictures(browser, program, folder));
  console.log("the page does what it promises");
} catch (error) {
  console.error(daemon.log);
  await page.screenshot({ path: `${place.folder}.png` }).catch(() => {});
  console.error(`a picture of the page lies at ${place.folder}.png; the browser said: ${complaints.join("; ")}`);
  throw error;
} finally {
  await browser.close();
  await daemon.end("SIGKILL");
  place.remove();
}
