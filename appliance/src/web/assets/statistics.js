// Statistics of a recipe over a period: results and yield, the figures of each gauge, and the run chart of one.
import { $, button, fill, heading, label, make, on, show, text } from "./element.js";
import { lines } from "./api.js";
import { histogram, place, runChart, yieldChart } from "./chart.js";
import { listRange, showResult } from "./history.js";
import { count, limits, quantity } from "./number.js";
import { trend } from "./trend.js";

// Statistics that are looked at are worked out again at most so often, and are idle for so many times as long as they take.
const AGAIN_MS = 60000, IDLE = 100;
const TESTS = { 1: "beyond 3 σ", 2: "nine on one side" };
const state = { visible: false, turns: { all: 0, one: 0 }, timer: 0, recipe: "", results: null, gauges: new Map(), detail: null, slot: null, scale: null, cursor: 0, end: 0, paper: 0 };

// The beginning of the period that is chosen, by this device's time zone; a day of 23 hours begins at its midnight as others do.
function began(period) {
  const now = new Date();
  const midnight = new Date(now.getFullYear(), now.getMonth(), now.getDate());
  if (period === "day") return midnight;
  if (period === "week") return new Date(now.getFullYear(), now.getMonth(), now.getDate() - (now.getDay() + 6) % 7);
  const starts = $("statistics-shifts").value.split(/[\s,]+/).filter(Boolean).map((hour) => hour.split(":").map(Number));
  const today = [-1, 0].flatMap((day) => starts.map(([hour, minute = 0]) => new Date(now.getFullYear(), now.getMonth(), now.getDate() + day, hour, minute)));
  const begun = today.filter((start) => start <= now);
  return begun.length ? new Date(Math.max(...begun)) : midnight;
}

function wanted() {
  const query = new URLSearchParams({ recipe: $("statistics-recipe").value, axis: $("statistics-axis").value });
  const period = $("statistics-period").value;
  if (period === "teach") query.set("period", "teach");
  else if (period === "range") {
    if ($("statistics-from").value) query.set("since_us", 1000 * new Date($("statistics-from").value).getTime());
    if ($("statistics-to").value) query.set("until_us", 1000 * new Date($("statistics-to").value).getTime());
  } else if (period !== "all") query.set("since_us", 1000 * began(period).getTime());
  return query;
}

function opened(mark, more = "") {
  const made = button(`no. ${mark.seq}`, "open", () => showResult(mark.seq));
  const cell = make("td", "nowrap", label(made, `show no. ${mark.seq}`));
  if (state.results.axis !== "result") cell.append(make("small", "", place(state.results.axis, mark.x)));
  if (more) cell.append(make("small", "", more));
  return cell;
}

const figure = (value) => (value ? value.value.toFixed(2) : "–");
const interval = (value) => (value ? `${value.from.toFixed(2)} … ${value.to.toFixed(2)}` : "");

function row({ gauge, marks }) {
  const last = gauge.groups[gauge.groups.length - 1];
  const name = button(gauge.name, "plain", () => choose(gauge.slot));
  name.setAttribute("aria-pressed", gauge.slot === state.slot);
  const head = heading("row", name);
  if (!last) return make("tr", "", head, ...Array.from({ length: 7 }, (_, column) => make("td", "", column ? "" : "no values")));
  const known = gauge.columns.filter(Boolean), every = Math.ceil(known.length / 100);
  const means = known.filter((_, column) => column % every === 0).map(({ mean: value }) => ({ value, pass: true }));
  const chart = trend(means, { unit: gauge.unit, lowest: last.low, highest: last.high });
  const cpk = make("td", "nowrap", figure(last.cpk), make("small", "", interval(last.cpk)));
  const mean = make("td", "nowrap", quantity(last.mean, gauge.unit, 1));
  const n = make("td", "", count(last.n));
  if (gauge.groups.length > 1) n.append(make("small", "", `last of ${gauge.groups.length} groups`));
  const drifted = marks && marks.drift;
  return make("tr", "", head, make("td", "trend-cell", chart), n, mean, make("td", "nowrap", last.s === null ? "–" : quantity(last.s, gauge.unit, 1)), cpk,
    marks && marks.first ? opened(marks.first, `first of ${count(marks.marks)}`) : make("td", "", marks ? "none" : "…"),
    drifted ? opened(drifted, "drifts from here") : make("td", "", marks ? "no drift" : "…"));
}

function words() {
  const { counts: { pass, fail, invalid }, of_studies, undated, off_axis, reasons, axis } = state.results;
  const all = pass + fail + invalid;
  const share = (number) => `${count(number)} (${(100 * number / Math.max(1, all)).toFixed(1)} %)`;
  const notes = [all ? `${count(all)} results: ${share(pass)} PASS, ${share(fail)} FAIL, ${share(invalid)} INVALID` : "no results in this period"];
  if (of_studies) notes.push(`${count(of_studies)} of guided studies left out`);
  if (undated) notes.push(`${count(undated)} left out because their time is not known: choose “all results”`);
  if (off_axis) notes.push(`${count(off_axis)} counted, but at an unknown ${axis}: choose the axis “result number” to see them`);
  text("statistics-words", notes.join(" · "));
  fill($("statistics-reasons"), ...reasons.map(({ reason, n }) => make("li", "", make("b", "", count(n)), ` ${reason || "without a reason"}`)));
  show("statistics-invalid", reasons.length > 0);
  show("statistics-yield", all > 0);
  text("statistics-most", `up to ${(100 * yieldChart($("yield-chart"), state.results)).toFixed(1)} % of a column`);
}

function rows() {
  const gauges = [...state.gauges.values()];
  fill($("statistics-rows"), ...gauges.map(row));
  show("statistics-list", gauges.length > 0);
}

// Takes the parts of an answer about `all` gauges or `one`, while nothing else was asked for; answers whether all of them came.
async function parts(kind, query, take) {
  const turn = (state.turns[kind] += 1);
  text("statistics-progress", "working them out");
  await lines(`api/statistics?${query}`, (part) => {
    if (turn !== state.turns[kind]) return false;
    if (part.part === "error") throw new Error(part.error);
    if (part.part === "progress") text("statistics-progress", `working them out, ${Math.round(100 * part.done)} %`);
    else take(part);
    return true;
  });
  if (turn === state.turns[kind]) text("statistics-progress", `as of ${new Date().toLocaleTimeString("en-GB")}`);
  return turn === state.turns[kind];
}

const keyOf = ({ slot, name, unit }) => `${slot}/${name}/${unit}`;

async function load() {
  clearTimeout(state.timer);
  if (!$("statistics-form").reportValidity() || !$("statistics-recipe").value) return;
  const began = Date.now();
  try {
    const found = new Map();
    const all = await parts("all", wanted(), (part) => {
      if (part.part === "results") { state.results = part; words(); }
      if (part.part === "gauge") found.set(keyOf(part), { gauge: part, marks: null });
      if (part.part === "marks") found.get(keyOf(part)).marks = part;
      if (part.part !== "results") { state.gauges = found; rows(); }
    });
    if (!all) return;
    const { counts: { pass, fail, invalid }, undated, off_axis } = state.results;
    const dated = pass + fail + invalid - off_axis;
    if (!dated && (undated || off_axis) && $("statistics-axis").value === "time") {
      // A device whose clock was never synchronised knows the order of its results.
      $("statistics-period").value = "all";
      $("statistics-axis").value = "result";
      await load();
      return;
    }
    state.gauges = found;
    rows();
    if (state.slot !== null) await detail();
  } catch (error) { text("statistics-progress", error.message); }
  const again = () => { if (state.visible && !document.hidden) load(); else state.timer = setTimeout(again, AGAIN_MS); };
  state.timer = setTimeout(again, Math.max(AGAIN_MS, IDLE * (Date.now() - began)));
}

function chartWidth() { return state.paper || Math.max(320, Math.round($("chart-place").clientWidth)); }

async function choose(slot) {
  state.slot = slot;
  rows();
  show("chart-card", true);
  try { await detail(); } catch (error) { text("statistics-progress", error.message); }
  $("chart-card").scrollIntoView({ block: "nearest" });
}

// The chosen gauge, with a column for each two pixels.
async function detail() {
  const query = wanted();
  query.set("slot", state.slot);
  query.set("columns", Math.min(1000, Math.floor(chartWidth() / 2)));
  const found = { gauge: null, marks: null, results: null };
  const all = await parts("one", query, (part) => {
    if (part.part !== "end") found[part.part === "results" ? "results" : part.part] = part;
  });
  if (!all) return;
  show("chart-card", found.gauge && found.gauge.groups.length);
  if (!found.gauge || !found.gauge.groups.length) return;
  const before = state.detail;
  state.detail = found;
  if (!before || before.gauge.slot !== found.gauge.slot || before.gauge.columns.length !== found.gauge.columns.length) state.cursor = state.end = found.gauge.columns.length - 1;
  drawDetail();
}

function groupRow(group, unit) {
  const cells = [`no. ${group.first} to ${group.last}`, limits(group.low, group.high, unit), count(group.n), quantity(group.mean, unit, 1), group.s === null ? "–" : quantity(group.s, unit, 1)];
  const both = [group.pp, group.ppk, group.cp, group.cpk].map((value) => make("td", "nowrap", figure(value), make("small", "", interval(value))));
  const u = group.prediction && group.prediction.u !== null ? quantity(group.prediction.u, unit, 1) : "–";
  return make("tr", "", ...cells.map((cell) => make("td", "nowrap", cell)), ...both, make("td", "nowrap", u));
}

function drawDetail() {
  const { gauge, marks, results } = state.detail;
  text("chart-title", gauge.name);
  state.scale = runChart($("run-chart"), chartWidth(), results, gauge, marks);
  histogram($("gauge-histogram"), marks, gauge.groups[gauge.groups.length - 1]);
  fill($("group-rows"), ...gauge.groups.map((group) => groupRow(group, gauge.unit)));
  const { invalid, not_measured, of_studies } = gauge.left_out;
  text("chart-left-out", `left out: ${count(invalid)} INVALID, ${count(not_measured)} not measured, ${count(of_studies)} of studies`);
  cursor();
}

// Marks the chosen columns, and says what is there.
function cursor() {
  const { gauge, marks, results } = state.detail;
  const [first, last] = [Math.min(state.cursor, state.end), Math.max(state.cursor, state.end)];
  const box = $("run-chart").querySelector(".cursor");
  box.setAttribute("x", (state.scale.left + state.scale.step * first).toFixed(1));
  box.setAttribute("width", Math.max(2, state.scale.step * (last - first + 1)).toFixed(1));
  const column = gauge.columns[state.cursor];
  const values = first === last ? column && `${count(column.n)} values, ${quantity(column.least, gauge.unit)} to ${quantity(column.most, gauge.unit)}, mean ${quantity(column.mean, gauge.unit, 1)}` : `${last - first + 1} columns`;
  const [from, to] = range(first, last);
  const mark = marks && marks.columns.find(({ x }) => x !== null && x >= from && x <= to);
  text("chart-cursor", `${place(results.axis, from)} to ${place(results.axis, to)}: ${values || "no values"}${mark ? ` · no. ${mark.seq} ${TESTS[mark.test]}` : ""}`);
  $("chart-open").disabled = first !== last || !column;
}

function range(first, last) {
  const { from, to } = state.detail.results;
  const wide = (to - from + 1) / state.detail.gauge.columns.length;
  return [Math.round(from + wide * first), Math.round(from + wide * (last + 1)) - 1];
}

// The value of a column that is farther from the mean, or nearer to where was pointed at.
function openColumn(pointed) {
  const { gauge } = state.detail;
  const column = gauge.columns[state.cursor];
  if (!column) return;
  const { mean } = gauge.groups[gauge.groups.length - 1];
  const upper = pointed === undefined ? column.most - mean > mean - column.least : Math.abs(pointed - state.scale.y(column.most)) < Math.abs(pointed - state.scale.y(column.least));
  showResult(column.at[upper ? 1 : 0]);
}

function openRange() {
  const [from, to] = range(Math.min(state.cursor, state.end), Math.max(state.cursor, state.end));
  const { axis } = state.detail.results;
  const keys = { time: { since_us: from, until_us: to + 1 }, stroke: { from_stroke: from, to_stroke: to }, result: { from_seq: from, to_seq: to } };
  listRange($("statistics-recipe").value, keys[axis], `${place(axis, from)} to ${place(axis, to)}`);
}

function move(columns, extend) {
  const most = state.detail.gauge.columns.length - 1;
  state.cursor = Math.min(most, Math.max(0, state.cursor + columns));
  if (!extend) state.end = state.cursor;
  cursor();
}

function keys(event) {
  const by = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10, Home: -1000, End: 1000 }[event.key];
  if (by) { event.preventDefault(); move(by, event.shiftKey); }
  if (event.key === "Enter") { event.preventDefault(); if (state.cursor === state.end) openColumn(); else openRange(); }
}

function pointer(svg) {
  let began = null;
  const column = (event) => {
    const box = svg.getBoundingClientRect();
    const x = (event.clientX - box.left) * chartWidth() / box.width;
    return Math.min(state.detail.gauge.columns.length - 1, Math.max(0, Math.floor((x - state.scale.left) / state.scale.step)));
  };
  svg.addEventListener("pointerdown", (event) => { began = state.cursor = state.end = column(event); svg.setPointerCapture(event.pointerId); cursor(); });
  svg.addEventListener("pointermove", (event) => { if (began !== null) { state.cursor = column(event); cursor(); } });
  svg.addEventListener("pointercancel", () => { began = null; });
  svg.addEventListener("pointerup", (event) => {
    if (began === null) return;
    began = null;
    const box = svg.getBoundingClientRect();
    if (state.cursor === state.end) openColumn((event.clientY - box.top) * chartWidth() / box.width);
  });
}

// Draws the chart for paper of a width, or again for the screen.
export function drawFor(paper) {
  state.paper = paper;
  if (state.detail && !$("chart-card").hidden) drawDetail();
}

// What a report says of the period.
export function period() {
  const { from, to, axis } = state.results || {};
  return { recipe: $("statistics-recipe").value, words: `${$("statistics-period").selectedOptions[0].textContent}: ${place(axis, from)} to ${place(axis, to)}` };
}

export function openStatistics(visible, now) {
  state.visible = visible;
  if (!visible) { state.turns.all += 1; state.turns.one += 1; clearTimeout(state.timer); return; }
  const active = now.recipe ? String(now.recipe.number) : "";
  if (!$("statistics-recipe").value || $("statistics-recipe").value === state.recipe) $("statistics-recipe").value = active;
  state.recipe = active;
  load();
}

export function start() {
  const shifts = $("statistics-shifts");
  shifts.value = localStorage.getItem("shifts") || shifts.value;
  const fields = () => {
    show("statistics-range", $("statistics-period").value === "range");
    show("statistics-shift", $("statistics-period").value === "shift");
  };
  on($("statistics-form"), "submit", () => { localStorage.setItem("shifts", shifts.value); load(); });
  for (const id of ["statistics-period", "statistics-axis"]) on($(id), "change", () => { fields(); if ($(id).value !== "range") load(); });
  on($("run-chart"), "keydown", keys);
  pointer($("run-chart"));
  on($("chart-open"), "click", () => openColumn());
  on($("chart-range"), "click", openRange);
  on($("chart-close"), "click", () => { state.slot = null; rows(); show("chart-card", false); });
  let width = 0;
  on(window, "resize", () => {
    if (state.detail && !$("chart-card").hidden && chartWidth() !== width) { width = chartWidth(); drawDetail(); }
  });
}
