// Pictures of the page for the documentation: phone and desktop, light and dark, a good and a dented part.
import { join } from "node:path";
import { Daemon, Place } from "./daemon.js";

const SIZES = { phone: { width: 390, height: 844 }, desktop: { width: 1280, height: 800 } };
const CYCLES = 30;

async function signIn(page, secret) {
  await page.click("#sign");
  await page.fill("#secret", secret);
  await page.click("#sign-in button[type=submit]");
  await page.waitForSelector("body.signed-in");
}

async function trigger(page, times) {
  for (let done = 0; done < times; done += 1) {
    await page.waitForSelector("#trigger:enabled");
    const before = await page.textContent("#sequence");
    await page.click("#trigger");
    await page.waitForFunction((seq) => document.querySelector("#sequence").textContent !== seq, before);
  }
  await page.waitForSelector("#state[data-state=ready]");
  await page.waitForFunction(() => document.querySelector("#no-picture").hidden);
}

async function shoot(browser, url, folder, name, view = "live", prepare = async () => {}) {
  for (const size of Object.keys(SIZES)) {
    for (const colour of ["light", "dark"]) {
      const context = await browser.newContext({ viewport: SIZES[size], colorScheme: colour, deviceScaleFactor: 1 });
      const page = await context.newPage();
      await page.goto(`${url}/#${view}`);
      await page.waitForSelector("#state:not([data-state=wait])");
      await page.waitForTimeout(900);
      await prepare(page);
      await page.screenshot({ path: join(folder, `page-${name}-${size}-${colour}.png`) });
      await context.close();
    }
  }
}

export async function pictures(browser, program, folder) {
  const place = new Place(512);
  let daemon = await Daemon.start(program, place);
  try {
    const secret = daemon.secret;
    const context = await browser.newContext();
    let page = await context.newPage();
    await page.goto(daemon.url);
    await signIn(page, secret);
    await trigger(page, CYCLES);
    await shoot(browser, daemon.url, folder, "pass");
    for (const view of ["recipes", "registers", "device", "history"]) await shoot(browser, daemon.url, folder, view, view);
    const edit = async (page) => {
      await page.click("#recipe-rows tr button:has-text('Before')");
      await page.click("#recipe-rows tr button:has-text('Edit')");
      await page.waitForSelector("#editor-regions .handle");
    };
    await shoot(browser, daemon.url, folder, "edit", "recipes", edit);
    await daemon.end();
    daemon = await Daemon.start(program, place, "dented");
    page = await context.newPage();
    await page.goto(daemon.url);
    await signIn(page, secret);
    await trigger(page, 1);
    const deviation = async (page) => {
      await page.click("[data-layer=deviation]");
      await page.waitForTimeout(500);
    };
    await shoot(browser, daemon.url, folder, "fail", "live", deviation);
    const stale = async (page) => {
      daemon.signal("SIGSTOP");
      await page.waitForSelector("body.stale");
      await page.waitForTimeout(1200);
      daemon.signal("SIGCONT");
    };
    await shoot(browser, daemon.url, folder, "stale", "live", stale);
    await context.close();
  } finally {
    await daemon.end("SIGKILL");
    place.remove();
  }
}
