// The recipes: list, load, teach and compare, export, import, delete and undo.
import { $, button, cells, fill, label, make, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { change, needs, notice } from "./session.js";
import { choose } from "./question.js";
import { edit } from "./editor.js";
import { showPart, start as startPart } from "./part.js";

let active = null;
// Number and fingerprint of the active recipe when the list was read last.
let listedFor = "";
// The listed recipes, and the number that the page proposed to teach.
let stored = [];
let proposed = "";
// The number whose recipe the form follows.
let followed = "";

function day(unix_s) {
  return unix_s ? new Date(unix_s * 1000).toISOString().slice(0, 10) : "not known";
}

function row(recipe) {
  const { number } = recipe;
  if (recipe.error) {
    const words = make("td", "", recipe.error);
    words.colSpan = 6;
    return make("tr", "", ...cells(String(number)), words, make("td", "actions", remover(recipe)));
  }
  const act = (words, does) => label(button(words, "", does), `${words} recipe ${number}`);
  const use = act("Load", () => change(() => ask("POST", `api/recipes/${number}/load`), `recipe ${number} is being loaded`));
  const gain = label(button("Before / after", "", () => compare(number)), `Before / after: what teaching recipe ${number} gained`);
  const take = label(make("a", "", "Export"), `Export recipe ${number}`);
  take.href = `api/recipes/${number}/file`;
  take.setAttribute("download", "");
  const twin = act("Copy", () => change(() => copy(number)));
  const own = number === active, taught = make("td", "", day(recipe.taught_at_unix_s));
  if (recipe.made_by) taught.append(make("small", "", `by ${recipe.made_by}`));
  return make("tr", own ? "active" : "", ...cells(String(number), recipe.name + (own ? " (active)" : "") + (recipe.judges_nothing ? " (judges nothing)" : ""), recipe.part_number,
    make("code", "", recipe.fingerprint.slice(0, 8)), String(recipe.frames), String(recipe.gauges)), taught,
  make("td", "actions", needs(use, "POST /api/recipes/{number}/load"), act("Edit", () => edit(number)), gain, needs(twin, "POST /api/recipes"), take, remover(recipe)));
}

// Stores a recipe once more under the first number that is free, for a variant of the part.
async function copy(number) {
  const free = await list();
  if (free === null) throw new Error("every recipe number is taken: delete a recipe first");
  const answer = await fetch(`api/recipes/${number}/file`);
  if (!answer.ok) throw new Error(`recipe ${number} cannot be read`);
  const made = await ask("POST", `api/recipes?number=${free}`, await answer.blob());
  notice(`recipe ${made.number} is a copy of recipe ${number}${made.note ? `: ${made.note}` : ""}`);
  list();
}

// "bracket with 2 features and 4 gauges"
function content(recipe) {
  if (recipe.error) return "a file that cannot be read";
  const number = (many, what) => `${many} ${what}${many === 1 ? "" : "s"}`;
  return `${recipe.name} with ${number(recipe.features, "feature")} and ${number(recipe.gauges, "gauge")}`;
}

function remover(recipe) {
  const remove = button("Delete", "", () => {
    if (recipe.number === active) { notice(`recipe ${recipe.number} is active: load another recipe first`, true); return undefined; }
    return change(async () => {
      const words = `It is ${content(recipe)}. It can be brought back from this list.`;
      if (!await choose(`Delete recipe ${recipe.number}?`, words, [["Delete", true]])) return;
      await ask("DELETE", `api/recipes/${recipe.number}`);
      notice(`recipe ${recipe.number} is deleted`);
      list();
    });
  });
  return needs(label(remove, `Delete recipe ${recipe.number}`), "DELETE /api/recipes/{number}");
}

// A line below a recipe, or in place of a deleted one, that restores the previous version.
function undoer(number, before, words) {
  const undo = button(words, "plain", () => change(async () => {
    const now = await ask("POST", `api/recipes/${number}/undo`);
    // The PLC reads the first 32 bits of the fingerprint.
    const crc = `RECIPE_CRC32 is 0x${now.fingerprint.slice(0, 8).toUpperCase()}`;
    if (now.active && !now.loading) notice(`recipe ${number} is undone, but the station still uses the version that was undone: load recipe ${number}`, true);
    else notice(`recipe ${number} · ${now.name} is back${now.loading ? " and is being loaded" : ""}: its ${crc}`);
    list();
  }));
  const place = make("td", "", needs(undo, "POST /api/recipes/{number}/undo"));
  place.colSpan = 7;
  return make("tr", "before", make("td", "", before.deleted ? String(number) : ""), place);
}

// "the version of 2026-11-21 (a1b2c3d4, 4 gauges) by anna (technician)"
function version(recipe) {
  const when = recipe.taught_at_unix_s ? ` of ${day(recipe.taught_at_unix_s)}` : "";
  return `the version${when} (${recipe.fingerprint.slice(0, 8)}, ${recipe.gauges} gauges)${recipe.made_by ? ` by ${recipe.made_by}` : ""}`;
}

function rows(recipe) {
  const { number, before } = recipe;
  return before ? [row(recipe), undoer(number, before, `Undo: bring back ${version(before)}`)] : [row(recipe)];
}

function gone(recipe) {
  return undoer(recipe.number, { deleted: true }, `Undo: bring back ${recipe.name}, which was deleted: ${version(recipe)}`);
}

// Shows the list of recipes; answers with the lowest number that is free, null if there is none.
export async function list() {
  try {
    const { recipes, deleted, free } = await ask("GET", "api/recipes");
    stored = recipes;
    const none = make("td", "quiet", "there is no recipe yet: teach or import one");
    none.colSpan = 8;
    const lines = recipes.length ? recipes.map(rows) : [[make("tr", "", none)]];
    fill($("recipe-rows"), ...[].concat(...lines), ...deleted.map(gone));
    // A number that somebody typed stays.
    const typed = $("teach-as").value;
    if (typed === "" || typed === proposed) $("teach-as").value = proposed = free === null ? "" : String(free);
    follow();
    return free;
  } catch (error) { notice(error.message, true); return null; }
}

// Where a recipe file goes whose number is taken; null if nothing is to be imported.
async function destination(number) {
  const free = await list();
  const taken = stored.find((recipe) => recipe.number === number) || { error: true };
  const words = `Recipe ${number} is ${content(taken)}. If it is replaced, Undo in the list of recipes brings it back.`;
  const other = free === null ? [] : [[`Import as recipe ${free}`, `?number=${free}`]];
  return choose(`Recipe ${number} is there already`, words, other.concat([[`Replace recipe ${number}`, "?replace=true"]]));
}

// Stores a recipe file; asks if its number is taken.
async function take(file) {
  try { return await ask("POST", "api/recipes", file); } catch (error) {
    if (!error.taken) throw error;
    const to = await destination(error.taken);
    return to && ask("POST", `api/recipes${to}`, file);
  }
}

// What the form says of the part beside its number.
function taught() {
  const limit = $("teach-limit").value;
  return { everything: $("teach-everything").checked, ...(limit === "" ? {} : { limit_mm: Number(limit) }) };
}

// The form says of another number's recipe what it was taught with.
function follow() {
  if ($("teach-as").value === followed) return;
  followed = $("teach-as").value;
  const there = stored.find((recipe) => recipe.number === Number($("teach-as").value));
  $("teach-everything").checked = Boolean(there && there.everything);
}

// The body of a request to teach a number; none if a recipe has the number and is to stay.
async function consent(number) {
  await list();
  const taken = stored.find((recipe) => recipe.number === number);
  const wanted = taught();
  if (!taken) return wanted;
  const words = `It is ${content(taken)}. Features and gauges are made anew, or kept; features that are kept stay where they are in the picture. Name and part number stay, and Undo in the list of recipes brings this version back.`;
  const keep = taken.error ? [] : [["Replace, keep features and gauges", { replace: true, keep_gauges: true, ...wanted }]];
  return choose(`Replace recipe ${number}?`, words, keep.concat([["Replace, with new gauges", { replace: true, ...wanted }]]));
}

async function teach(number) {
  const wanted = await consent(number);
  if (!wanted) return;
  await ask("POST", `api/recipes/${number}/teach`, wanted);
  notice(`teaching recipe ${number} has begun: leave the part where it is`);
}

// Teaches a number again with what a person has marked in the picture of the part.
async function teachMarked(number, marking) {
  await list();
  const replace = stored.some((recipe) => recipe.number === number);
  await ask("POST", `api/recipes/${number}/teach`, { replace, everything: false, marking });
  notice(`teaching recipe ${number} has begun: leave the part where it is`);
}

// Teaches the part as the first number that is free.
export async function teachNext() {
  const { free } = await ask("GET", "api/recipes");
  if (free === null) throw new Error("every recipe number is taken: delete a recipe, or teach one anew under Recipes");
  await teach(free);
}

// What good parts deviate by, as predicted when the part was taught.
function held(good) {
  if (!good) return "";
  const limit = `±${good.limit_mm.toFixed(2)} mm`;
  const expected = `Good parts deviate by up to ${good.largest_mm.toFixed(3)} ± ${good.scatter_mm.toFixed(3)} mm`;
  const words = [`${expected}; the limit was set to ${limit}.`];
  if (good.smoothing_px) words.push(`Deviations are means over ${good.smoothing_px} × ${good.smoothing_px} pixels${good.wider_px ? `, over up to ${good.wider_px} × ${good.wider_px} on ${(100 * good.wider).toFixed(1)} % of the part, where it is too noisy or too bent for that` : ""}: ${good.dent_mm > 0 ? `a dent of ${good.dent_mm.toFixed(1)} mm across is seen at nine tenths of its depth, a narrower one at less, which U does not cover` : "a defect that is narrower is seen at less than its depth"}.`);
  if (good.weighed > 0) words.push(`${(100 * good.weighed).toFixed(2)} % of the surface is so dark or so steep that a deviation there must be larger to be found, by a factor of ${(1 / good.least_weight).toFixed(1)} at its worst place: another pose or more light lowers it.`);
  if (good.left_out > 0) words.push(`${(100 * good.left_out).toFixed(2)} % of the surface's pixels are too dark or too steep to be compared: another pose brings them back.`);
  return words.join(" ");
}

// Shows the comparison that teaching stored: straight fringes with the part's adaptive pattern, at the same number of frames.
export async function compare(number) {
  const recipe = await ask("GET", `api/recipes/${number}`);
  const { comparison } = recipe;
  text("comparison-name", `recipe ${recipe.number} · ${recipe.name}`);
  show("comparison", true);
  text("comparison-limits", held(recipe.good_parts));
  fill($("comparison-tried"), ...(recipe.tried || []).map(({ gauge, passes }) => make("li", "", `${gauge} would pass ${(100 * Math.min(passes, 0.9999)).toFixed(2)} % of good parts that lie anywhere within ${recipe.placement_tolerance_mm} mm`)));
  if (!comparison) {
    fill($("comparison-rows"));
    text("comparison-words", "this recipe was made from a recording: there is nothing to compare it with");
    return;
  }
  const line = (name, of) => make("tr", "", ...cells(name, `${(1000 * of.sigma_mm).toFixed(1)} µm`, `${(100 * of.coverage).toFixed(2)} % of the frame`));
  fill($("comparison-rows"), line(`fixed: straight fringes, ${comparison.fixed.frames} frames`, comparison.fixed), line(`adaptive: the part's own, ${comparison.adaptive.frames} frames`, comparison.adaptive));
  const less = 100 * (1 - comparison.adaptive.sigma_mm / comparison.fixed.sigma_mm);
  const production = recipe.sequences[recipe.production];
  text("comparison-words", `${less < 0 ? `${(-less).toFixed(0)} % more` : `${less.toFixed(0)} % less`} noise where both see the part. In production ${production.frames.length} frames are projected: predicted height noise ${(1000 * production.sigma_mm).toFixed(1)} µm.`);
}

// Follows the snapshot: reads the list again when another recipe is active and the list is visible, shows the progress of teaching,
// and the comparison when teaching has ended.
export function showRecipes(now, visible) {
  const number = now.recipe ? now.recipe.number : null;
  const changed = number !== active || `${number}/${now.recipe ? now.recipe.fingerprint : ""}` !== listedFor;
  active = number;
  show("teaching", now.teach);
  if (now.teach) {
    text("teach-number", String(now.teach.number));
    $("teach-bar").value = now.teach.fraction;
    text("teach-percent", `${Math.round(100 * now.teach.fraction)} %`);
    text("teach-words", now.teach.words);
    showRecipes.teaching = now.teach.number;
    show("part-seen", false);
  } else if (showRecipes.teaching) {
    const done = showRecipes.teaching;
    showRecipes.teaching = 0;
    showPart(done);
    if (number === done && !now.error) { notice(`recipe ${done} is taught and active`); compare(done).catch((error) => notice(error.message, true)); }
    else notice(`recipe ${done} was not taught: ${now.error ? now.error.words : "see the event log"}`, true);
  }
  if (visible && changed) {
    listedFor = `${number}/${now.recipe ? now.recipe.fingerprint : ""}`;
    list();
  }
}

export function start() {
  startPart({ teach: teachMarked });
  on($("teach-as"), "input", follow);
  on($("teach"), "submit", () => change(() => teach(Number($("teach-as").value))));
  on($("import"), "submit", () => {
    const file = $("import-file").files[0];
    change(async () => {
      const imported = await take(file);
      if (!imported) return;
      notice(`recipe ${imported.number} · ${imported.name} is stored${imported.note ? `: ${imported.note}` : ""}`);
      list();
    });
  });
}
