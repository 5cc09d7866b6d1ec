// The maps of the last part, with scale, cursor and the outlines of the recipe's regions.
import { $, draw, fill, show, text } from "./element.js";
import { ask, map } from "./api.js";
import { colours, paint } from "./colour.js";
import { signed } from "./number.js";

const UNITS = { mm: 3, counts: 1 };
const state = { layer: "height", map: null, deviation: null, result: null, key: "", recipe: null, recipeKey: "", asked: 0, at: [0, 0] };

// The smallest of 1, 2, 5 × 10ⁿ that is at least `least`.
function round(least) {
  const decade = Math.pow(10, Math.floor(Math.log10(least)));
  return [1, 2, 5, 10].map((factor) => factor * decade).find((step) => step >= least * 0.999999);
}

function drawScale() {
  const { scale, unit } = state.map.about;
  const [low, high] = scale;
  const top = 24, bottom = 290, left = 2, wide = 14;
  const parts = [draw("text", { x: left, y: 14 }, unit)];
  const palette = colours(state.layer), count = 64;
  for (let at = 0; at < count; at += 1) {
    const y = bottom - (bottom - top) * (at + 1) / count;
    const colour = palette[Math.round(at * 255 / (count - 1))];
    parts.push(draw("rect", { x: left, y: y.toFixed(2), width: wide, height: ((bottom - top) / count + 0.5).toFixed(2), fill: `rgb(${colour.join(",")})` }));
  }
  const span = high - low;
  if (span > 0) {
    const step = round(span / 5);
    const places = Math.max(0, -Math.floor(Math.log10(step)));
    for (let tick = Math.ceil(low / step); tick * step <= high; tick += 1) {
      const y = bottom - (bottom - top) * (tick * step - low) / span;
      parts.push(draw("line", { x1: left + wide, x2: left + wide + 4, y1: y, y2: y }));
      parts.push(draw("text", { x: left + wide + 7, y: y + 4 }, signed(tick * step + 0, places).replace(/^\u2212(0(\.0*)?)$/, "$1")));
    }
  }
  fill($("scale"), ...parts);
}

// Regions in camera pixels; those of failed gauges are drawn strongly.
function drawOutlines() {
  const svg = $("outlines");
  if (!state.map) { fill(svg); return; }
  const { width, height, stride } = state.map.about;
  svg.setAttribute("viewBox", `0 0 ${width * stride} ${height * stride}`);
  const recipe = state.recipe, result = state.result;
  if (!recipe || !result) { fill(svg); return; }
  const bad = new Map();
  for (const gauge of recipe.gauges) {
    const found = result.gauges.find((value) => value.name === gauge.name);
    if (!found || (found.valid && found.pass)) continue;
    const names = [gauge.region, gauge.measures.from];
    for (const name of names) if (name) bad.set(name, found.valid ? "fail" : "invalid");
  }
  const outline = (region, kind) => {
    const corners = region.polygon.map(([u, v]) => `${u + 0.5},${v + 0.5}`).join(" ");
    return draw("polygon", { points: corners, class: kind, "vector-effect": "non-scaling-stroke" });
  };
  const quiet = recipe.regions.filter((region) => !bad.has(region.name)).map((region) => outline(region, "quiet"));
  const failing = recipe.regions.filter((region) => bad.has(region.name));
  const loud = failing.map((region) => outline(region, `under`)).concat(failing.map((region) => outline(region, bad.get(region.name))));
  fill(svg, ...quiet, ...loud, ...(state.deviation ? most(state.deviation) : []));
}

// A ring around the place that deviates most, averaged over squares of some pixels so that no single one decides.
function most(map) {
  const { width, height, stride } = map.about;
  const half = Math.max(1, Math.round(4 / stride)), least = (2 * half + 1) * (2 * half + 1) / 2;
  let best = 0, at = null;
  for (let v = half; v < height - half; v += half) {
    for (let u = half; u < width - half; u += half) {
      let sum = 0, count = 0;
      for (let row = v - half; row <= v + half; row += 1) {
        for (let column = u - half; column <= u + half; column += 1) {
          const value = map.values[row * width + column];
          if (!Number.isNaN(value)) { sum += value; count += 1; }
        }
      }
      if (count > least && Math.abs(sum / count) > best) { best = Math.abs(sum / count); at = [u, v]; }
    }
  }
  if (!at) return [];
  const place = { cx: at[0] * stride, cy: at[1] * stride, r: width * stride / 18, "vector-effect": "non-scaling-stroke" };
  return ["most", "most over"].map((kind) => draw("circle", Object.assign({ class: kind }, place)));
}

function readCursor() {
  if (!state.map) return;
  const { width, height, stride, unit } = state.map.about;
  const u = Math.min(width - 1, Math.max(0, state.at[0])), v = Math.min(height - 1, Math.max(0, state.at[1]));
  state.at = [u, v];
  const value = state.map.values[v * width + u];
  const words = Number.isNaN(value) ? "nothing measured here" : `${signed(value, UNITS[unit] || 2)} ${unit}`;
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
  // Without a single point the picture would be that of an older part.
  if (!result || !result.valid_points) { empty(result ? "no height was measured" : "no picture yet"); return; }
  const layer = state.layer;
  let loaded;
  try { loaded = await map(`/api/picture/${layer}?seq=${result.seq}`); } catch (error) {
    if (turn === state.asked) empty(error.message);
    return;
  }
  if (turn !== state.asked) return;
  let deviation = null;
  if (result.gauges.some((gauge) => gauge.valid && !gauge.pass && gauge.name.startsWith("deviation"))) {
    try { deviation = layer === "deviation" ? loaded : await map(`/api/picture/deviation?seq=${result.seq}`); } catch (none) { /* No ring then. */ }
    if (turn !== state.asked) return;
  }
  if (loaded.about.seq !== result.seq) { empty(`the frames of no. ${result.seq} are gone`); return; }
  state.map = loaded;
  state.deviation = deviation;
  paint($("map"), loaded, layer);
  show("no-picture", false);
  drawScale();
  drawOutlines();
}

function empty(words) {
  state.map = null;
  state.deviation = null;
  const canvas = $("map");
  canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
  text("no-picture", words);
  show("no-picture", true);
  text("cursor", "point at the picture to read a value");
  drawOutlines();
}

async function loadRecipe(result) {
  const key = `${result.recipe}/${result.fingerprint}`;
  if (key === state.recipeKey) return;
  state.recipeKey = key;
  state.recipe = null;
  try {
    const recipe = await ask("GET", `/api/recipes/${result.recipe}`);
    // Regions of a recipe that was changed since say nothing about this result.
    if (recipe.fingerprint.startsWith(result.fingerprint)) state.recipe = recipe;
  } catch (none) { state.recipeKey = ""; }
  drawOutlines();
}

// Shows the maps of a new result.
export function showPicture(result, visible) {
  state.result = result;
  if (!visible) { state.key = ""; return; }
  const key = `${state.layer}/${result ? result.seq : "none"}`;
  if (key === state.key) return;
  state.key = key;
  if (result) loadRecipe(result);
  load();
}

export function start() {
  for (const choice of document.querySelectorAll("[data-layer]")) {
    choice.addEventListener("click", () => {
      for (const other of document.querySelectorAll("[data-layer]")) other.setAttribute("aria-pressed", String(other === choice));
      state.layer = choice.dataset.layer;
      showPicture(state.result, true);
    });
  }
  const canvas = $("map");
  canvas.addEventListener("pointermove", point);
  canvas.addEventListener("pointerdown", point);
  canvas.addEventListener("keydown", move);
}
