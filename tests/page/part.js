// What is the part, as a person says it: a part on a floor with a clamp beside it, taught, corrected and taught again.
import { strict as assert } from "node:assert";
import { Daemon, Place } from "./daemon.js";

const AMONG = `sub_rays = 2
[rig.camera]
width = 256
height = 256
[part]
kind = "plate"
thickness_mm = 1.0
[floor]
depth_mm = 20.0
[[floor.clamps]]
low = [-100.0, -35.0, -5.0]
high = [-82.0, 5.0, 20.0]
`;
const [PLATE, CLAMP] = [[110, 115], [20, 146]];
const DESKTOP = { width: 1280, height: 900 };
const PHONE = { width: 390, height: 844 };

export async function part({ browser, program, step, folder }) {
  const place = new Place();
  place.put("among", AMONG);
  const daemon = await Daemon.start(program, place, "among");
  const open = async (options) => {
    const page = await (await browser.newContext(options)).newPage();
    page.setDefaultTimeout(60000);
    await page.goto(daemon.url);
    await page.click("#sign");
    await page.fill("#secret", daemon.secret);
    await page.click("#sign-in button[type=submit]");
    await page.waitForFunction(() => document.querySelector("#sign").textContent === "Sign out");
    await page.waitForSelector("#state[data-state=ready]");
    await page.click("nav a[href='#recipes']");
    return page;
  };
  const ended = async (page, number, words) => {
    await page.waitForFunction((wanted) => document.querySelector("#notice").textContent.includes(wanted), `recipe ${number} ${words}`);
    await page.waitForSelector("#part-seen:not([hidden])");
    await page.waitForSelector("#state[data-state=ready]");
  };
  const teach = async (page, number) => {
    await page.fill("#teach-as", String(number));
    await page.click("#teach button");
    await ended(page, number, "is taught and active");
  };
  const again = async (page, number) => {
    await page.click("#part-teach");
    await page.waitForSelector("#teaching:not([hidden])");
    await ended(page, number, "is taught and active");
    return page.evaluate(async (at) => (await (await fetch(`/api/recipes/${at}`)).json()).marking, number);
  };
  // Whether the pixel of the picture is in colour.
  const isPart = (page, [u, v]) => page.evaluate(([column, row]) => {
    const [red, green] = document.querySelector("#part-map").getContext("2d").getImageData(column, row, 1, 1).data;
    return green - red > 40;
  }, [u, v]);
  const on = async (page, [u, v]) => {
    await page.locator("#part-marks").scrollIntoViewIfNeeded();
    const box = await page.locator("#part-marks").boundingBox();
    return [box.x + (u + 0.5) / 256 * box.width, box.y + (v + 0.5) / 256 * box.height];
  };
  const marks = (page, kind) => page.locator(`#part-marks .${kind}`).count();
  const shown = async (page, at, wanted) => {
    for (const [place, is] of [[PLATE, wanted[0]], [CLAMP, wanted[1]]]) assert.equal(await isPart(page, place), is, `${at}: ${place}`);
  };

  try {
    await step("what a simulated part lies over is shown and changed", async () => {
      const page = await open({ viewport: DESKTOP });
      await page.click("nav a[href='#live']");
      await page.waitForSelector("#simulation:not([hidden])");
      const ticked = (id) => page.isChecked(`#floor${id}`);
      assert.deepEqual([await ticked(""), await ticked("-clamps"), await ticked("-pins"), await page.inputValue("#floor-depth")], [true, true, false, "20"]);
      const put = async () => {
        await page.click("#part-put");
        await page.waitForFunction(() => document.querySelector("#notice").textContent.includes("the part is in place"));
        return page.evaluate(async () => (await (await fetch("/api/simulation/part")).json()).floor);
      };
      const before = await page.evaluate(async () => (await (await fetch("/api/simulation/part")).json()).floor);
      await page.check("#floor-pins");
      await page.fill("#floor-depth", "12");
      const pinned = await put();
      assert.deepEqual([pinned.depth_mm, pinned.pins.length, pinned.clamps], [12, 1, before.clamps]);
      await page.uncheck("#floor");
      await page.waitForSelector("#floor-fields", { state: "hidden" });
      assert.equal(await put(), null);
      await page.evaluate(async (floor) => fetch("/api/simulation/part", { method: "PUT", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ part: { kind: "plate", thickness_mm: 1 }, floor }) }), before);
      await page.context().close();
    });

    await step("with a mouse a clamp that was left out becomes the part, and stays it when the recipe is taught anew", async () => {
      const page = await open({ viewport: DESKTOP });
      await teach(page, 2);
      await shown(page, "taught", [true, false]);
      await page.mouse.click(...await on(page, CLAMP));
      assert.equal(await marks(page, "is-part"), 1);
      if (folder) await page.locator("#part-seen").screenshot({ path: `${folder}/part.png` });
      const marking = await again(page, 2);
      assert.equal(marking.part.length, 1);
      await shown(page, "marked", [true, true]);
      // What was marked is still there, so that a second mark does not take the first one back.
      assert.equal(await marks(page, "is-part"), 1);
      assert.deepEqual(await again(page, 2), marking);
      await page.fill("#teach-as", "2");
      await page.click("#teach button");
      await page.click("#question-choices button:has-text('with new gauges')");
      await page.waitForSelector("#teaching:not([hidden])");
      await ended(page, 2, "is taught and active");
      await shown(page, "taught anew", [true, true]);
      await page.context().close();
    });

    await step("with a finger on a phone an outline says what is the part", async () => {
      const page = await open({ viewport: PHONE, hasTouch: true });
      await teach(page, 3);
      await page.tap("#part-outline");
      // The right half of the plate; the first corner again ends it.
      const corners = [[100, 40], [250, 40], [250, 220], [100, 220]];
      for (const corner of [...corners, corners[0]]) await page.touchscreen.tap(...await on(page, corner));
      assert.equal(await marks(page, "outline"), 1);
      assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth));
      const { outline } = await again(page, 3);
      assert.equal(outline.length, 4);
      assert.deepEqual([await isPart(page, PLATE), await isPart(page, [90, 115]), await isPart(page, CLAMP)], [true, false, false]);
      await page.context().close();
    });

    await step("by keyboard alone a piece is marked, taken back, and what is refused is shown with its place", async () => {
      const page = await open({ viewport: DESKTOP });
      await teach(page, 4);
      await page.focus("#part-marks");
      const go = async (from, to) => {
        for (const [axis, keys] of [[0, ["ArrowLeft", "ArrowRight"]], [1, ["ArrowUp", "ArrowDown"]]]) {
          const by = to[axis] - from[axis], key = keys[by > 0 ? 1 : 0];
          for (let at = 0; at < Math.floor(Math.abs(by) / 10); at += 1) await page.keyboard.press(`Shift+${key}`);
          for (let at = 0; at < Math.abs(by) % 10; at += 1) await page.keyboard.press(key);
        }
      };
      await go([128, 128], PLATE);
      await page.keyboard.press("Enter");
      assert.equal(await marks(page, "is-not"), 1);
      await page.keyboard.press("Enter");
      assert.equal(await marks(page, "is-not"), 0);
      await go(PLATE, CLAMP);
      await page.keyboard.press("Enter");
      assert.equal(await marks(page, "is-part"), 1);
      await page.focus("#part-teach");
      await page.keyboard.press("Enter");
      await page.waitForSelector("#teaching:not([hidden])");
      await ended(page, 4, "is taught and active");
      await shown(page, "by keys", [true, true]);
      await page.fill("#teach-as", "5");
      await page.click("#teach summary");
      await page.check("#teach-everything");
      await page.click("#teach button");
      await ended(page, 5, "was not taught");
      assert.equal(await marks(page, "refused"), 1);
      await page.context().close();
    });

    await step("a fixture as high as the part is left out once the empty station was recorded", async () => {
      const page = await open({ viewport: DESKTOP });
      const clamps = [{ low: [-100, -55, -12], high: [-76, 55, 8] }];
      const lay = (part) => page.evaluate(async (body) => (await fetch("/api/simulation/part", { method: "PUT", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) })).status, { part, floor: { depth_mm: 20, clamps } });
      assert.equal(await lay("plate"), 200);
      await teach(page, 6);
      const fixture = [35, 128];
      assert.deepEqual([await isPart(page, PLATE), await isPart(page, fixture)], [true, true]);
      await page.click("nav a[href='#head']");
      await page.click("#step-empty summary");
      await page.click("#empty-place");
      await page.waitForFunction(() => document.querySelector("#notice").textContent.includes("the part is taken away"));
      await page.click("#step-empty button:has-text('Record the empty station')");
      await page.waitForSelector("#step-empty[data-state=done]");
      assert.match(await page.textContent("#step-empty .said"), /of the frame shows something without a part/);
      assert.equal(await lay("plate"), 200);
      await page.click("nav a[href='#recipes']");
      await teach(page, 7);
      assert.deepEqual([await isPart(page, PLATE), await isPart(page, fixture)], [true, false]);
      await page.context().close();
    });
  } finally {
    await daemon.end("SIGTERM");
    place.remove();
  }
}
