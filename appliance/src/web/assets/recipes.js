// The recipes: list, load, teach with what it gained, export, import.
import { $, button, fill, make, show, text } from "./element.js";
import { ask } from "./api.js";
import { change, notice } from "./session.js";
import { signed } from "./number.js";
import { edit } from "./editor.js";

let active = null;
let taught = "";

function day(unix_s) {
  return unix_s ? new Date(unix_s * 1000).toISOString().slice(0, 10) : "not known";
}

function row(recipe) {
  if (recipe.error) {
    const words = make("td", "", recipe.error);
    words.colSpan = 7;
    return make("tr", "", make("td", "", String(recipe.number)), words);
  }
  const use = button("Load", "", () => change(() => ask("POST", `/api/recipes/${recipe.number}/load`), `recipe ${recipe.number} is being loaded`));
  use.setAttribute("aria-label", `Load recipe ${recipe.number}`);
  const alter = button("Edit", "", () => edit(recipe.number));
  alter.setAttribute("aria-label", `Edit recipe ${recipe.number}`);
  const gain = button("Before / after", "", () => compare(recipe.number));
  gain.setAttribute("aria-label", `What teaching recipe ${recipe.number} gained`);
  const take = make("a", "", "Export");
  take.href = `/api/recipes/${recipe.number}/file`;
  take.setAttribute("download", "");
  const own = recipe.number === active;
  const line = make("tr", own ? "active" : "", make("td", "", String(recipe.number)), make("td", "", recipe.name + (own ? " (active)" : "")),
    make("td", "", recipe.part_number), make("td", "", make("code", "", recipe.fingerprint.slice(0, 8))), make("td", "", String(recipe.frames)),
    make("td", "", String(recipe.gauges)), make("td", "", day(recipe.taught_at_unix_s)), make("td", "actions", use, alter, gain, take));
  return line;
}

export async function list() {
  try {
    const { recipes } = await ask("GET", "/api/recipes");
    const none = make("td", "quiet", "there is no recipe yet: teach or import one");
    none.colSpan = 8;
    fill($("recipe-rows"), ...(recipes.length ? recipes.map(row) : [make("tr", "", none)]));
  } catch (error) { notice(error.message, true); }
}

// Before and after: the same number of frames with straight fringes and with the part's own.
export async function compare(number) {
  const recipe = await ask("GET", `/api/recipes/${number}`);
  const { comparison } = recipe;
  text("comparison-name", `recipe ${recipe.number} · ${recipe.name}`);
  show("comparison", true);
  if (!comparison) {
    fill($("comparison-rows"));
    text("comparison-words", "this recipe was made from a recording: there is nothing to compare it with");
    return;
  }
  const line = (name, of) => make("tr", "", make("td", "", name), make("td", "", `${(1000 * of.sigma_mm).toFixed(1)} µm`), make("td", "", `${(100 * of.coverage).toFixed(2)} % of the frame`));
  fill($("comparison-rows"), line(`fixed: straight fringes, ${comparison.fixed.frames} frames`, comparison.fixed), line(`adaptive: the part's own, ${comparison.adaptive.frames} frames`, comparison.adaptive));
  const less = 100 * (1 - comparison.adaptive.sigma_mm / comparison.fixed.sigma_mm);
  const production = recipe.sequences[recipe.production];
  text("comparison-words", `${signed(less, 0)} % less noise where both see the part. In production ${production.frames.length} frames are projected: predicted height noise ${(1000 * production.sigma_mm).toFixed(1)} µm.`);
}

// Follows the snapshot: what is active, how far teaching is, and what it gained when it is done.
export function showRecipes(now, visible) {
  const number = now.recipe ? now.recipe.number : null;
  const changed = number !== active || `${number}/${now.recipe ? now.recipe.fingerprint : ""}` !== taught;
  active = number;
  show("teaching", Boolean(now.teach));
  if (now.teach) {
    text("teach-number", String(now.teach.number));
    $("teach-bar").value = now.teach.fraction;
    text("teach-percent", `${Math.round(100 * now.teach.fraction)} %`);
    text("teach-words", now.teach.words);
    showRecipes.teaching = now.teach.number;
  } else if (showRecipes.teaching) {
    const done = showRecipes.teaching;
    showRecipes.teaching = 0;
    if (number === done && !now.error) { notice(`recipe ${done} is taught and active`); compare(done).catch((error) => notice(error.message, true)); }
    else notice(`recipe ${done} was not taught: ${now.error ? now.error.words : "see the event log"}`, true);
  }
  if (visible && changed) {
    taught = `${number}/${now.recipe ? now.recipe.fingerprint : ""}`;
    list();
  }
}

export function start() {
  $("teach").addEventListener("submit", (event) => {
    event.preventDefault();
    const number = Number($("teach-as").value);
    change(() => ask("POST", `/api/recipes/${number}/teach`), `teaching recipe ${number} has begun: leave the part where it is`);
  });
  $("import").addEventListener("submit", (event) => {
    event.preventDefault();
    const file = $("import-file").files[0];
    change(async () => {
      const stored = await ask("POST", "/api/recipes", file);
      notice(`recipe ${stored.number} · ${stored.name} is stored${stored.note ? `: ${stored.note}` : ""}`);
      list();
    });
  });
}
