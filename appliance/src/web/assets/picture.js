// The maps of the last part, with scale, cursor and the outlines of the recipe's regions.
import { $, draw, fill, on, show, text } from "./element.js";
import { ask, cornersOf, kindOf, loadKinds, map } from "./api.js";
import { paint } from "./colour.js";
import { marks } from "./found.js";
import { over, rings } from "./ring.js";
import { inside } from "./editor-shapes.js";
import { drawScale } from "./scale.js";
import { signed } from "./number.js";
import { viewOf } from "./view.js";

const UNITS = { mm: 3, counts: 1 };
const state = { layer: "height", map: null, deviation: null, result: null, key: "", recipe: null, kinds: null, recipeKey: "", found: [], asked: 0, at: [0, 0] };

let view = null;

// The recipe's gauges that failed or could not be measured in the result.
function failing() {
  const { recipe, result } = state;
  if (!recipe || !result) return [];
  return recipe.gauges.flatMap((gauge) => {
    const found = result.gauges.find((value) => value.name === gauge.name);
    return !found || (found.valid && found.pass) ? [] : [{ gauge, kind: found.valid || found.absent ? "fail" : "invalid", square: found.square }];
  });
}

// Draws the regions of the features; those of failed gauges are emphasised.
function drawOutlines() {
  const svg = $("outlines");
  if (!state.map) { fill(svg); return; }
  const { about } = state.map;
  const found = marks(state.found, about.width * about.stride / 200);
  if (!state.recipe || !state.result) { over(svg, about, ...found, ...rings(about, decisive())); return; }
  const bad = new Map();
  for (const { gauge, kind } of failing()) {
    for (const name of gauge.of || []) if (bad.get(name) !== "fail") bad.set(name, kind);
  }
  const outline = (feature, kind) => {
    const corners = cornersOf(feature).map(([u, v]) => `${u + 0.5},${v + 0.5}`).join(" ");
    return draw("polygon", { points: corners, class: kind, "vector-effect": "non-scaling-stroke" });
  };
  const { features } = state.recipe;
  const quiet = features.filter((one) => !bad.has(one.name)).map((one) => outline(one, "quiet"));
  const loud = features.filter((one) => bad.has(one.name));
  over(svg, about, ...quiet, ...found, ...loud.map((one) => outline(one, "under")), ...loud.map((one) => outline(one, bad.get(one.name))), ...rings(about, decisive()));
}

// The regions of failed gauges that compare the part with golden, so that a place in the picture explains why they fail, and have no square of their own.
function deviating() {
  const names = failing().filter(({ gauge, kind, square }) => kind === "fail" && !square && kindOf(state.kinds, gauge).compares).flatMap(({ gauge }) => gauge.of);
  return state.recipe ? state.recipe.features.filter((one) => names.includes(one.name)) : [];
}

// What decided: the squares of the deviations that failed; without any, where other gauges failed that compare with golden, the pixel of
// the map in their regions that deviates most.
function decisive() {
  const gauges = state.result ? state.result.gauges : [];
  const squares = gauges.filter((gauge) => gauge.square && gauge.valid && !gauge.pass).map((gauge) => gauge.square);
  return squares.length || !state.deviation ? squares : most(state.deviation);
}

function most(map) {
  const { width, height, stride } = map.about;
  const regions = deviating();
  let best = 0, at = null;
  for (let v = 0; v < height; v += 1) {
    for (let u = 0; u < width; u += 1) {
      const size = Math.abs(map.values[v * width + u]);
      if (size > best && regions.some((one) => inside(cornersOf(one), [u * stride, v * stride]))) { best = size; at = { column: u * stride, row: v * stride, side: stride }; }
    }
  }
  return at ? [at] : [];
}

function readCursor() {
  if (!state.map) return;
  const { width, height, stride, unit } = state.map.about;
  const u = Math.min(width - 1, Math.max(0, state.at[0])), v = Math.min(height - 1, Math.max(0, state.at[1]));
  state.at = [u, v];
  const value = state.map.values[v * width + u];
  const none = state.layer === "deviation" ? "not compared with golden" : "nothing measured here";
  const words = Number.isNaN(value) ? none : `${signed(value, UNITS[unit] || 2)} ${unit}`;
  text("cursor", `column ${u * stride} px, row ${v * stride} px: ${words}`);
}

function point(event) {
  if (!state.map) return;
  const box = $("map").getBoundingClientRect();
  const { width, height } = state.map.about;
  state.at = [Math.floor((event.clientX - box.left) / box.width * width), Math.floor((event.clientY - box.top) / box.height * height)];
  readCursor();
}

function move(event) {
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  if (!steps || !state.map) return;
  event.preventDefault();
  const far = event.shiftKey ? 10 : 1;
  state.at = [state.at[0] + far * steps[0], state.at[1] + far * steps[1]];
  readCursor();
}

async function load() {
  const turn = state.asked += 1;
  const result = state.result;
  // Without resolved pixels there is no new picture; the last one is that of an older part.
  if (!result || !result.valid_points) { empty(result ? "no height was measured" : "no picture yet"); return; }
  const layer = state.layer;
  let loaded;
  try { [loaded] = await Promise.all([map(`api/picture/${layer}?seq=${result.seq}`), loadRecipe(result)]); } catch (error) {
    if (turn === state.asked) empty(error.message);
    return;
  }
  if (turn !== state.asked) return;
  let deviation = null;
  if (deviating().length) {
    try { deviation = layer === "deviation" ? loaded : await map(`api/picture/deviation?seq=${result.seq}`); } catch (none) { /* No ring then. */ }
    if (turn !== state.asked) return;
  }
  state.found = await contours(result);
  if (turn !== state.asked) return;
  if (loaded.about.seq !== result.seq) { empty(`the frames of no. ${result.seq} are gone`); return; }
  state.map = loaded;
  state.deviation = deviation;
  paint($("map"), loaded, layer);
  show("no-picture", false);
  text("shown", loaded.about.words);
  drawScale($("scale"), state.map.about, state.layer);
  drawOutlines();
  view.show({ path: `api/picture/surface?seq=${result.seq}`, seq: result.seq, points: result.valid_points });
}

// What was found of the contours of a result's recipe; nothing if it has none, or its frames are gone.
async function contours(result) {
  const { kinds, recipe } = state;
  if (!recipe || !recipe.features.some(({ kind }) => kinds.features.find((one) => one.kind === kind).around_mm)) return [];
  try {
    const found = await ask("GET", "api/last/features");
    return found && found.seq === result.seq ? found.features : [];
  } catch (none) { return []; }
}

function empty(words) {
  state.map = null;
  state.deviation = null;
  const canvas = $("map");
  canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
  text("no-picture", words);
  text("shown", "");
  show("no-picture", true);
  text("cursor", "point at the picture to read a value");
  drawOutlines();
  view.show(null);
}

// Loads the recipe of a result; none if it was changed since, because its regions need not be those of the result.
async function loadRecipe(result) {
  const keyOf = (of) => `${of.recipe}/${of.fingerprint}`;
  const key = keyOf(result);
  if (key === state.recipeKey) return;
  state.recipe = null;
  state.recipeKey = "";
  let recipe;
  try {
    // It may have been deleted or replaced since.
    const { recipes } = await ask("GET", "api/recipes");
    if (!recipes.some((one) => one.number === result.recipe && !one.error && one.fingerprint.startsWith(result.fingerprint))) return;
    recipe = await ask("GET", `api/recipes/${result.recipe}`);
    state.kinds = await loadKinds();
  } catch (none) { return; }
  // Meanwhile there may be a result of another recipe.
  if (!state.result || keyOf(state.result) !== key) return;
  state.recipeKey = key;
  state.recipe = recipe.fingerprint.startsWith(result.fingerprint) ? recipe : null;
}

// Shows the maps of a new result.
export function showPicture(result, visible) {
  state.result = result;
  if (!visible) { state.key = ""; return; }
  const key = `${state.layer}/${result ? result.seq : "none"}`;
  if (key === state.key) return;
  state.key = key;
  load();
}

export function start() {
  for (const choice of document.querySelectorAll("[data-layer]")) {
    on(choice, "click", () => {
      for (const other of document.querySelectorAll("[data-layer]")) other.setAttribute("aria-pressed", other === choice);
      state.layer = choice.dataset.layer;
      showPicture(state.result, true);
    });
  }
  const canvas = $("map");
  view = viewOf(canvas);
  canvas.addEventListener("pointermove", point);
  canvas.addEventListener("pointerdown", point);
  canvas.addEventListener("keydown", move);
}
