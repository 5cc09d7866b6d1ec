// Recipes on the page: no recipe is lost by teaching, deleting or undoing.
import { strict as assert } from "node:assert";

export async function recipes({ page, step, verdict, trigger }) {
  const rows = page.locator("#recipe-rows tr:not(.before)");
  const notice = (words) => page.waitForFunction((wanted) => !document.querySelector("#notice").hidden && document.querySelector("#notice").textContent.includes(wanted), words);
  // The station is ready with this recipe; the banner still names the one that measured the last part. Asked from here, because
  // waitForFunction takes the promise of an async function for an answer.
  const active = async (wanted) => {
    const until = Date.now() + 30000;
    for (;;) {
      const { recipe, state } = await page.evaluate(async () => (await fetch("/api/snapshot")).json());
      if (state === "ready" && Object.keys(wanted).every((key) => recipe[key] === wanted[key])) return;
      assert.ok(Date.now() < until, `${JSON.stringify(wanted)} is not active: ${state}, ${JSON.stringify(recipe)}`);
      await page.waitForTimeout(20);
    }
  };
  const ready = () => page.waitForSelector("#state[data-state=ready]");
  const recipe = (number) => page.evaluate(async (at) => (await fetch(`/api/recipes/${at}`)).json(), number);
  const open = async () => { await page.click("nav a[href='#recipes']"); await rows.first().waitFor(); };
  const taught = async () => { await page.waitForSelector("#teaching:not([hidden])"); await notice("is taught and active"); await ready(); };

  await step("a number that is free is proposed to teach, and one that is taken asks before it is replaced", async () => {
    await open();
    await page.waitForFunction(() => document.querySelector("#teach-as").value === "2");
    const before = await recipe(1);
    await page.fill("#teach-as", "1");
    await page.click("#teach button");
    await page.waitForSelector("#question:not([hidden])");
    assert.match(await page.textContent("#question-title"), /Replace recipe 1\?/);
    const words = await page.textContent("#question-words");
    for (const part of [before.name, `${before.features.length} features`, `${before.gauges.length} gauges`]) assert.ok(words.includes(part), words);
    // The focus stays in the dialogue, and Escape changes nothing.
    for (let times = 0; times < 7; times += 1) {
      assert.ok(await page.evaluate(() => document.querySelector("#question").contains(document.activeElement)));
      await page.keyboard.press("Tab");
    }
    await page.keyboard.press("Escape");
    await page.waitForSelector("#question", { state: "hidden" });
    assert.equal((await recipe(1)).fingerprint, before.fingerprint);
    await page.waitForFunction(() => document.activeElement && document.activeElement.textContent === "Teach");
  });

  await step("what was edited stays when a recipe is taught again, if that is asked for", async () => {
    const before = await recipe(1);
    await page.click("#teach button");
    await page.click("#question-choices button:has-text('keep features and gauges')");
    await taught();
    const after = await recipe(1);
    assert.notEqual(after.fingerprint, before.fingerprint);
    for (const key of ["name", "part_number", "features", "gauges"]) assert.deepEqual(after[key], before[key], key);
  });

  await step("undo brings back the version before, and undo again takes it back", async () => {
    await open();
    const versions = [await recipe(1)];
    for (const turn of [0, 1]) {
      const undo = page.locator("#recipe-rows tr.before button").first();
      assert.match(await undo.textContent(), /^Undo: bring back the version .*\([0-9a-f]{8}, \d+ gauges\)( by .+)?$/);
      const wanted = /\(([0-9a-f]{8}),/.exec(await undo.textContent())[1];
      await undo.click();
      await notice(`RECIPE_CRC32 is 0x${wanted.toUpperCase()}`);
      await active({ fingerprint: wanted });
      versions.push(await recipe(1));
      assert.ok(versions[turn + 1].fingerprint.startsWith(wanted));
      await page.waitForFunction((digits) => document.querySelector("#recipe-rows tr.before").textContent.includes(digits), versions[turn].fingerprint.slice(0, 8));
    }
    assert.deepEqual(versions[2], versions[0]);
  });

  await step("a file whose number is taken asks where it goes, and replaces nothing unasked", async () => {
    await open();
    const before = await recipe(1);
    const bytes = await (await page.request.get(new URL("/api/recipes/1/file", page.url()).href)).body();
    const undo = async () => {
      const button = page.locator("#recipe-rows tr.before button").first();
      const [, wanted] = /\(([0-9a-f]{8}),/.exec(await button.textContent());
      await button.click();
      await active({ fingerprint: wanted });
      await page.waitForFunction((digits) => !document.querySelector("#recipe-rows tr.before").textContent.includes(digits), wanted);
    };
    await undo();
    const other = await recipe(1);
    await page.setInputFiles("#import-file", { name: "1.recipe", mimeType: "application/zip", buffer: bytes });
    await page.click("#import button");
    await page.waitForSelector("#question:not([hidden])");
    assert.ok((await page.textContent("#question-words")).includes(`Recipe 1 is ${other.name} with`));
    const choices = await page.locator("#question-choices button").allTextContents();
    assert.deepEqual(choices, ["Import as recipe 2", "Replace recipe 1", "Cancel"]);
    await page.keyboard.press("Escape");
    await page.waitForSelector("#question", { state: "hidden" });
    assert.equal((await recipe(1)).fingerprint, other.fingerprint);
    await undo();
    assert.deepEqual(await recipe(1), before);
  });

  await step("a copy of a recipe is another one, with the same gauges", async () => {
    const before = await recipe(1);
    const count = (wanted) => page.waitForFunction((wanted) => document.querySelectorAll("#recipe-rows tr:not(.before)").length === wanted, wanted);
    await rows.first().locator("button:has-text('Copy')").click();
    await notice("recipe 2 is a copy of recipe 1");
    await count(2);
    const copy = await recipe(2);
    assert.deepEqual(copy.gauges, before.gauges);
    await rows.last().locator("button:has-text('Delete')").click();
    await page.click("#question-choices button:has-text('Delete')");
    await count(1);
  });

  await step("a recipe is deleted after a question, not while it is active, and comes back", async () => {
    await rows.first().locator("button:has-text('Delete')").click();
    await notice("load another recipe first");
    await page.fill("#teach-as", "2");
    await page.click("#teach button");
    await taught();
    const before = await recipe(1);
    await rows.first().locator("button:has-text('Delete')").click();
    await page.click("#question-choices button:has-text('Delete')");
    await page.waitForFunction(() => document.querySelectorAll("#recipe-rows tr:not(.before)").length === 1);
    await page.click("#recipe-rows button:has-text('which was deleted')");
    await page.waitForFunction(() => document.querySelectorAll("#recipe-rows tr:not(.before)").length === 2);
    assert.deepEqual(await recipe(1), before);
    await rows.first().locator("button:has-text('Load')").click();
    await active({ number: 1, fingerprint: before.fingerprint.slice(0, 8) });
    await page.click("nav a[href='#live']");
    await trigger();
    await verdict("FAIL");
  });
}
