// The recipe's editor on a plate with holes and a slot: with a mouse, with fingers and by keyboard, and that nothing is lost.
import { strict as assert } from "node:assert";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { Daemon, Place } from "./daemon.js";

const DESKTOP = { width: 1440, height: 900 }, PHONE = { width: 390, height: 844 };
// The most actions for features, datum system and gauges of a drawing, each a click, a touch or a typed value.
const ACTIONS = 60;
// Values of golden against the truth of the simulator, mm.
const TRUE_MM = 0.05;
// The slowest picture of a drag with as many gauges and features as a recipe can have, ms.
const FRAME_MS = 1000 / 30;
const PATIENCE = 60000;

const WIDTH = 150, HEIGHT = 110, Z = 8;
const HOLES = [[-60, 40, 3], [55, 41, 5], [-60, -40, 6], [24, 2, 11]];
export const PLATE = `sub_rays = 2
[rig.camera]
width = 512
height = 512
[part]
kind = "plate"
holes = [${HOLES.map(([x, y, radius]) => `{ x = ${x.toFixed(1)}, y = ${y.toFixed(1)}, radius = ${radius.toFixed(1)} }`)}]
slots = [{ from = [-32.0, 30.0], to = [2.0, 30.0], half_width = 4.0 }]
[part.floor]
albedo = 0.0
`;

// The camera pixel of a point of the plate's upper side.
function seen({ camera: { fx, fy, cx, cy, rotation: r, translation_mm: t } }, x, y) {
  const [a, b, c] = [0, 1, 2].map((row) => r[3 * row] * x + r[3 * row + 1] * y + r[3 * row + 2] * Z + t[row]);
  return [cx + fx * a / c, cy + fy * b / c];
}

// How somebody uses the page; each counts what they do.
class Mouse {
  constructor(page) { this.page = page; this.actions = 0; }
  async click(selector) { this.actions += 1; await this.page.locator(selector).first().click(); }
  async fill(selector, value) { this.actions += 1; await this.page.fill(selector, value); }
  async choose(selector, value) { this.actions += 1; await this.page.selectOption(selector, value); }
  async place([u, v]) {
    await this.page.locator("#editor-plate").scrollIntoViewIfNeeded();
    return this.page.evaluate(([u, v]) => {
      const svg = document.querySelector("#editor-regions"), box = svg.getBoundingClientRect(), [, , width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
      return [box.left + (u + 0.5) / width * box.width, box.top + (v + 0.5) / height * box.height];
    }, [u, v]);
  }
  async at(pixel) { this.actions += 1; await this.page.mouse.click(...await this.place(pixel)); }
}

class Finger extends Mouse {
  async click(selector) { this.actions += 1; await this.page.locator(selector).first().tap(); }
  async at(pixel) { this.actions += 1; await this.page.touchscreen.tap(...await this.place(pixel)); }
}

// Only the keyboard: Tab to what is meant, arrow keys to a place of the picture.
class Keys extends Mouse {
  async reach(selector) {
    const wanted = await this.page.locator(selector).first().elementHandle();
    const ahead = await wanted.evaluate((one) => Boolean(document.activeElement.compareDocumentPosition(one) & Node.DOCUMENT_POSITION_FOLLOWING));
    for (let times = 0; times < 200; times += 1) {
      if (await wanted.evaluate((one) => one === document.activeElement)) break;
      assert.ok(times < 199, `Tab does not reach ${selector}`);
      await this.page.keyboard.press(ahead ? "Tab" : "Shift+Tab");
    }
    const shown = await wanted.evaluate((one) => {
      const style = getComputedStyle(one), box = one.getBoundingClientRect();
      return one.matches(":focus-visible") && (style.outlineStyle !== "none" || style.strokeWidth === "5px") && box.bottom > 0 && box.top < window.innerHeight;
    });
    assert.ok(shown, `the focus on ${selector} cannot be seen`);
  }
  async click(selector) { this.actions += 1; await this.reach(selector); await this.page.keyboard.press(selector.includes("for a new gauge") ? "Space" : "Enter"); }
  async fill(selector, value) { this.actions += 1; await this.reach(selector); await this.page.keyboard.press("Control+A"); await this.page.keyboard.type(value); }
  async choose(selector, value) {
    this.actions += 1;
    await this.reach(selector);
    for (let times = 0; times < 40 && await this.page.inputValue(selector) !== value; times += 1) await this.page.keyboard.press(times < 20 ? "ArrowDown" : "ArrowUp");
    assert.equal(await this.page.inputValue(selector), value);
  }
  async at([u, v]) {
    this.actions += 1;
    assert.equal(await this.page.evaluate(() => document.activeElement.id), "editor-regions", "a tool takes the focus to the picture");
    const now = await this.page.evaluate(async () => (await import("/editor-picture.js")).tool().at);
    for (const [axis, goal] of [[0, u], [1, v]]) {
      const by = Math.round(goal - now[axis]), key = axis ? (by < 0 ? "ArrowUp" : "ArrowDown") : (by < 0 ? "ArrowLeft" : "ArrowRight");
      for (let tens = 0; tens < Math.floor(Math.abs(by) / 10); tens += 1) await this.page.keyboard.press(`Shift+${key}`);
      for (let ones = 0; ones < Math.abs(by) % 10; ones += 1) await this.page.keyboard.press(key);
    }
    await this.page.keyboard.press("Enter");
  }
}

// What a drawing asks of the plate: two holes, the sheet's plane, an edge, a datum system, and gauges of them.
async function build(hand, pixel) {
  const draw = async (kind, ...points) => { await hand.click(`[data-tool=${kind}]`); for (const point of points) await hand.at(pixel(...point)); };
  const [one, , other] = HOLES;
  await draw("plane", [-WIDTH / 2 + 3, -HEIGHT / 2 + 3], [WIDTH / 2 - 4, HEIGHT / 2 - 4]);
  for (const [x, y, radius] of [one, other]) await draw("circle", [x, y], [x + radius, y]);
  await draw("line", [-WIDTH / 2, 20], [-WIDTH / 2, -20]);
  await hand.click("#datum-add");
  for (const [letter, name] of [["B", "circle 1"], ["C", "circle 2"]]) await hand.choose(`#datum-${letter}`, name);
  await hand.click("#datum-use");
  const offer = (kind) => hand.click(`#gauge-kinds button >> text=/^${kind}$/`), pick = (name) => hand.click(`[aria-label='${name} for a new gauge']`);
  await pick("line 1");
  await pick("circle 1");
  await offer("diameter");
  await hand.fill("[aria-label^='up to + circle 1 diameter']", "0.05");
  await hand.fill("[aria-label^='down to − circle 1 diameter']", "0.05");
  await pick("circle 2");
  await offer("distance");
  await pick("circle 1");
  await offer("position");
  await hand.fill("[aria-label^='nominal 1 of circle 2 position']", String(Math.hypot(one[0] - other[0], one[1] - other[1])));
  await draw("surface", [-40, -30], [10, -10]);
  await offer("flatness");
}

// Runs in the page: 50 edits chosen at random, then 50 steps back. Answers with the list before, at the end, and in between.
async function scramble(seed) {
  const { snapshot, state } = await import("/editor-list.js");
  let word = seed * 2654435761 >>> 0;
  const random = (most) => { word ^= word << 13; word >>>= 0; word ^= word >>> 17; word ^= word << 5; word >>>= 0; return word % most; };
  const any = (selector) => { const all = Array.from(document.querySelectorAll(selector)).filter((one) => !one.disabled); return all[random(Math.max(1, all.length))]; };
  const type = (input, value) => { if (input) { input.focus(); input.value = value; input.dispatchEvent(new Event("input", { bubbles: true })); input.dispatchEvent(new Event("change", { bubbles: true })); } };
  const press = (node, key) => { if (node) node.dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey: true, bubbles: true, cancelable: true })); };
  const click = (node) => { if (node) node.click(); };
  const edits = [
    () => { const box = any(".pick input"); if (box) { state.chosen.slice().forEach((at) => document.querySelector(`#choose-${at}`).click()); box.click(); } click(any("#gauge-kinds button")); },
    () => { click(any("#editor-features .row[aria-expanded=false]")); press(any("#editor-regions .chosen, #editor-regions .handle"), ["ArrowLeft", "ArrowUp", "ArrowDown"][random(3)]); },
    () => { click(any(".rows .row[aria-expanded=false]")); type(any(".form input:not([type=number])"), `name ${random(1000)}`); },
    () => { click(any("#editor-gauges .row[aria-expanded=false]")); type(any(".form input.limit"), String(random(100) / 50)); },
    () => { click(any("#editor-gauges .row[aria-expanded=false]")); const one = any(".form select"); if (one) { one.selectedIndex = random(one.options.length); one.dispatchEvent(new Event("change", { bubbles: true })); } },
    () => { click(any("#editor-features .row[aria-expanded=false]")); click(any(".form .line button:not(:last-child)")); },
    () => { click(any(".rows .row[aria-expanded=false]")); click(document.querySelector(".form .line button:last-child")); click(document.querySelector("#question:not([hidden]) button.strong")); },
    () => type(document.querySelector("#editor-name"), `part ${random(1000)}`),
    () => click(document.querySelector(random(2) ? "#editor-undo" : "#editor-redo")),
  ];
  while (!document.querySelector("#editor-undo").disabled) click(document.querySelector("#editor-undo"));
  const before = snapshot();
  for (let edit = 0; edit < 50; edit += 1) {
    edits[random(edits.length)]();
    // A question is answered, and acted on, before the next edit.
    await new Promise((next) => setTimeout(next));
  }
  const between = snapshot();
  for (let times = 0; times < 50; times += 1) click(document.querySelector("#editor-undo"));
  return [before, snapshot(), between];
}

export async function editor({ browser, program, step, folder, running = null }) {
  const place = running ? null : new Place();
  if (place) place.put("plate", PLATE);
  const daemon = running || await Daemon.start(program, place, "plate");
  const complaints = [];
  const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
  const contexts = [];

  async function open(options = {}) {
    const context = await browser.newContext(Object.assign({ viewport: DESKTOP }, options));
    contexts.push(context);
    if (contexts.length > 1) await context.addCookies(await contexts[0].cookies());
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE);
    page.on("pageerror", (error) => complaints.push(error.message));
    page.on("response", (response) => { if (response.status() === 404) complaints.push(`${response.url()} is not there`); });
    await page.goto(daemon.url);
    await page.waitForSelector("#state[data-state=ready]");
    if (contexts.length === 1) {
      await page.click("#sign");
      await page.fill("#secret", daemon.secret);
      await page.click("#sign-in button[type=submit]");
    }
    await page.waitForSelector("body.signed-in");
    return page;
  }
  async function edit(page) {
    await page.click("nav a[href='#recipes']");
    await page.click("#recipe-rows tr button:has-text('Edit')");
    await page.waitForSelector("#editor:not([hidden])");
    await tried(page);
  }
  const tried = (page) => page.waitForFunction(() => /^Tried on golden/.test(document.querySelector("#editor-state").textContent));
  const list = (page) => page.evaluate(async () => (await import("/editor-list.js")).snapshot());
  const found = (page) => page.evaluate(async () => (await import("/editor-list.js")).state.found);
  const recipe = (page) => page.evaluate(async () => (await fetch("/api/recipes/1")).json());
  const saved = (page) => page.waitForFunction(() => document.querySelector("#editor").hidden && document.querySelector("#notice").textContent.includes("stored"));
  async function leave(page) {
    await page.click("#editor-close");
    if (await page.isVisible("#question")) await page.click("#question-choices button.strong");
    await page.waitForSelector("#editor", { state: "hidden" });
  }

  const form = async (page, name) => {
    const row = page.locator("#editor-gauges .row", { hasText: name }).first();
    if (await row.getAttribute("aria-expanded") === "false") await row.click();
  };

  // What was built is found, true, and named.
  async function judged(page) {
    await tried(page);
    const { gauges, features, problems } = await found(page);
    assert.deepEqual(problems.filter(({ refused }) => refused), []);
    for (const name of ["plane 1", "circle 1", "circle 2", "line 1"]) assert.equal(features.find((one) => one.name === name).state, "found", name);
    assert.equal(features.find((one) => one.name === "circle 1").plane, "plane 1", "the plane of a contour is chosen by itself");
    const value = (name) => { const gauge = gauges.find((one) => one.name === name); assert.ok(gauge, `${name} in ${gauges.map((one) => one.name)}`); return gauge.value; };
    const [one, , other] = HOLES, apart = Math.hypot(one[0] - other[0], one[1] - other[1]);
    for (const [name, truth] of [["circle 1 diameter", 2 * one[2]], ["circle 1 to circle 2 distance", apart], ["circle 2 position", 0], ["surface 1 flatness", 0]]) {
      assert.ok(Math.abs(value(name) - truth) < TRUE_MM, `${name}: ${value(name)} instead of ${truth}`);
    }
    assert.equal(gauges.find((gauge) => gauge.name === "circle 2 position").value >= 0, true);
  }

  try {
    let page = await open();
    const { models } = await recipe(page);
    const pixel = (x, y) => seen(models, x, y);

    for (const [how, options, hand] of [["with a mouse", { viewport: DESKTOP }, Mouse], ["with a finger on a phone", { viewport: PHONE, hasTouch: true }, Finger], ["by keyboard alone", { viewport: DESKTOP }, Keys]]) {
      await step(`what a drawing asks for is drawn, named and judged ${how}`, async () => {
        const other = await open(options), user = new hand(other), { fingerprint } = await recipe(other);
        await edit(other);
        if (hand === Keys) await other.focus("#editor-close");
        await build(user, pixel);
        await judged(other);
        console.log(`  ${user.actions} actions`);
        assert.ok(user.actions <= ACTIONS, `${user.actions} actions`);
        if (folder && hand !== Keys) await other.screenshot({ path: `${folder}/edit-plate-${hand === Mouse ? "desktop" : "phone"}-light.png`, fullPage: true });
        if (hand === Mouse) { await user.click("#editor-form button[type=submit]"); await saved(other); await undone(other, fingerprint); } else await leave(other);
        await other.context().close();
      });
    }

    await step("features and gauges are renamed everywhere, and deleted with what hangs on them, which is said before", async () => {
      await edit(page);
      await build(new Mouse(page), pixel);
      await page.click("#editor-features .row:has-text('circle 2')");
      await page.fill("[aria-label='name of circle 2']", "hole C");
      const renamed = JSON.parse(await list(page));
      assert.deepEqual(renamed.datums.map(({ of }) => of), [["plane 1", "circle 1", "hole C"]]);
      const names = renamed.gauges.map(({ name }) => name);
      for (const name of ["circle 1 to hole C distance", "hole C position"]) assert.ok(names.includes(name), `${names}`);
      await page.click("#editor-features .row:has-text('plane 1')");
      await page.click("#editor-features .opened button:has-text('Delete')");
      const words = await page.textContent("#question-words");
      for (const part of ["datum system datum 1", "gauge hole C position", "circle 1, hole C, line 1 will have a plane fitted"]) assert.ok(words.includes(part), words);
      await page.click("#question-choices button:has-text('Delete')");
      const after = JSON.parse(await list(page));
      assert.deepEqual([after.datums, after.features.filter(({ plane }) => plane)], [[], []]);
      await page.click("#editor-undo");
      assert.deepEqual(JSON.parse(await list(page)), renamed);
    });

    await step("what is wrong is said in a sentence, and is not stored", async () => {
      const problems = async (words) => page.waitForFunction((wanted) => Array.from(document.querySelectorAll("#editor-problems li.bad")).some((one) => new RegExp(wanted).test(one.textContent)), words);
      const before = await recipe(page);
      await tried(page);
      await form(page, "circle 1 diameter");
      await page.selectOption("[aria-label='limits of circle 1 diameter']", "limits");
      await page.fill("[aria-label^='lowest circle 1 diameter']", "9");
      await problems("circle 1 diameter.*passes no part");
      await page.click("#editor-form button[type=submit]");
      await page.waitForFunction(() => /cannot be stored/.test(document.querySelector("#editor-words").textContent));
      for (let times = 0; times < 2; times += 1) await page.keyboard.press("Control+z");
      await page.fill("[aria-label='name of circle 1 diameter']", "deviation");
      await problems("deviation");
      await page.keyboard.press("Control+z");
      await form(page, "circle 1 diameter");
      await page.fill("[aria-label^='slot of circle 1 diameter']", "1");
      await problems("slot 1");
      await page.keyboard.press("Control+z");
      await page.waitForFunction(() => !document.querySelector("#editor-problems .bad"));
      assert.deepEqual(await recipe(page), before);
    });

    await step("a tolerance that is too fine for the head says so", async () => {
      await form(page, "circle 1 diameter");
      for (const side of ["up to +", "down to −"]) await page.fill(`[aria-label^='${side} circle 1 diameter']`, "0.001");
      await page.waitForFunction(() => /too fine for this head/.test(document.querySelector("#editor-gauges .opened").textContent));
      await page.keyboard.press("Control+z");
      await page.keyboard.press("Control+z");
    });

    await step("holes are measured by one click, and a table gives the nominal values", async () => {
      const before = await list(page), diameters = async () => JSON.parse(await list(page)).gauges.filter(({ kind }) => kind === "diameter");
      const had = (await diameters()).length;
      await page.click("#gauge-holes button");
      await tried(page);
      const all = await diameters();
      assert.ok(all.length > had && !await page.locator("#gauge-holes button").count(), `${had} and ${all.length}`);
      for (const { name, value } of (await found(page)).gauges.filter((one) => all.some(({ name }) => name === one.name))) assert.ok(value > 0, name);
      await page.click("summary:has-text('Take over nominal values')");
      const [first] = all, value = (await found(page)).gauges.find(({ name }) => name === first.name).value;
      await page.fill("#editor-table", `${first.name.toUpperCase()}\t${value.toFixed(2).replace(".", ",")}\t+0.3/-0.2\nno such gauge; 1; 2\n${all[1].name}; x; 1`);
      await page.click("#editor-take");
      const words = await page.textContent("#editor-taken");
      assert.match(words, /^Gauges with new limits: 1\..*no gauge is called no such gauge.*has no nominal value/);
      const { nominal, plus, minus, golden } = (await diameters()).find(({ name }) => name === first.name);
      assert.deepEqual([nominal, plus, minus, golden], [Number(value.toFixed(2)), 0.3, 0.2, undefined]);
      await tried(page);
      if (folder) await page.screenshot({ path: `${folder}/edit-many-desktop-light.png` });
      while (await list(page) !== before) await page.click("#editor-undo");
    });

    await step("the last parts are judged by the list before it is stored", async () => {
      await page.evaluate(() => fetch("/api/trigger", { method: "POST" }));
      await page.waitForFunction(() => /PASS|FAIL|INVALID/.test(document.querySelector("#word").textContent));
      await page.click("#editor-parts");
      await page.waitForSelector("#parts tbody tr .tag");
      assert.match(await page.textContent("#parts p"), /^\d of 1 parts would pass by this list/);
      assert.match(await page.textContent("#parts tbody"), /no\. \d+.*mm/);
    });

    await step("a section shows its profile, or why it is not found", async () => {
      await new Mouse(page).click("[data-tool=section]");
      for (const x of [-WIDTH / 2 + 20, -WIDTH / 2 - 8]) await page.mouse.click(...await new Mouse(page).place(pixel(x, 0)));
      await page.waitForSelector("#editor-features .opened .details p.bad, #editor-features .opened svg.profile");
      assert.deepEqual((await found(page)).features.map(({ name }) => name).slice(-1), ["section 1"]);
      await page.click("#editor-undo");
    });

    await step("fifty edits at random and fifty steps back give the list of before, byte by byte", async () => {
      for (let round = 0; round < 20; round += 1) {
        const [before, after, between] = await page.evaluate(scramble, round + 1);
        assert.notEqual(between, before, "nothing was edited");
        assert.equal(after, before, `round ${round}`);
      }
    });

    await step("a drag follows at 30 pictures a second with as many gauges and features as a recipe can have", async () => {
      const other = await open({ viewport: PHONE, hasTouch: true });
      await other.route("**/api/recipes/1", async (route) => {
        const whole = await (await route.fetch()).json(), [hole] = whole.features.filter(({ kind }) => kind === "circle");
        const moved = (at) => hole.region.map(([u, v]) => [200 + (u - hole.region[0][0]) / 2 + 22 * (at % 10), 60 + (v - hole.region[0][1]) / 2 + 40 * Math.floor(at / 10)]);
        while (whole.features.length < 96) whole.features.push(Object.assign({}, hole, { name: `more ${whole.features.length}`, region: moved(whole.features.length) }));
        while (whole.gauges.length < 64) whole.gauges.push({ slot: whole.gauges.length + 1, name: `more ${whole.gauges.length}`, kind: "found", of: [whole.features[whole.gauges.length].name], low: 0.4 });
        await route.fulfill({ json: whole });
      });
      await other.route("**/try", (route) => {
        const { features } = JSON.parse(route.request().postData());
        const around = ({ region }) => Array.from({ length: 96 }, (_, at) => { const [u, v] = region[at % region.length], [p, q] = region[(at + 1) % region.length], share = Math.floor(at / region.length) * region.length / 96; return [u + share * (p - u), v + share * (q - v)]; });
        const found = features.map((one) => { const outline = around(one); return { name: one.name, kind: one.kind, state: "found", size: [], found: 1, fit: { outline, closed: true, centre: outline[0] }, pieces: outline.map((at, place) => ({ at, accepted: place % 7 > 0, why: "dark" })) }; });
        return route.fulfill({ json: { ms: 1, features: found, gauges: [], problems: [], parts: [] } });
      });
      await edit(other);
      assert.equal(await other.locator("#editor-gauges > li").count() + await other.locator("#editor-features > li").count(), 64 + 96);
      await other.click("#row-features-80");
      await other.locator("#editor-plate").scrollIntoViewIfNeeded();
      const box = await other.locator("#editor-regions .region.chosen").boundingBox();
      const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
      await other.mouse.move(x, y);
      await other.mouse.down();
      await other.evaluate(() => { window.pictures = []; const note = (at) => { window.pictures.push(at); requestAnimationFrame(note); }; requestAnimationFrame(note); });
      for (let at = 0; at < 60; at += 1) await other.mouse.move(x + 40 * Math.sin(at / 9), y - at / 2);
      const [moved, times] = await other.evaluate(() => [document.querySelector("#editor-regions .region.chosen").getBoundingClientRect().y, window.pictures]);
      await other.mouse.up();
      assert.ok(Math.abs(moved - box.y) > 10, "nothing was dragged");
      // Most pictures are in time even if those in which something moves are late.
      const gaps = times.slice(1).map((at, place) => at - times[place]).sort((one, more) => one - more), slow = gaps[Math.floor(0.9 * gaps.length)];
      console.log(`  nine of ten pictures within ${slow.toFixed(1)} ms`);
      assert.ok(slow <= FRAME_MS, `${slow} ms`);
      await leave(other);
      await other.context().close();
    });

    await step("the editor is accessible, light and dark, on a phone and a desktop", async () => {
      for (const viewport of [DESKTOP, PHONE]) {
        for (const colorScheme of ["light", "dark"]) {
          const other = await open({ viewport, colorScheme }), where = `${viewport.width} ${colorScheme}`;
          await edit(other);
          for (const opened of ["features", "gauges"]) {
            await other.click(`#row-${opened}-1`);
            await accessible(other, `${opened} at ${where}`);
          }
          if (folder) await other.screenshot({ path: `${folder}/edit-form-${viewport === PHONE ? "phone" : "desktop"}-${colorScheme}.png`, fullPage: true });
          await other.click("#datum-add");
          await accessible(other, `the datum system at ${where}`);
          if (folder) await other.screenshot({ path: `${folder}/edit-datum-${viewport === PHONE ? "phone" : "desktop"}-${colorScheme}.png` });
          await other.keyboard.press("Escape");
          await leave(other);
          await other.context().close();
        }
      }
    });

    await step("unsaved changes are not lost unasked, and two people do not undo each other", async () => {
      if (await page.isHidden("#editor")) await edit(page);
      await page.click("#row-features-0");
      await page.click("#gauge-kinds button >> text=/^mean height$/");
      await page.click("#editor-close");
      await page.waitForSelector("#question:not([hidden])");
      await page.keyboard.press("Escape");
      assert.ok(await page.isVisible("#editor"));
      const closing = new Promise((resolve) => page.once("dialog", (dialog) => { resolve(dialog.type()); dialog.dismiss(); }));
      await page.close({ runBeforeUnload: true });
      assert.equal(await closing, "beforeunload");
      const theirs = await page.evaluate(async () => {
        const { fingerprint } = await (await fetch("/api/recipes/1")).json();
        return (await fetch("/api/recipes/1", { method: "PUT", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ fingerprint, name: "theirs" }) })).status;
      });
      assert.equal(theirs, 200);
      const mine = await list(page);
      await page.fill("#editor-name", "mine");
      await page.click("#editor-form button[type=submit]");
      await page.waitForSelector("#question:not([hidden])");
      assert.match(await page.textContent("#question-title"), /Somebody else/);
      await page.keyboard.press("Escape");
      assert.equal((await recipe(page)).name, "theirs");
      assert.equal((await list(page)).replace("\"mine\"", JSON.stringify(JSON.parse(mine).name)), mine);
      await page.click("#editor-form button[type=submit]");
      await page.click("#question-choices button.strong");
      await saved(page);
      assert.equal((await recipe(page)).name, "mine");
      // What was stored is edited as it was: limits that come from golden still do.
      await edit(page);
      const { gauges } = JSON.parse(await list(page)), own = gauges.filter(({ golden }) => golden);
      assert.ok(own.length && own.every(({ low, plus }) => low === undefined && plus > 0), JSON.stringify(own));
      assert.deepEqual((await found(page)).problems.filter(({ refused }) => refused), []);
      await leave(page);
    });

    assert.deepEqual(complaints, [], "the browser complains");
  } catch (error) {
    console.error(daemon.log || "");
    const shown = [].concat(...contexts.map((context) => context.pages())).pop(), path = `${place ? place.folder : "editor"}.png`;
    if (shown) await shown.screenshot({ path, fullPage: true }).catch(() => {});
    console.error(`a picture of the page lies at ${path}; the browser said: ${complaints.join("; ")}`);
    throw error;
  } finally {
    for (const context of contexts) await context.close();
    if (place) { await daemon.end("SIGKILL"); place.remove(); }
  }

  // No serious finding, nothing wider than the screen, and every target large enough for a finger.
  async function accessible(page, where) {
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => window.axe.run("main, #datum", { runOnly: ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa", "best-practice"] }));
    const bad = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
    assert.deepEqual(bad.map(({ id, nodes }) => [id, nodes.map(({ html }) => html.slice(0, 120))]), [], where);
    const small = await page.evaluate(() => Array.from(document.querySelectorAll("#editor a, #editor button, #editor input, #editor select, #datum button, #datum input, #datum select, #editor .target")).filter((one) => one.getClientRects().length).filter((one) => {
      const box = (one.type === "checkbox" ? one.closest("label") : one).getBoundingClientRect();
      return box.width < 24 || box.height < 24;
    }).map((one) => one.outerHTML.slice(0, 120)));
    assert.deepEqual(small, [], where);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth), `the page is too wide at ${where}`);
  }

  // Brings the recipe of before back, as soon as the station takes it.
  async function undone(page, fingerprint) {
    for (let times = 0; times < 200 && (await recipe(page)).fingerprint !== fingerprint; times += 1) {
      await page.evaluate(() => fetch("/api/recipes/1/undo", { method: "POST" }));
      await page.waitForTimeout(100);
    }
    await page.waitForFunction(async () => (await (await fetch("/api/snapshot")).json()).ready);
  }
}
