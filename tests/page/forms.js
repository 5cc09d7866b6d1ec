// The page on a phone, a tablet and a desktop, light and dark: use with fingers, keyboard and screen reader.
import { strict as assert } from "node:assert";

const SIZES = [[360, 780], [390, 844], [820, 1180], [1280, 800]];
const VIEWS = ["live", "history", "recipes", "registers", "head", "device"];
// Side of the smallest target that a finger hits (WCAG 2.5.8), in pixels of the screen.
const FINGER = 24;
// The longest text for the station's state in the header.
const LONGEST = "offline: the PLC has not set ONLINE";

async function everywhere(browser, url, cookies, touch, check) {
  for (const [width, height] of SIZES) {
    for (const colorScheme of ["light", "dark"]) {
      const context = await browser.newContext({ viewport: { width, height }, colorScheme, hasTouch: touch });
      await context.addCookies(cookies);
      const page = await context.newPage();
      await page.goto(url);
      await page.waitForSelector("body.signed-in");
      await page.waitForSelector("#state[data-state=ready]");
      await check(page, `${width}×${height} ${colorScheme}`);
      await context.close();
    }
  }
}

// The header: one line for each of its two parts, also with the longest state in it.
async function header(page, where) {
  await page.evaluate((words) => { document.querySelector("#state-words").textContent = words; }, LONGEST);
  const found = await page.evaluate(() => {
    const box = (element) => element.getBoundingClientRect();
    const links = Array.from(document.querySelectorAll("nav a"));
    const lines = (element) => { const range = document.createRange(); range.selectNodeContents(element); return range.getClientRects().length; };
    const middle = (element) => (box(element).top + box(element).bottom) / 2;
    const sign = document.querySelector("#sign"), brand = document.querySelector(".brand");
    return { tops: links.map((link) => Math.round(box(link).top)), lines: links.concat(sign).map(lines), apart: Math.abs(middle(sign) - middle(brand)), over: document.documentElement.scrollWidth - window.innerWidth };
  });
  assert.equal(new Set(found.tops).size, 1, `the navigation breaks at ${where}: ${found.tops}`);
  assert.ok(found.lines.every((lines) => lines === 1), `words break in the header at ${where}: ${found.lines}`);
  assert.ok(found.apart < 2, `"Sign out" stands in another line than the name at ${where}`);
  assert.ok(found.over <= 0, `the page is ${found.over} px too wide at ${where}`);
}

// Every button and link with text has this text as its accessible name, and is large enough.
async function controls(page, where) {
  for (const view of VIEWS) {
    await page.click(`nav a[href='#${view}']`);
    if (view === "recipes") await page.waitForSelector("#recipe-rows button");
    const wrong = await page.evaluate((finger) => {
      const seen = Array.from(document.querySelectorAll("a, button, input, select")).filter((one) => one.getClientRects().length && !one.matches(".unseen, .skip"));
      return seen.flatMap((one) => {
        // A tap on its words ticks a box as well.
        const target = one.matches("[type=checkbox]") ? one.closest("label") || one : one;
        const box = target.getBoundingClientRect(), name = one.getAttribute("aria-label"), words = one.textContent.trim();
        const small = box.width < finger || box.height < finger ? [`${one.id || words} is ${box.width.toFixed(0)}×${box.height.toFixed(0)} px`] : [];
        const other = name && words && !name.toLowerCase().includes(words.toLowerCase()) ? [`"${words}" is called "${name}"`] : [];
        return small.concat(other);
      });
    }, FINGER);
    assert.deepEqual(wrong, [], `${view} at ${where}`);
    const cut = await page.evaluate(() => {
      const cells = Array.from(document.querySelectorAll("td, th")).filter((one) => one.getClientRects().length && !one.closest(".scroll"));
      return cells.filter((one) => one.scrollWidth > one.clientWidth + 1 || one.getBoundingClientRect().right > one.closest(".card").getBoundingClientRect().right).map((one) => one.textContent);
    });
    assert.deepEqual(cut, [], `words reach beyond their cell or card in ${view} at ${where}`);
    assert.equal(await page.locator("h1").count(), 1);
    assert.ok(await page.locator("h1").isVisible());
  }
}

// Corners of regions: a finger near a corner hits the corner, and the inside of the smallest region still hits the region.
async function handles(page, where) {
  await page.click("nav a[href='#recipes']");
  await page.click("#recipe-rows tr button:has-text('Edit')");
  await page.waitForSelector("#editor-regions .handle");
  const tap = async (at) => page.touchscreen.tap(at.x, at.y);
  // Scrolls to one of what fits, and says where it lies, in one step: all are drawn anew when what a trial found arrives.
  const place = (fits, index) => page.evaluate(([fits, index]) => {
    const one = Array.from(document.querySelectorAll(fits)).at(index);
    one.scrollIntoView({ block: "center", behavior: "instant" });
    const { x, y, width, height } = one.getBoundingClientRect();
    return { x, y, width, height };
  }, [fits, index]);
  for (const index of [0, 1]) {
    // The second region is a small one; the first, the whole frame, is chosen already.
    if (index) {
      const region = await place("#editor-regions .region", index);
      await tap({ x: region.x + region.width / 2, y: region.y + region.height / 2 });
      await page.waitForFunction((at) => document.querySelectorAll("#editor-regions .region")[at].classList.contains("chosen"), index);
    }
    const all = await page.locator("#editor-regions .handle").count();
    for (let corner = 0; corner < all; corner += 1) {
      // As above, in one step.
      const reached = await page.evaluate(([corner, finger]) => {
        const one = document.querySelectorAll("#editor-regions .handle")[corner];
        one.scrollIntoView({ block: "center", behavior: "instant" });
        const box = (one.querySelector(".target") || one).getBoundingClientRect();
        const middle = [(box.left + box.right) / 2, (box.top + box.bottom) / 2], by = finger / 2 - 0.5;
        const corners = [[-by, -by], [by, -by], [-by, by], [by, by]].map(([x, y]) => document.elementFromPoint(middle[0] + x, middle[1] + y));
        return corners.every((found) => found && found.closest(".handle") === one);
      }, [corner, FINGER]);
      assert.ok(reached, `corner ${corner + 1} of region ${index + 1} is smaller than ${FINGER} px at ${where}`);
    }
  }
  // The smaller region is selected; its centre must not hit a corner.
  const inside = await page.evaluate(() => {
    const one = document.querySelector("#editor-regions .region.chosen");
    one.scrollIntoView({ block: "center", behavior: "instant" });
    const box = one.getBoundingClientRect();
    const found = document.elementFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
    return found === one;
  });
  assert.ok(inside, `a small region cannot be dragged by its inside at ${where}`);
  const last = page.locator("#editor-regions .handle").last();
  const box = await place("#editor-regions .handle .target", -1);
  await tap({ x: box.x + 2, y: box.y + box.height / 2 });
  assert.equal(await page.locator("#editor-regions .handle.chosen").getAttribute("aria-label"), await last.getAttribute("aria-label"));
  await page.click("#editor-close");
}

// The log is longer than its box: its end can be reached with the keyboard alone.
async function log(page, where) {
  await page.click("nav a[href='#device']");
  const place = page.locator(".log").first();
  await page.waitForFunction(() => { const one = document.querySelector(".log"); return one.scrollHeight > one.clientHeight + 100; });
  assert.ok(await place.getAttribute("aria-labelledby"), "the log has no name");
  let reached = false;
  await page.focus("#sign");
  for (let times = 0; times < 12 && !reached; times += 1) {
    await page.keyboard.press("Tab");
    reached = await place.evaluate((one) => one === document.activeElement);
  }
  assert.ok(reached, `the keyboard does not reach the log at ${where}`);
  assert.notEqual(await place.evaluate((one) => getComputedStyle(one).outlineStyle), "none", "its focus cannot be seen");
  await page.keyboard.press("End");
  await page.waitForFunction(() => { const one = document.querySelector(".log"); return one.scrollTop > 0 && one.scrollTop + one.clientHeight > one.scrollHeight - 2; });
  // The log is reloaded every two seconds, and must keep its scroll position.
  if (!where.endsWith("dark")) return;
  await page.waitForResponse((response) => response.url().endsWith("/api/log"));
  await page.waitForTimeout(200);
  assert.ok(await place.evaluate((one) => one.scrollTop > 0), "the log jumps back to its beginning");
}

export async function forms({ browser, page, url, step }) {
  const cookies = await page.context().cookies();
  await step("the header has one line for the navigation and one for the rest on every screen", () => everywhere(browser, url, cookies, false, header));
  await step("every control is called what it shows and is large enough for a finger", () => everywhere(browser, url, cookies, true, controls));
  await step("the corners of a region are large enough for a finger on every screen", () => everywhere(browser, url, cookies, true, handles));
  await step("the log scrolls by keyboard", async () => {
    // Lines that a technician can cause.
    await page.evaluate(async () => {
      const snapshot = async () => (await fetch("/api/snapshot")).json();
      const load = async (number) => { await fetch(`/api/recipes/${number}/load`, { method: "POST" }); await new Promise((later) => setTimeout(later, 20)); };
      const { recipe } = await snapshot();
      for (let times = 0; times < 40; times += 1) await load(9999);
      // A load that fails takes READY away until one succeeds.
      while (!(await snapshot()).ready) await load(recipe.number);
    });
    await page.waitForSelector("#state[data-state=ready]");
    await everywhere(browser, url, cookies, false, log);
  });
  await step("password managers find a user name", async () => {
    const context = await browser.newContext();
    const fresh = await context.newPage();
    await fresh.goto(url);
    await fresh.click("#sign");
    const fields = await fresh.locator("#sign-in input").evaluateAll((all) => all.map((one) => [one.autocomplete, one.type, one.getClientRects().length > 0]));
    assert.deepEqual(fields, [["username", "text", true], ["current-password", "password", true]]);
    await context.close();
  });
}
