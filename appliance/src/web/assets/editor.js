// Edits a recipe: regions of features by dragging on the picture of the part as taught, parameters, limits and names in fields.
import { $, draw, fill, make, show, text } from "./element.js";
import { ask, cornersOf, kindOf, loadKinds, map, unitOf } from "./api.js";
import { paint } from "./colour.js";
import { change, notice } from "./session.js";
import { choose } from "./question.js";

const state = { recipe: null, map: null, kinds: null, chosen: [0, 0], drag: null, wide: 1 };

// Factor and symbol of a gauge's limits as people write them, and the smallest and largest limit that the station accepts.
function unit({ unit: symbol, low, high }) {
  return symbol ? [1, symbol, low, high] : [100, "%", 100 * low, 100 * high];
}

// The name of a kind or word as people read it.
const spoken = (word) => word.replace(/_/g, " ");

export async function edit(number) {
  try {
    state.recipe = await ask("GET", `/api/recipes/${number}`);
    state.map = await map(`/api/recipes/${number}/picture/height`);
    state.kinds = await loadKinds();
  } catch (error) { notice(error.message, true); return; }
  const { recipe } = state;
  text("editor-number", String(number));
  text("editor-words", "");
  $("editor-name").value = recipe.name;
  $("editor-part").value = recipe.part_number;
  $("editor-guard").value = recipe.guard_k || 0;
  paint($("editor-map"), state.map, "height");
  state.wide = recipe.camera.width;
  $("editor-regions").setAttribute("viewBox", `0 0 ${recipe.camera.width} ${recipe.camera.height}`);
  state.chosen = [0, 0];
  // A region cannot say where a section is.
  const drawn = state.kinds.kinds.filter(({ takes }) => !takes.some((place) => place.includes("section")));
  fill($("gauge-kind"), ...drawn.map((one) => new Option(spoken(one.kind), one.kind)));
  show("editor", true);
  drawRegions();
  drawGauges();
  $("editor").scrollIntoView();
}

// Side of a corner's touch target, and radius of the grip that is drawn in it, in pixels of the screen.
const TARGET = 26;
const GRIP = 8;

// The middle of a corner's grip: outside the region, and far enough that the grips of a small region overlap neither each other nor
// its inside.
function outside(polygon, corner, scale) {
  const middle = [0, 1].map((axis) => polygon.reduce((sum, point) => sum + point[axis], 0) / polygon.length);
  const [u, v] = polygon[corner];
  const by = [u - middle[0], v - middle[1]];
  const far = Math.hypot(by[0], by[1]) || 1;
  // Squares of this side around a circle, evenly spread, touch each other at this radius.
  const least = TARGET * scale * Math.SQRT1_2 / Math.sin(Math.PI / polygon.length);
  const reach = Math.max(far + (GRIP + 2) * scale, least);
  return [middle[0] + 0.5 + by[0] / far * reach, middle[1] + 0.5 + by[1] / far * reach];
}

function drawRegions() {
  const { recipe, chosen } = state;
  // Camera pixels per pixel of the screen, so that touch targets have the same size on every screen.
  const scale = state.wide / ($("editor-regions").getBoundingClientRect().width || state.wide);
  const parts = [];
  recipe.features.forEach((feature, at) => {
    const corners = cornersOf(feature).map(([u, v]) => `${u + 0.5},${v + 0.5}`).join(" ");
    const own = at === chosen[0] ? " chosen" : "";
    const inside = draw("polygon", { points: corners, class: `region${own}`, "vector-effect": "non-scaling-stroke" });
    // A section is not drawn, only shown.
    if (feature.region) inside.addEventListener("pointerdown", (event) => begin(event, at, -1));
    parts.push(inside);
  });
  const feature = recipe.features[chosen[0]];
  if (feature && feature.region) {
    feature.region.forEach(([u, v], corner) => {
      const kind = `handle${corner === chosen[1] ? " chosen" : ""}`;
      const [x, y] = outside(feature.region, corner, scale), side = TARGET * scale;
      const handle = draw("g", { class: kind, tabindex: 0, role: "button", "aria-label": `corner ${corner + 1} of region ${feature.name}: column ${u.toFixed(0)}, row ${v.toFixed(0)}` },
        draw("rect", { x: x - side / 2, y: y - side / 2, width: side, height: side, class: "target" }),
        draw("line", { x1: u + 0.5, y1: v + 0.5, x2: x, y2: y, "vector-effect": "non-scaling-stroke" }),
        draw("circle", { cx: x, cy: y, r: GRIP * scale, class: "grip", "vector-effect": "non-scaling-stroke" }));
      handle.addEventListener("pointerdown", (event) => begin(event, chosen[0], corner));
      handle.addEventListener("keydown", (event) => nudge(event, corner));
      parts.push(handle);
    });
    text("editor-cursor", `${feature.kind} ${feature.name}, ${feature.region.length} corners: drag a corner, or the region by its inside; arrow keys move the chosen corner`);
  }
  fill($("editor-regions"), ...parts);
}

function place(event) {
  const box = $("editor-regions").getBoundingClientRect();
  const { width, height } = state.recipe.camera;
  return [(event.clientX - box.left) / box.width * width - 0.5, (event.clientY - box.top) / box.height * height - 0.5];
}

function begin(event, region, corner) {
  event.preventDefault();
  state.chosen = [region, Math.max(0, corner)];
  state.drag = { region, corner, from: place(event), was: state.recipe.features[region].region.map((point) => point.slice()) };
  $("editor-regions").setPointerCapture(event.pointerId);
  drawRegions();
}

function inside(point) {
  const { width, height } = state.recipe.camera;
  const bound = (at, most) => Math.round(10 * Math.min(most - 0.5, Math.max(-0.5, at))) / 10;
  return [bound(point[0], width), bound(point[1], height)];
}

function drag(event) {
  const { drag: held } = state;
  if (!held) return;
  const to = place(event);
  const by = [to[0] - held.from[0], to[1] - held.from[1]];
  const polygon = state.recipe.features[held.region].region;
  held.was.forEach((point, at) => {
    if (held.corner < 0 || held.corner === at) polygon[at] = inside([point[0] + by[0], point[1] + by[1]]);
  });
  drawRegions();
}

function nudge(event, corner) {
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  if (!steps) return;
  event.preventDefault();
  const far = event.shiftKey ? 10 : 1;
  const polygon = state.recipe.features[state.chosen[0]].region;
  state.chosen = [state.chosen[0], corner];
  polygon[corner] = inside([polygon[corner][0] + far * steps[0], polygon[corner][1] + far * steps[1]]);
  drawRegions();
  $("editor-regions").querySelectorAll(".handle")[corner].focus();
}

function field(value, label, [factor, symbol, least, most], set) {
  const input = make("input", "limit");
  input.type = "number";
  input.step = "any";
  input.min = least;
  input.max = most;
  input.value = value === null || value === undefined ? "" : String(Number((value * factor).toPrecision(5)));
  input.placeholder = "none";
  input.setAttribute("aria-label", `${label} in ${symbol}`);
  input.addEventListener("input", () => set(input.value === "" ? null : Number(input.value) / factor));
  return input;
}

// What limits may come from.
const SOURCES = ["nominal", "golden", "plus", "minus"];

// "deviation over 9 px": the kind's name and its words, with a field for each parameter in them.
function measures(gauge, kind) {
  const fields = kind.words.split(/\{(\w+)\}/).map((part, at) => (at % 2 ? parameter(gauge, kind.parameters.find(({ name }) => name === part)) : part));
  const cell = make("td", "", `${spoken(gauge.kind)} `, ...fields);
  cell.title = kind.about;
  return cell;
}

// The field of a parameter: a list of its words, a number, or two.
function parameter(gauge, of) {
  const { name, about, choices, unit: symbol, above, least = above, most, odd, count } = of;
  if (count) {
    const both = make("span");
    gauge[name].forEach((value, at) => {
      const one = { ...gauge[name], name: gauge.name };
      const input = parameter(one, { ...of, name: at, count: 0 });
      input.setAttribute("aria-label", `${spoken(name)} ${at + 1} of ${gauge.name}`);
      input.addEventListener("input", () => { gauge[name][at] = one[at]; });
      both.append(input);
    });
    return both;
  }
  const input = make(choices ? "select" : "input", choices ? "" : "limit");
  input.setAttribute("aria-label", `${spoken(String(name))} of ${gauge.name}`);
  input.title = about;
  if (choices) {
    fill(input, ...choices.map(({ word }) => new Option(spoken(word), word)));
    input.value = gauge[name];
    input.addEventListener("change", () => { gauge[name] = input.value; drawGauges(); });
    return input;
  }
  const pixels = symbol === "px";
  const { width, height } = state.recipe.camera;
  Object.assign(input, { type: "number", required: true, min: least, max: most || Math.max(width, height), step: pixels ? (odd ? 2 : 1) : "any", value: gauge[name] });
  input.addEventListener("input", () => { gauge[name] = Number(input.value); });
  return input;
}

function drawGauges() {
  const { recipe } = state;
  const row = (gauge) => {
    const kind = kindOf(state.kinds, gauge);
    const units = unit(unitOf(state.kinds, gauge));
    // A limit that is written here comes from nothing else.
    const limit = (key) => (value) => {
      for (const source of SOURCES) delete gauge[source];
      if (value === null) delete gauge[key]; else gauge[key] = value;
      check();
    };
    const low = field(gauge.low, `lowest ${gauge.name}`, units, limit("low"));
    const high = field(gauge.high, `highest ${gauge.name}`, units, limit("high"));
    // The browser's own messages do not name the gauge.
    const refused = ({ validity }) => validity.badInput || validity.rangeUnderflow || validity.rangeOverflow;
    const check = () => {
      const crossed = gauge.low > gauge.high ? `the lowest ${gauge.name} is above the highest: no part would pass` : "";
      for (const [input, more] of [[low, crossed], [high, ""]]) {
        input.setCustomValidity(refused(input) ? `${input.getAttribute("aria-label")}: write a number from ${units[2]} to ${units[3]}` : more);
      }
    };
    check();
    const of = gauge.of || [];
    const line = make("tr", "", make("td", "", String(gauge.slot)), make("td", "", gauge.name), measures(gauge, kind), make("td", "", of.join(", ") || "whole part"),
      make("td", "", low), make("td", "", high), make("td", "", units[1]));
    line.addEventListener("focusin", () => {
      const at = recipe.features.findIndex((feature) => feature.name === of[0]);
      if (at >= 0 && at !== state.chosen[0]) { state.chosen = [at, 0]; drawRegions(); }
    });
    return line;
  };
  fill($("editor-gauges"), ...recipe.gauges.map(row));
}

// Adds a gauge of the chosen kind, with its defaults or as one of this kind has them, and a region in the middle of the part for each
// feature that it takes.
function addGauge() {
  const { recipe } = state;
  const { width, height } = recipe.camera;
  const kind = kindOf(state.kinds, { kind: $("gauge-kind").value });
  const named = (what, taken) => {
    let number = 1;
    while (taken.some((other) => other.name === `${what} ${number}`)) number += 1;
    return `${what} ${number}`;
  };
  const of = kind.takes.map(([takes], place) => {
    const name = named("region", recipe.features);
    const [left, right] = [0.4, 0.6].map((share) => Math.round((share - 0.25 * place) * width)), [top, bottom] = [0.4, 0.6].map((share) => Math.round(share * height));
    recipe.features.push({ name, kind: takes, region: [[left, top], [right, top], [right, bottom], [left, bottom]] });
    return name;
  });
  const like = recipe.gauges.find((gauge) => gauge.kind === kind.kind) || {};
  const gauge = { slot: 1, name: named(spoken(kind.kind), recipe.gauges), kind: kind.kind, of, low: like.low, high: like.high };
  while (recipe.gauges.some(({ slot }) => slot === gauge.slot)) gauge.slot += 1;
  for (const { name, default: usual } of kind.parameters) {
    const value = name in like ? like[name] : usual;
    gauge[name] = Array.isArray(value) ? value.slice() : value;
  }
  recipe.gauges.push(gauge);
  recipe.gauges.sort((one, other) => one.slot - other.slot);
  if (of.length) state.chosen = [recipe.features.length - of.length, 0];
  drawRegions();
  drawGauges();
}

function addCorner() {
  const polygon = state.recipe.features[state.chosen[0]].region;
  if (!polygon) return;
  const at = state.chosen[1], next = (at + 1) % polygon.length;
  polygon.splice(at + 1, 0, inside([(polygon[at][0] + polygon[next][0]) / 2, (polygon[at][1] + polygon[next][1]) / 2]));
  state.chosen = [state.chosen[0], at + 1];
  drawRegions();
}

function removeCorner() {
  const polygon = state.recipe.features[state.chosen[0]].region;
  if (!polygon) return;
  if (polygon.length <= 3) { text("editor-words", "a region has at least three corners"); return; }
  polygon.splice(state.chosen[1], 1);
  state.chosen = [state.chosen[0], 0];
  drawRegions();
}

function save(event) {
  event.preventDefault();
  const { recipe } = state;
  const body = { fingerprint: recipe.fingerprint, name: $("editor-name").value, part_number: $("editor-part").value, guard_k: Number($("editor-guard").value), features: recipe.features, gauges: recipe.gauges };
  change(async () => {
    if (recipe.gauges.every((gauge) => gauge.low === undefined && gauge.high === undefined)) {
      const words = "No gauge has a limit. Every part that can be measured passes, whatever its shape; each result says so.";
      body.judges_nothing = await choose("Store a recipe that judges nothing?", words, [["Store it, it judges nothing", true]]);
      if (!body.judges_nothing) return;
    }
    const stored = await ask("PUT", `/api/recipes/${recipe.number}`, body);
    recipe.fingerprint = stored.fingerprint;
    show("editor", false);
    if (stored.active && !stored.loading) notice(`recipe ${recipe.number} is stored, but the station still uses the previous version: load recipe ${recipe.number}`, true);
    else notice(`recipe ${recipe.number} is stored${stored.loading ? " and is being loaded" : ""}${stored.note ? `: ${stored.note}` : ""}`);
    if (!stored.loading) window.dispatchEvent(new Event("recipes"));
  });
}

export function start() {
  const svg = $("editor-regions");
  svg.addEventListener("pointermove", drag);
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { state.drag = null; });
  window.addEventListener("resize", () => { if (state.recipe && !$("editor").hidden) drawRegions(); });
  $("gauge-add").addEventListener("click", addGauge);
  $("corner-add").addEventListener("click", addCorner);
  $("corner-remove").addEventListener("click", removeCorner);
  $("editor-close").addEventListener("click", () => show("editor", false));
  $("editor-form").addEventListener("submit", save);
}
