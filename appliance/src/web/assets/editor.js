// Edits a recipe: features that are drawn on the picture of golden, datum systems, gauges and their limits; tried while they are edited, then stored.
import { $, button, fill, on, show, text } from "./element.js";
import { ask, loadKinds } from "./api.js";
import { change, notice } from "./session.js";
import { choose } from "./question.js";
import { alter, begin, featureKind, free, isChanged, redo, spoken, state, steps, undo } from "./editor-list.js";
import { around } from "./editor-shapes.js";
import { corner, drawShapes, markChosen, showLayer, showMarks, start as startPicture, tool, useTool } from "./editor-picture.js";
import { drawRows, markRows, showFound, start as startRows } from "./editor-rows.js";
import { openDatum, start as startDatum } from "./editor-datum.js";
import { start as startTable } from "./editor-table.js";
import { body, forget, start as startTry, tryNow, tryParts, trySoon } from "./editor-try.js";

// Fields of the recipe itself, with the key of each.
const NAMES = [["editor-name", "name"], ["editor-part", "part_number"], ["editor-guard", "guard_k"]];
const UNSAVED = "What you changed is not stored.";

async function leave() {
  return !isChanged() || choose("Leave without storing?", UNSAVED, [["Leave, forget the changes", true]]);
}

export async function edit(number) {
  if (!await leave()) return;
  let recipe, kinds;
  try { [recipe, kinds] = await Promise.all([ask("GET", `api/recipes/${number}`), loadKinds()]); } catch (error) { notice(error.message, true); return; }
  forget();
  begin(recipe, kinds);
  text("editor-number", String(number));
  for (const id of ["editor-words", "editor-taken"]) text(id, "");
  $("editor-table").value = "";
  show("editor", true);
  // Its size is known before the picture is.
  Object.assign($("editor-map"), { width: recipe.camera.width, height: recipe.camera.height });
  showTools();
  useTool(null);
  drawAll();
  showMarks([]);
  $("editor").scrollIntoView();
  tryNow();
  await showLayer();
  drawShapes();
}

function close() {
  forget();
  useTool(null);
  state.list = null;
  show("editor", false);
}

function drawAll() {
  for (const [id, key] of NAMES) if (document.activeElement !== $(id) || $(id).value !== String(state.list[key])) $(id).value = state.list[key];
  drawShapes();
  drawRows();
  showSteps();
}

function showSteps() {
  const [back, forth] = steps();
  $("editor-undo").disabled = !back;
  $("editor-redo").disabled = !forth;
  text("editor-unsaved", isChanged() ? "not stored" : "");
}

// Follows a change: everything is drawn anew, or only what is shown of it, while somebody types or drags.
function changed(whole) {
  if (whole) drawAll();
  else { markChosen(); showFound(); showSteps(); }
  text("editor-words", "");
  trySoon();
}

// A button for each kind of feature, which draws its usual shape, or corner by corner.
function showTools() {
  fill($("editor-tools"), ...state.kinds.features.map((kind) => {
    const made = button(spoken(kind.kind), "", () => {
      const shape = $("as-polygon").checked && kind.shapes.includes("polygon") ? "polygon" : kind.shapes[0], now = tool();
      useTool(now && now.kind === kind ? null : kind, shape);
    });
    made.title = kind.about;
    made.dataset.tool = kind.kind;
    return made;
  }));
}

// Takes over a feature that was drawn: names it, chooses it, and finds the plane of a contour.
function made(feature) {
  const { features } = state.list, kind = featureKind(feature), of = kind.parameters.find((one) => one.features);
  feature.name = free(spoken(feature.kind), features);
  const plane = of && around(feature.region, features.filter((one) => of.features.includes(one.kind)));
  if (plane) feature[of.name] = plane;
  if (features.length >= state.kinds.bounds.features) { text("editor-cursor", `a recipe has at most ${features.length} features`); return; }
  state.chosen = [features.length];
  state.open = `features ${features.length}`;
  alter("", () => features.push(feature));
}

// Chooses a feature of the picture; `more` keeps those that are chosen.
function chosen(at, more) {
  if (!more && state.chosen.length === 1 && state.chosen[0] === at) return;
  state.chosen = more ? state.chosen.filter((other) => other !== at).concat(state.chosen.includes(at) ? [] : [at]) : [at];
  if (!more) state.open = `features ${at}`;
  markChosen();
  drawRows();
}

function corners(feature, by) {
  const at = corner(), { region } = feature, next = (at + 1) % region.length;
  if (by < 0 && region.length <= 3) { text("editor-words", "a region has at least three corners"); return; }
  if (by > 0 && region.length >= state.kinds.bounds.corners) return;
  alter("", () => {
    if (by < 0) region.splice(at, 1);
    else region.splice(at + 1, 0, [0, 1].map((axis) => Math.round(5 * (region[at][axis] + region[next][axis])) / 10));
  });
}

// Shows what a problem is about.
function go(what, at) {
  state.open = `${what} ${at}`;
  if (what === "features") state.chosen = [at];
  markChosen();
  drawRows();
  const row = document.getElementById(`row-${what}-${at}`);
  if (row) { row.focus(); row.scrollIntoView({ block: "center" }); }
}

async function put(sent) {
  const { recipe } = state;
  try { return await ask("PUT", `api/recipes/${recipe.number}`, sent); } catch (error) {
    if (error.status !== 409) throw error;
    // Somebody else has stored another version: nothing is lost, and nothing is replaced unasked.
    const words = `${error.message}. What you typed is still here. Their version can be brought back with Undo in the list of recipes.`;
    if (!await choose("Somebody else has changed this recipe", words, [["Store mine in its place", true]])) return null;
    recipe.fingerprint = (await ask("GET", `api/recipes/${recipe.number}`)).fingerprint;
    return ask("PUT", `api/recipes/${recipe.number}`, Object.assign({}, sent, { fingerprint: recipe.fingerprint }));
  }
}

function save(event) {
  event.preventDefault();
  change(async () => {
    const { recipe, list } = state;
    if (!await tryNow()) {
      text("editor-words", "It cannot be stored like this: see what is wrong above.");
      const first = $("editor-problems").querySelector("button");
      if (first) first.focus();
      return;
    }
    text("editor-words", "");
    const sent = body();
    if (list.gauges.every((gauge) => state.kinds.limits.every(({ name, of }) => of.includes("master") || gauge[name] === undefined))) {
      const words = "No gauge has a limit. Every part that can be measured passes, whatever its shape; each result says so.";
      sent.judges_nothing = await choose("Store a recipe that judges nothing?", words, [["Store it, it judges nothing", true]]);
      if (!sent.judges_nothing) return;
    }
    const stored = await put(sent);
    if (!stored) return;
    close();
    if (stored.active && !stored.loading) notice(`recipe ${recipe.number} is stored, but the station still uses the previous version: load recipe ${recipe.number}`, true);
    else notice(`recipe ${recipe.number} is stored${stored.loading ? " and is being loaded" : ""}${stored.note ? `: ${stored.note}` : ""}`);
    if (!stored.loading) window.dispatchEvent(new Event("recipes"));
  });
}

function keys(event) {
  if (!state.list || $("editor").hidden || !$("question").hidden || !$("datum").hidden || !(event.ctrlKey || event.metaKey) || event.altKey) return;
  const key = event.key.toLowerCase(), back = key === "z" && !event.shiftKey;
  if (!back && key !== "y" && key !== "z") return;
  event.preventDefault();
  if (back) undo(); else redo();
}

export function start() {
  state.changed = changed;
  startPicture({ made, choose: chosen, tooled: () => {
    const now = tool();
    for (const one of $("editor-tools").children) one.setAttribute("aria-pressed", Boolean(now) && one.dataset.tool === now.kind.kind);
  } });
  startRows({ opened: () => { markChosen(); drawRows(); }, chosen: () => { markChosen(); markRows(); }, corner: corners, datum: openDatum });
  startDatum();
  startTable();
  startTry({ found: () => { showMarks(state.found.features); showFound(); }, go });
  for (const [id, key] of NAMES) {
    on($(id), "input", () => { if ($(id).checkValidity()) alter(id, () => { state.list[key] = key === "guard_k" ? Number($(id).value) : $(id).value; }); });
  }
  on($("editor-undo"), "click", undo);
  on($("editor-redo"), "click", redo);
  on($("editor-parts"), "click", tryParts);
  on($("editor-sign"), "click", () => change(tryNow));
  on($("editor-close"), "click", async () => { if (await leave()) close(); });
  on($("editor-form"), "submit", save);
  on(document, "keydown", keys);
  on(window, "session", () => { if (state.list) trySoon(); });
  on(window, "beforeunload", (event) => { if (isChanged()) { event.preventDefault(); event.returnValue = UNSAVED; } });
}
