// The view in space: a picture's part as a surface, by mouse, fingers and keyboard, and what the page does without WebGL 2.
import { strict as assert } from "node:assert";
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { chromium } from "playwright-core";

// WebGL 2 without a graphics card.
const SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const SIZES = { desktop: { width: 1440, height: 900 }, phone: { width: 390, height: 844 } };
const TOGGLE = "#picture .choice + button";
const SPACE = "#picture .space";
const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const PATIENCE = 30000;
// A surface of so many rows and columns has nearly 100 000 triangles.
const SIDE = 224;
const ALL = 2 * (SIDE - 1) * (SIDE - 1);

// Waves as the sensor would send them; `change` may edit the word of z at a row and column.
function surface(change) {
  const words = new Uint16Array(3 * SIDE * SIDE);
  for (let at = 0; at < SIDE * SIDE; at += 1) {
    const u = at % SIDE, v = Math.floor(at / SIDE);
    words[at] = 100 * u;
    words[SIDE * SIDE + at] = 100 * (SIDE - v);
    words[2 * SIDE * SIDE + at] = change(Math.round(9000 + 500 * Math.sin(u / 9) * Math.sin(v / 7)), u, v);
  }
  return Buffer.from(words.buffer);
}

// A page that counts what it draws and which surfaces it asks for.
async function opened(browser, url, cookies, size = "desktop", colorScheme = "light") {
  const context = await browser.newContext({ viewport: SIZES[size], colorScheme, hasTouch: size === "phone", isMobile: size === "phone" });
  await context.addCookies(cookies);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  await page.addInitScript(() => {
    window.draws = 0;
    window.triangles = 0;
    const draw = WebGL2RenderingContext.prototype.drawElements;
    WebGL2RenderingContext.prototype.drawElements = function (mode, count, ...rest) {
      window.draws += 1;
      window.triangles = count / 3;
      return draw.call(this, mode, count, ...rest);
    };
  });
  const asked = [], complaints = [];
  page.on("request", (request) => { if (request.url().includes("/picture/surface")) asked.push(request.url()); });
  page.on("pageerror", (error) => complaints.push(error.message));
  await page.goto(url);
  await page.waitForFunction(() => document.querySelector("#no-picture").hidden);
  return { context, page, asked, complaints };
}

const drawn = (page) => page.waitForFunction(() => window.triangles > 0);
const counted = (page) => page.evaluate(() => window.draws);
// What is on the screen, when whatever was asked for is drawn.
async function pixels(page) {
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  return (await page.locator(SPACE).screenshot()).toString("base64");
}

// Sees to it that each of several acts changes what is on the screen.
async function watch(page) {
  let last = await pixels(page);
  return { first: last, changes: async (what, act) => {
    await act();
    const now = await pixels(page);
    assert.notEqual(now, last, `${what} changes nothing`);
    last = now;
  } };
}

async function reached(page, selector) {
  for (let times = 0; times < 20; times += 1) {
    await page.keyboard.press("Tab");
    if (await page.evaluate((wanted) => document.activeElement.matches(wanted), selector)) return;
  }
  assert.fail(`the keyboard does not reach ${selector}`);
}

async function byMouse({ page, asked }) {
  assert.deepEqual(asked, [], "a page that does not look at the view asks for it");
  await page.click(TOGGLE);
  await drawn(page);
  const box = await page.locator(SPACE).boundingBox();
  const middle = [box.x + box.width / 2, box.y + box.height / 2];
  const drag = async (dx, dy) => {
    await page.mouse.move(...middle);
    await page.mouse.down();
    await page.mouse.move(middle[0] + dx, middle[1] + dy, { steps: 4 });
    await page.mouse.up();
  };
  const press = (name) => page.getByRole("group", { name: "3-D view" }).getByRole("button", { name, exact: true }).click();
  const { first, changes } = await watch(page);
  await changes("dragging", () => drag(60, 20));
  await page.keyboard.down("Shift");
  await changes("dragging with Shift", () => drag(40, 0));
  await page.keyboard.up("Shift");
  await changes("the wheel", () => page.mouse.wheel(0, -100));
  for (const name of ["Left", "Right", "Up", "Down", "+", "\u2212"]) {
    await changes(name, () => press(name));
  }
  await press("Move");
  await changes("a button that moves", () => press("Left"));
  await press("Reset");
  assert.equal(await pixels(page), first, "Reset shows another view than the first");
  // Nothing changes, so nothing is drawn.
  const before = await counted(page);
  await page.waitForTimeout(400);
  assert.equal(await counted(page), before, "it draws while nothing changes");
}

async function byKeyboard({ page }) {
  await page.focus("[data-layer=modulation]");
  await page.keyboard.press("Tab");
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "3-D");
  await page.keyboard.press("Enter");
  await drawn(page);
  assert.equal(await page.getAttribute(TOGGLE, "aria-pressed"), "true");
  await reached(page, SPACE);
  assert.notEqual(await page.evaluate(() => getComputedStyle(document.activeElement).outlineStyle), "none", "its focus cannot be seen");
  const { first, changes } = await watch(page);
  for (const key of ["ArrowLeft", "ArrowUp", "Shift+ArrowRight", "+", "-"]) await changes(key, () => page.keyboard.press(key));
  await page.keyboard.press("0");
  assert.equal(await pixels(page), first, "0 shows another view than the first");
}

async function byFingers({ page }) {
  await page.tap(TOGGLE);
  await drawn(page);
  assert.ok(await page.evaluate(() => window.triangles) <= 110000);
  await page.locator(SPACE).scrollIntoViewIfNeeded();
  const box = await page.locator(SPACE).boundingBox();
  const middle = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
  const session = await page.context().newCDPSession(page);
  const touch = (type, points) => session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x: middle.x + x, y: middle.y + y, id })) });
  const drag = async (ends) => {
    await touch("touchStart", ends.map(([from]) => from));
    for (const share of [0.2, 0.4, 0.6, 0.8, 1]) await touch("touchMove", ends.map(([from, to]) => from.map((was, axis) => was + share * (to[axis] - was))));
    await touch("touchEnd", []);
  };
  const { changes } = await watch(page);
  const scrolled = await page.evaluate(() => window.scrollY);
  await changes("one finger", () => drag([[[0, 60], [30, -60]]]));
  await changes("two fingers", () => drag([[[-20, 0], [-60, 10]], [[20, 0], [60, 10]]]));
  assert.equal(await page.evaluate(() => window.scrollY), scrolled, "fingers on the view scroll the page");
}

// The triangles of surfaces that are known.
async function triangles({ page }) {
  let change = (word) => word;
  await page.route("**/picture/surface*", async (route) => {
    const seq = Number(new URL(route.request().url()).searchParams.get("seq"));
    if (!change) { await route.fulfill({ status: 500, json: { error: "no surface today" } }); return; }
    const planes = ["x", "y", "z"].map((name) => ({ name, unit: "mm", low: -10, step: 0.001 }));
    await route.fulfill({ headers: { "x-map": JSON.stringify({ width: SIDE, height: SIDE, stride: 1, seq, planes }) }, body: surface(change) });
  });
  const count = async () => {
    await page.click(TOGGLE);
    await page.waitForFunction(() => window.triangles > 0);
    const found = await page.evaluate(() => window.triangles);
    await page.click(TOGGLE);
    await page.evaluate(() => { window.triangles = 0; });
    return found;
  };
  assert.equal(await count(), ALL);
  // A missing point takes the six triangles about it, but for the two that the other diagonal saves.
  change = (word, u, v) => (u === 50 && v === 60 ? 65535 : word);
  assert.equal(await count(), ALL - 4);
  change = (word, u) => (u < 100 ? word : word + 2000);
  assert.equal(await count(), ALL - 2 * (SIDE - 1), "triangles across a jump");
  change = (word, u) => word + 100 * u;
  assert.equal(await count(), ALL, "a slope is no jump");
  change = null;
  await page.click(TOGGLE);
  await page.waitForFunction(() => document.querySelector("#picture").textContent.includes("no surface today"));
  await page.click(TOGGLE);
  change = (word) => word;
}

// Frames per second while it is turned.
async function speed({ page }) {
  await triangles({ page });
  await page.click(TOGGLE);
  await drawn(page);
  const rate = await page.evaluate(async () => {
    const place = document.querySelector("#picture .space"), frames = 40;
    const began = performance.now();
    for (let frame = 0; frame < frames; frame += 1) {
      place.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
      await new Promise((done) => requestAnimationFrame(done));
    }
    const gl = place.querySelector("canvas").getContext("webgl2");
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return 1000 * frames / (performance.now() - began);
  });
  console.log(`the view draws ${rate.toFixed(1)} frames/s of ${await page.evaluate(() => window.triangles)} triangles at 390 × 844`);
}

// A new result is followed; what is not looked at is not loaded, and gives its memory back.
async function follows({ page, asked }) {
  const measure = async () => {
    const before = await page.textContent("#sequence");
    await page.waitForSelector("#state[data-state=ready]");
    await page.evaluate(() => fetch("/api/trigger", { method: "POST" }));
    await page.waitForFunction((seq) => document.querySelector("#sequence").textContent !== seq, before);
    return Number((await page.textContent("#sequence")).replace(/\D/g, ""));
  };
  await page.click(TOGGLE);
  await drawn(page);
  const before = await counted(page);
  const seq = await measure();
  await page.waitForFunction((had) => window.draws > had, before);
  await page.waitForFunction((wanted) => performance.getEntriesByType("resource").some(({ name }) => name.includes(`/picture/surface?seq=${wanted}&`)), seq);
  await page.click("[data-layer=deviation]");
  await page.waitForFunction(() => document.querySelector("#shown").textContent.startsWith("deviation"));
  const loaded = asked.length;
  const { changes } = await watch(page);
  await changes("another layer", () => page.click("[data-layer=height]").then(() => page.waitForFunction(() => document.querySelector("#shown").textContent.startsWith("z "))));
  assert.equal(asked.length, loaded, "another layer has the same surface");
  const held = () => page.locator(`${SPACE} canvas`).count();
  assert.equal(await held(), 1);
  await page.click("nav a[href='#registers']");
  await page.waitForFunction((one) => !document.querySelector(`${one} canvas`), SPACE);
  await measure();
  assert.equal(asked.length, loaded, "a view that is not seen is loaded");
  await page.click("nav a[href='#live']");
  await page.waitForFunction((one) => document.querySelector(`${one} canvas`), SPACE);
  await page.click(TOGGLE);
  assert.equal(await held(), 0);
}

async function loses({ page }) {
  await page.click(TOGGLE);
  await drawn(page);
  const visible = () => page.evaluate(() => getComputedStyle(document.querySelector("#map")).visibility === "visible");
  assert.equal(await visible(), false);
  const before = await pixels(page);
  await page.evaluate((one) => {
    window.held = document.querySelector(`${one} canvas`).getContext("webgl2").getExtension("WEBGL_lose_context");
    window.held.loseContext();
  }, SPACE);
  await page.waitForFunction(() => document.querySelector("#picture").textContent.includes("3-D view is interrupted"));
  assert.ok(await visible(), "the picture comes back");
  await page.evaluate(() => window.held.restoreContext());
  await page.waitForSelector(SPACE);
  await page.waitForTimeout(500);
  assert.equal(await pixels(page), before, "the view comes back as it was");
}

async function kept({ page, asked }) {
  await page.click("nav a[href='#history']");
  await page.locator("#history-rows tr", { has: page.locator("a[download]") }).first().locator("button.open").click();
  await page.waitForFunction(() => document.querySelector("#kept-words").hidden);
  assert.deepEqual(asked, []);
  await page.click("#kept-pictures .choice + button");
  await drawn(page);
  assert.match(asked[0], /\/api\/history\/\d+\/picture\/surface\?seq=\d+&level=\d$/);
  await page.click("#kept-close");
  await page.waitForFunction(() => !document.querySelector("#kept .space canvas"));
}

// Without WebGL 2 the picture stays, with a sentence.
async function without(browser, url, cookies, folder) {
  for (const size of Object.keys(SIZES)) {
    const context = await browser.newContext({ viewport: SIZES[size] });
    await context.addCookies(cookies);
    const page = await context.newPage();
    await page.addInitScript(() => {
      const get = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind === "webgl2" ? null : get.call(this, kind, ...rest); };
    });
    await page.goto(url);
    await page.waitForFunction(() => document.querySelector("#no-picture").hidden);
    await page.click(TOGGLE);
    await page.waitForFunction(() => document.querySelector("#picture").textContent.includes("no WebGL 2"));
    assert.ok(await page.isVisible("#map"));
    assert.equal(await page.getAttribute(TOGGLE, "aria-pressed"), "false");
    assert.ok(await page.isHidden(SPACE));
    if (folder) await page.locator("#picture").screenshot({ path: join(folder, `no-space-${size}-light.png`) });
    await context.close();
  }
}

async function serious({ page }, where) {
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => window.axe.run("#picture"));
  const found = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
  assert.deepEqual(found.map(({ id, nodes }) => [id, nodes.map(({ html }) => html)]), [], where);
}

export async function view({ browserPath, page, url, step, folder }) {
  const cookies = await page.context().cookies();
  const software = await chromium.launch({ executablePath: browserPath, args: SOFTWARE });
  const within = async (run, ...how) => {
    const place = await opened(software, url, cookies, ...how);
    try { await run(place); } finally { await place.context.close(); }
    assert.deepEqual(place.complaints, []);
  };
  try {
    await step("the part turns, moves and grows in space by mouse and buttons, and is not drawn while nothing changes", () => within(byMouse));
    await step("the same by keyboard alone", () => within(byKeyboard));
    await step("the same by fingers", () => within(byFingers, "phone"));
    await step("the view in space follows the results, and costs nothing while it is not seen", () => within(follows));
    await step("a kept part is shown in space", () => within(kept));
    await step("a context that is lost shows the picture, and the view again when it comes back", () => within(loses));
    await step("no triangle lies over missing points or across jumps", () => within(speed, "phone"));
    await step("without WebGL 2 there is the picture, with a sentence", () => without(software, url, cookies, folder));
    for (const size of Object.keys(SIZES)) {
      for (const colour of ["light", "dark"]) {
        await step(`the view in space is accessible on a ${size}, ${colour}`, () => within(async (place) => {
          await place.page.click(TOGGLE);
          await drawn(place.page);
          await serious(place, `${size} ${colour}`);
          if (folder) {
            await place.page.locator("#picture").scrollIntoViewIfNeeded();
            await place.page.screenshot({ path: join(folder, `space-${size}-${colour}.png`) });
          }
        }, size, colour));
      }
    }
  } finally {
    await software.close();
  }
}
