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

const ALL = ["phone-light", "phone-dark", "desktop-light", "desktop-dark"];

async function shoot(browser, url, folder, name, forms = ALL, view = "live", prepare = async () => {}, after = () => {}) {
  for (const form of forms) {
    const [size, colour] = form.split("-");
    const context = await browser.newContext({ viewport: SIZES[size], colorScheme: colour, deviceScaleFactor: 1 });
    const page = await context.newPage();
    await page.goto(`${url}/#${view}`);
    await page.waitForSelector("#state:not([data-state=wait])");
    await page.waitForTimeout(900);
    if (!await prepare(page)) await page.evaluate(() => { if (document.querySelector("#editor").hidden) window.scrollTo(0, 0); });
    await page.screenshot({ path: join(folder, `${name}-${form}.png`) });
    after();
    await context.close();
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
    // Keeps its scroll position.
    const times = async (page) => {
      await page.evaluate(() => document.querySelector("#times").scrollIntoView({ block: "center" }));
      return true;
    };
    await shoot(browser, daemon.url, folder, "times", ["desktop-dark", "phone-light"], "live", times);
    const edit = async (page) => {
      await page.click("#recipe-rows tr button:has-text('Before')");
      await page.click("#recipe-rows tr button:has-text('Edit')");
      await page.waitForSelector("#editor-regions .handle");
    };
    await shoot(browser, daemon.url, folder, "edit", ["desktop-light", "phone-dark"], "recipes", edit);
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
    await shoot(browser, daemon.url, folder, "fail", ALL, "live", deviation);
    await shoot(browser, daemon.url, folder, "history", ["desktop-dark"], "history");
    await shoot(browser, daemon.url, folder, "registers", ["phone-light"], "registers");
    await shoot(browser, daemon.url, folder, "device", ["desktop-light"], "device");
    const stale = async (page) => {
      daemon.signal("SIGSTOP");
      await page.waitForSelector("body.stale");
      await page.waitForTimeout(1200);
    };
    await shoot(browser, daemon.url, folder, "stale", ["desktop-light", "phone-dark"], "live", stale, () => daemon.signal("SIGCONT"));
    await context.close();
  } finally {
    await daemon.end("SIGKILL");
    place.remove();
  }
}
