// Who may do what, as an engineer, a technician and an operator see it: users, what a role may not do, the record of changes, backup and
// restore. Users are added, and an operator works, by keyboard alone.
import { strict as assert } from "node:assert";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { Daemon, Place } from "./daemon.js";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const SIZES = { desktop: { width: 1280, height: 900 }, phone: { width: 390, height: 844 } };
const USERS = { operator: ["operator", "482915"], technician: ["technician", "a word for a technician"], engineer2: ["engineer", "a word for an engineer"] };
// Presses of Tab that reach anything on a view.
const TABS = 300;

// Each screen and each colour scheme once.
const LOOKS = [["desktop", "light"], ["phone", "dark"]];

export async function access({ browser, program, step, folder }) {
  const place = new Place();
  const daemon = await Daemon.start(program, place);
  const complaints = [];

  async function open(size = "desktop") {
    const page = await (await browser.newContext({ viewport: SIZES[size], acceptDownloads: true })).newPage();
    page.setDefaultTimeout(60000);
    page.on("pageerror", (error) => complaints.push(error.message));
    page.on("console", (message) => { if (message.type() === "error" && !/Failed to load resource/.test(message.text())) complaints.push(message.text()); });
    await page.goto(daemon.url);
    return page;
  }
  const ready = (page) => page.waitForSelector("#state[data-state=ready]");

  // Presses Tab until an element has the focus.
  async function reach(page, selector) {
    for (let times = 0; times < TABS; times += 1) {
      if (await page.evaluate((wanted) => document.activeElement.matches(wanted), selector)) return;
      await page.keyboard.press("Tab");
    }
    assert.fail(`the keyboard does not reach ${selector}`);
  }
  async function press(page, selector) {
    await reach(page, selector);
    await page.keyboard.press("Enter");
  }
  // Types into fields that follow each other, and sends the form.
  async function type(page, ...texts) {
    for (const [at, text] of texts.entries()) {
      if (at) await page.keyboard.press("Tab");
      await page.keyboard.press("Control+A");
      await page.keyboard.type(text);
    }
    await page.keyboard.press("Enter");
  }
  async function signIn(page, user, secret) {
    await press(page, "#sign");
    await page.waitForSelector("#sign-in:not([hidden])");
    await type(page, user, secret);
    await page.waitForSelector("body.signed-in");
  }
  const as = async (name, size) => {
    const page = await open(size);
    await ready(page);
    await signIn(page, name, USERS[name][1]);
    assert.equal(await page.textContent("#sign"), `Sign out ${name}`);
    return page;
  };
  const view = async (page, name) => {
    await press(page, `nav a[href='#${name}']`);
    await page.waitForSelector(`#view-${name}:not([hidden])`);
  };
  const shown = (page, selector, words) => page.waitForFunction(([where, wanted]) => document.querySelector(where).textContent.includes(wanted), [selector, words]);
  // Says so if it is not disabled for a role, or does not show, tell and describe which role it needs.
  const barred = async (page, selector, role, all) => {
    const one = page.locator(selector);
    assert.ok(await one.isDisabled(), `${selector} is not disabled`);
    assert.equal(await one.getAttribute("title"), `needs ${all}`);
    assert.equal(await one.evaluate((element) => getComputedStyle(element, "::after").content), `"needs ${role}"`);
  };

  // Nothing is wrong with the view that is open, on both screens, light and dark.
  async function accessible(page, what) {
    await page.evaluate(AXE);
    for (const [name, colorScheme] of LOOKS) {
      await page.emulateMedia({ colorScheme });
      await page.setViewportSize(SIZES[name]);
      const { violations } = await page.evaluate(() => window.axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa", "best-practice"] }));
      assert.deepEqual(violations.map(({ id, nodes }) => [id, nodes[0].html]), [], `${what}, ${name}, ${colorScheme}`);
      assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth), `${what}, ${name}: wider than the screen`);
      if (folder) await page.screenshot({ path: join(folder, `access-${what}-${name}-${colorScheme}.png`), fullPage: true });
    }
    await page.setViewportSize(SIZES.desktop);
    await page.emulateMedia({ colorScheme: "light" });
  }

  try {
    await step("an engineer adds users by keyboard alone", async () => {
      const page = await open();
      await ready(page);
      await view(page, "device");
      assert.equal(await page.textContent("#users-locked"), "The list of users needs an engineer.");
      await signIn(page, "", daemon.secret);
      assert.equal(await page.textContent("#sign"), "Sign out");
      await page.waitForSelector("#user-rows tr");
      // What a name, a role or a password may be is said by the device.
      await reach(page, "#user-name");
      await type(page, "operator", "operator", "123");
      await page.waitForFunction(() => document.querySelector("#user-words").textContent.length > 10);
      assert.equal(await page.locator("#user-rows tr").count(), 1, "a password that is too short is taken");
      for (const [name, [role, secret]] of Object.entries(USERS)) {
        await reach(page, "#user-name");
        await type(page, name, role, secret);
        await shown(page, "#user-words", `${name} is ${role}`);
      }
      const rows = await page.locator("#user-rows tr").allTextContents();
      assert.equal(rows.length, 4);
      for (const [name, [role]] of Object.entries(USERS)) assert.ok(rows.some((row) => row.startsWith(`${name}${role}`)), rows.join());
      await accessible(page, "users");
      await page.context().close();
    });

    await step("a user signs in with the own name only, and a wrong password does not say whether the name is known", async () => {
      const page = await open();
      await ready(page);
      const said = [];
      for (const [name, secret] of [["operator", "000000"], ["nobody", "000000"]]) {
        await page.click("#sign");
        await page.fill("#user", name);
        await page.fill("#secret", secret);
        await page.keyboard.press("Enter");
        await page.waitForFunction(() => document.querySelector("#sign-words").textContent);
        said.push(await page.textContent("#sign-words"));
      }
      assert.equal(said[0], said[1]);
      await page.context().close();
    });

    await step("an operator triggers and loads by keyboard, and sees who may teach", async () => {
      const page = await as("operator");
      const number = () => page.evaluate(() => Number(document.querySelector("#sequence").textContent.replace(/\D/g, "")));
      const before = await number();
      await press(page, "#trigger");
      await page.waitForFunction((seq) => Number(document.querySelector("#sequence").textContent.replace(/\D/g, "")) > seq, before);
      await barred(page, "#part-put", "an engineer", "an engineer");
      await accessible(page, "operator");
      await view(page, "recipes");
      await press(page, "[aria-label='Load recipe 1']");
      await shown(page, "#notice", "recipe 1 is being loaded");
      await ready(page);
      await barred(page, "#teach button", "a technician", "a technician or an engineer");
      await barred(page, "#import button", "an engineer", "an engineer");
      await barred(page, "[aria-label='Delete recipe 1']", "an engineer", "an engineer");
      assert.equal(await page.getByRole("button", { name: /^Teach needs a technician$/, disabled: true }).count(), 1, "a screen reader is not told who may teach");
      // Looking at limits is free, and tries nothing.
      const tried = [];
      page.on("request", (request) => { if (request.url().endsWith("/try")) tried.push(request.url()); });
      await press(page, "[aria-label='Edit recipe 1']");
      await shown(page, "#editor-state", "needs a technician or an engineer");
      await barred(page, "#editor-form button[type=submit]", "a technician", "a technician or an engineer");
      assert.deepEqual(tried, []);
      await accessible(page, "operator-recipes");
      await press(page, "#editor-close");
      await view(page, "head");
      await shown(page, "#live-needs", "The live picture needs a technician or an engineer.");
      assert.ok(await page.locator("#live-open").isHidden());
      // A request that the device does not name would be open to everybody.
      const unknown = await page.evaluate(async () => {
        const { needs } = await (await fetch("api/session")).json();
        return Array.from(document.querySelectorAll("[data-needs]"), (one) => one.dataset.needs).filter((key) => !needs[key]);
      });
      assert.deepEqual(unknown, []);
      // What the page does not offer is refused by the device, in words.
      const refused = await page.evaluate(async () => {
        const answer = await fetch("api/recipes/2/teach", { method: "POST", body: "{}" });
        return { status: answer.status, ...(await answer.json()) };
      });
      assert.equal(refused.status, 403);
      assert.equal(refused.role, "technician");
      assert.match(refused.error, /operator is an operator, and this needs a technician or an engineer/);
      // A password of one's own is changed.
      await view(page, "device");
      assert.equal(await page.textContent("#own-words"), "Signed in as operator (operator).");
      await reach(page, "#own-old");
      await type(page, USERS.operator[1], "a word for an operator");
      await shown(page, "#own-words", "The password is changed.");
      USERS.operator[1] = "a word for an operator";
      await page.context().close();
      await (await as("operator")).context().close();
    });

    await step("a technician teaches and edits by keyboard, and each version says by whom", async () => {
      const page = await as("technician");
      await view(page, "recipes");
      await page.waitForFunction(() => document.querySelector("#teach-as").value === "2");
      await press(page, "#teach button");
      await page.waitForSelector("#teaching:not([hidden])");
      await shown(page, "#notice", "recipe 2 is taught and active");
      await ready(page);
      await press(page, "[aria-label='Edit recipe 2']");
      await page.waitForFunction(() => /^Tried on golden/.test(document.querySelector("#editor-state").textContent));
      await reach(page, "#editor-name");
      await page.keyboard.press("Control+A");
      await page.keyboard.type("by the technician");
      await press(page, "#editor-form button[type=submit]");
      await shown(page, "#notice", "recipe 2 is stored");
      await shown(page, "#recipe-rows", "by the technician");
      await ready(page);
      await page.waitForFunction(() => /by technician \(technician\)/.test(document.querySelector("#recipe-rows tr.active").textContent));
      await page.waitForFunction(() => /Undo: bring back .* by technician \(technician\)$/.test(document.querySelector("#recipe-rows tr.before button").textContent));
      await barred(page, "[aria-label='Copy recipe 2']", "an engineer", "an engineer");
      await accessible(page, "technician-recipes");
      await page.context().close();
    });

    await step("a role that was changed holds at once, and the page says so", async () => {
      const page = await as("technician"), boss = await as("engineer2", "phone");
      const give = (role) => boss.evaluate(async (wanted) => (await fetch("api/users/technician", { method: "PUT", body: JSON.stringify({ role: wanted }) })).status, role);
      await view(page, "recipes");
      await page.waitForSelector("#teach button:enabled");
      assert.equal(await give("viewer"), 200);
      await page.click("[aria-label='Load recipe 1']");
      // The session goes on with the new role, or has ended.
      await page.waitForFunction(() => document.querySelector("#teach button").disabled || !document.body.classList.contains("signed-in"));
      assert.equal(await give("technician"), 200);
      for (const one of [page, boss]) await one.context().close();
    });

    await step("an engineer filters the record of changes by user", async () => {
      const page = await as("engineer2");
      await view(page, "device");
      await shown(page, "#change-lines", "by technician (technician)");
      await reach(page, "#changes-user");
      await type(page, "operator");
      const lines = page.locator("#change-lines li");
      await page.waitForFunction(() => {
        const all = Array.from(document.querySelectorAll("#change-lines li"));
        return all.length > 0 && all.every((one) => one.textContent.includes("by operator (operator) from"));
      });
      // The list is read again every two seconds, but not while a filter is on.
      const count = await lines.count();
      await page.waitForResponse((response) => response.url().endsWith("/api/log"));
      assert.equal(await lines.count(), count);
      const [file] = await Promise.all([page.waitForEvent("download"), page.click("#changes-csv")]);
      const rows = readFileSync(await file.path(), "utf8").trim().split(/\r?\n/);
      assert.equal(rows.length, count + 1);
      await page.context().close();
    });

    await step("an engineer backs the device up, checks the file, orders and discards a restore", async () => {
      const page = await as("engineer2");
      await view(page, "device");
      await page.check("#backup-users");
      const [file] = await Promise.all([page.waitForEvent("download"), press(page, "#backup-form button")]);
      const bytes = readFileSync(await file.path());
      assert.equal(bytes.subarray(0, 2).toString("latin1"), "PK");
      // A file that is no backup is refused in words.
      await page.setInputFiles("#restore-file", { name: "other.zip", mimeType: "application/zip", buffer: Buffer.from("no backup") });
      await press(page, "#restore-form button");
      await page.waitForFunction(() => /\w/.test(document.querySelector("#restore-words").textContent) && !/being sent/.test(document.querySelector("#restore-words").textContent));
      assert.ok(await page.locator("#plan").isHidden());
      await page.setInputFiles("#restore-file", { name: "backup.zip", mimeType: "application/zip", buffer: bytes });
      await press(page, "#restore-form button");
      await page.waitForSelector("#plan:not([hidden])");
      await shown(page, "#plan-rows", "recipe 1");
      await shown(page, "#plan-rows", "results");
      await accessible(page, "restore");
      await page.check("#plan-users");
      await shown(page, "#plan-rows", "user operator");
      await page.check("#plan-choices input[value=recipes]");
      assert.ok(!/results|user /.test(await page.textContent("#plan-rows")), "what is not restored is listed");
      await press(page, "#restore-order");
      await shown(page, "#ordered", "At the next start the backup (recipes only) is put in place, by order of engineer2 (engineer).");
      assert.ok(await page.locator("#plan").isHidden());
      await accessible(page, "ordered");
      await press(page, "#restore-discard");
      await page.waitForFunction(() => document.querySelector("#ordered").textContent === "");
      await page.context().close();
    });

    await step("where looking needs a user, nothing is asked of the device before somebody signs in, and after signing out", async () => {
      const page = await (await browser.newContext({ viewport: SIZES.phone })).newPage();
      const asked = [];
      await page.route("**/api/session", async (route) => {
        const answer = await route.fetch();
        if (route.request().method() !== "GET") { await route.fulfill({ response: answer }); return; }
        await route.fulfill({ response: answer, json: { ...(await answer.json()), looking: "signed-in" } });
      });
      page.on("request", (request) => { if (/\/(api|events|metrics)/.test(request.url()) && !request.url().endsWith("/api/session")) asked.push(request.url()); });
      const locked = async () => {
        await page.waitForSelector("body.locked");
        const seen = await page.evaluate(() => Array.from(document.querySelectorAll("main > *, nav, footer, #state, #sign")).filter((one) => one.getClientRects().length).map((one) => one.id));
        assert.deepEqual(seen, ["sign-in"]);
        assert.match(await page.textContent("#sign-words"), /nothing before you sign in/);
        assert.equal(await page.title(), "fringed");
        asked.length = 0;
        await page.waitForTimeout(1500);
        assert.deepEqual(asked, []);
      };
      await page.goto(`${daemon.url}/#device`);
      await locked();
      await accessible(page, "locked");
      await page.fill("#user", "operator");
      await page.fill("#secret", USERS.operator[1]);
      await page.keyboard.press("Enter");
      await page.waitForSelector("body:not(.locked)");
      await ready(page);
      await shown(page, "#health", "Serial number");
      await page.click("#sign");
      await locked();
      await page.context().close();
    });

    await step("a user who is removed is signed out", async () => {
      const page = await as("operator"), boss = await as("engineer2");
      await view(boss, "device");
      await boss.waitForSelector("[aria-label='Remove operator']");
      await press(boss, "[aria-label='Remove operator']");
      await boss.waitForSelector("#question:not([hidden])");
      await press(boss, "#question-choices .strong");
      await shown(boss, "#user-words", "operator is removed");
      await page.click("#trigger");
      await page.waitForSelector("#sign-in:not([hidden])");
      assert.equal(await page.textContent("#sign"), "Sign in");
      for (const one of [page, boss]) await one.context().close();
    });

    assert.deepEqual(complaints, [], "the browser complains");
  } finally {
    await daemon.end("SIGKILL");
    place.remove();
  }
}
