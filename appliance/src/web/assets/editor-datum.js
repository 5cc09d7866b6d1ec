// The dialogue for a datum system: its features in order, and a drawing of the axes that they make.
import { $, draw, fill, make, on, show, text } from "./element.js";
import { alter, foundOf, free, state } from "./editor-list.js";
import { outline } from "./editor-shapes.js";
import { pixel } from "./editor-picture.js";

const LETTERS = ["A", "B", "C"];
let edited = null, opener = null;

const frames = () => state.kinds.datums.frames;
const feature = (name) => state.list.features.find((one) => one.name === name);
const kindsOf = (of) => of.map((name) => feature(name).kind);
const fits = (kinds, whole) => frames().some((frame) => (!whole || frame.length === kinds.length) && kinds.every((kind, at) => frame[at] === kind));
// The features that can come behind some others; those that are chosen first.
function behind(of) {
  const { features } = state.list, chosen = state.chosen.map((at) => features[at]);
  const all = chosen.concat(features.filter((one) => !chosen.includes(one)));
  return all.filter(({ name, kind }) => !of.includes(name) && fits(kindsOf(of).concat(kind))).map(({ name }) => name);
}

// The features that are asked for, as far as they fit.
function wanted() {
  const of = [];
  for (const letter of LETTERS) {
    const { value } = $(`datum-${letter}`);
    if (!value || !behind(of).includes(value)) break;
    of.push(value);
  }
  return of;
}

// Offers for each place what fits behind the ones before; a place without a choice is empty.
function offer(of) {
  LETTERS.forEach((letter, at) => {
    const names = of.length < at ? [] : behind(of.slice(0, at));
    const input = $(`datum-${letter}`);
    fill(input, ...(at ? [new Option("none", "")] : []), ...names.map((name) => new Option(name, name)));
    input.value = names.includes(of[at]) ? of[at] : "";
    input.disabled = !names.length;
  });
  drawAxes(of);
}

// Where a feature is in the picture, and along which direction it lies.
function placed(name) {
  const one = feature(name), found = foundOf("features", one), corners = outline(one, pixel()), fit = found && found.fit;
  const middle = [0, 1].map((axis) => corners.reduce((sum, point) => sum + point[axis], 0) / corners.length);
  const ends = fit && !fit.closed ? [fit.outline[0], fit.outline[fit.outline.length - 1]] : corners.slice(0, 2);
  const by = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]], length = Math.hypot(by[0], by[1]) || 1;
  return { kind: one.kind, corners, at: (fit && fit.centre) || middle, along: by.map((part) => part / length) };
}

// The origin of the axes, and the direction of x; the camera looks against z, so y is a quarter of a turn to the left of x.
function axes([, second, third]) {
  if (!second) return null;
  const b = placed(second), c = third ? placed(third) : null;
  const towards = (one, other) => { const by = [other[0] - one[0], other[1] - one[1]], length = Math.hypot(by[0], by[1]) || 1; return by.map((part) => part / length); };
  if (b.kind !== "line") return { origin: b.at, x: !c ? [1, 0] : c.kind === "line" ? c.along : towards(b.at, c.at) };
  const from = c ? c.at : b.at, far = (from[0] - b.at[0]) * b.along[0] + (from[1] - b.at[1]) * b.along[1];
  return { origin: b.at.map((part, axis) => part + far * b.along[axis]), x: b.along };
}

function drawAxes(of) {
  const { width, height } = state.recipe.camera, parts = [], svg = $("datum-drawing"), all = [].concat(...of.map((name) => placed(name).corners));
  const [left, top, right, low] = all.length ? [0, 1, 2, 3].map((side) => Math[side < 2 ? "min" : "max"](...all.map((point) => point[side % 2]))) : [0, 0, width, height];
  const reach = Math.max(right - left, low - top) / 4, size = reach / 5;
  svg.setAttribute("viewBox", `${left - reach} ${top - reach} ${right - left + 2 * reach} ${low - top + 2 * reach}`);
  const taken = [];
  // Below what is there already.
  const label = ([u, v], words, kind) => {
    while (taken.some((other) => Math.abs(other[0] - u) < 1.4 * size && Math.abs(other[1] - v) < 1.6 * size)) v += 1.6 * size;
    taken.push([u, v]);
    return draw("text", { x: u, y: v, "font-size": 1.6 * size, class: kind }, words);
  };
  of.forEach((name, at) => {
    const { corners, at: middle } = placed(name);
    parts.push(draw("polygon", { points: corners.map((point) => point.join(",")).join(" "), class: "region", "vector-effect": "non-scaling-stroke" }));
    parts.push(at ? label([middle[0] + size, middle[1] + 2 * size], LETTERS[at], "name") : label([Math.max(...corners.map(([u]) => u)) - 2 * size, Math.max(...corners.map(([, v]) => v)) - size], LETTERS[at], "name"));
  });
  const found = axes(of);
  if (found) {
    const { origin: [u, v], x: [a, b] } = found;
    for (const [word, p, q] of [["x", a, b], ["y", b, -a]]) {
      const [eu, ev] = [u + reach * p, v + reach * q], wing = (turn) => `${eu - size * (p * 0.9 - turn * q * 0.5)} ${ev - size * (q * 0.9 + turn * p * 0.5)}`;
      parts.push(draw("path", { d: `M${u} ${v}L${eu} ${ev}M${wing(1)}L${eu} ${ev}L${wing(-1)}`, class: "axis", "vector-effect": "non-scaling-stroke" }));
      parts.push(label([eu + size * (p + 0.2), ev + size * (q + 0.4)], word, "word"));
    }
    parts.push(draw("circle", { cx: u, cy: v, r: size / 4, class: "origin" }));
  }
  fill(svg, ...parts);
  const whole = of.length > 0 && fits(kindsOf(of), true);
  const words = !of.length ? "A must be a plane: draw one first." : found ? "x and y as drawn, z towards the camera; origin at the dot." : "A gives z and the xy plane; x, y and the origin stay as taught.";
  text("datum-words", whole || !of.length ? words : "These do not make a datum system yet: choose one more.");
  svg.setAttribute("aria-label", `axes of the datum system: ${of.map((name, at) => `${LETTERS[at]} ${name}`).join(", ")}`);
  $("datum-use").disabled = !whole;
}

function close() {
  show("datum", false);
  if (opener && opener.isConnected) opener.focus();
}

// Opens the dialogue for a datum system, or for a new one.
export function openDatum(datum = null) {
  edited = datum;
  opener = document.activeElement;
  const of = datum ? datum.of.slice() : [];
  while (!datum && of.length < LETTERS.length && behind(of).length) of.push(behind(of)[0]);
  $("datum-name").value = datum ? datum.name : free("datum", state.list.datums);
  $("datum-use").textContent = datum ? "Change" : "Create";
  fill($("datum-about"), make("span", "", state.kinds.datums.about));
  offer(of);
  show("datum", true);
  $($("datum-A").disabled ? "datum-cancel" : "datum-A").focus();
}

function use(event) {
  event.preventDefault();
  const of = wanted(), name = $("datum-name").value, { datums, gauges } = state.list;
  alter("", () => {
    if (!edited) { datums.push({ name, of }); return; }
    for (const gauge of gauges) if (gauge.datum === edited.name) gauge.datum = name;
    Object.assign(edited, { name, of });
  });
  close();
}

function keys(event) {
  if (event.key === "Escape") { event.preventDefault(); close(); }
  if (event.key !== "Tab") return;
  const all = Array.from($("datum").querySelectorAll("input, select, button")).filter((one) => !one.disabled);
  const edge = event.shiftKey ? all[0] : all[all.length - 1];
  if (document.activeElement !== edge) return;
  event.preventDefault();
  all[event.shiftKey ? all.length - 1 : 0].focus();
}

export function start() {
  for (const letter of LETTERS) on($(`datum-${letter}`), "change", () => offer(wanted()));
  on($("datum-form"), "submit", use);
  on($("datum-cancel"), "click", close);
  on($("datum"), "keydown", keys);
  on($("datum-add"), "click", () => openDatum());
}
