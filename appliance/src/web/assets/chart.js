// The run chart of a gauge: the mean, the least and the most value of each column, its limits, and what stands out. Its columns are
// chosen by pointer or keys: one opens a result, several become a list.
import { draw, fill } from "./element.js";
import { date, quantity } from "./number.js";
import { round } from "./scale.js";

const HEIGHT = 300, LEFT = 86, RIGHT = 14, TOP = 22, BOTTOM = 30;

// Where something is on the axis, in words.
export function place(axis, x) {
  if (x === null || x === undefined) return "at an unknown time";
  if (axis === "time") return date(x);
  return `${axis === "stroke" ? "stroke" : "no."} ${x}`;
}

function ends(gauge) {
  const values = gauge.columns.flatMap((column) => (column ? [column.least, column.most] : []));
  for (const { low, high, control } of gauge.groups) values.push(...[low, high].filter((limit) => limit !== null), ...(control || []));
  let [low, high] = [Math.min(...values), Math.max(...values)];
  const pad = (high - low || Math.abs(high) || 1) * 0.06;
  return [low - pad, high + pad];
}

// Draws the chart into `svg`, which is `width` pixels wide; answers with where columns are.
export function runChart(svg, width, results, gauge, marks) {
  const { from, to, axis } = results;
  const inner = width - LEFT - RIGHT;
  const [low, high] = ends(gauge);
  const y = (value) => TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low);
  const x = (at) => LEFT + inner * Math.min(1, Math.max(0, (at - from) / (to - from + 1)));
  const step = inner / gauge.columns.length;
  const middle = (at) => LEFT + step * (at + 0.5);
  const put = (name, kind, attributes) => draw(name, { class: kind, ...attributes });
  const line = (kind, x1, x2, y1, y2) => put("line", kind, { x1: x1.toFixed(1), x2: x2.toFixed(1), y1: y1.toFixed(1), y2: y2.toFixed(1) });
  const parts = [];
  const rest = [];
  gauge.groups.forEach((group, at) => {
    if (gauge.starts[at] === null) return;
    const begin = x(gauge.starts[at]);
    const next = gauge.starts[at + 1];
    const end = next === undefined || next === null ? width - RIGHT : x(next);
    if (group.control) {
      const [least, most] = group.control;
      parts.push(put("rect", "control", { x: begin.toFixed(1), width: Math.max(0, end - begin).toFixed(1), y: y(most).toFixed(1), height: (y(least) - y(most)).toFixed(1) }));
    }
    for (const limit of [group.low, group.high]) if (limit !== null) rest.push(line("limit", begin, end, y(limit), y(limit)));
    const { prediction } = group;
    if (prediction && prediction.u !== null) rest.push(line("u", end - 8, end - 8, y(group.mean - prediction.u), y(group.mean + prediction.u)));
    if (at > 0) rest.push(line("change", begin, begin, TOP, HEIGHT - BOTTOM), draw("text", { x: begin + 4, y: TOP - 8 }, "limits changed"));
  });
  for (const version of results.versions) if (version.x !== null) rest.push(line("version", x(version.x), x(version.x), TOP, HEIGHT - BOTTOM));
  let path = "", pen = "M";
  gauge.columns.forEach((column, at) => {
    if (!column) return;
    if (column.least === column.most) parts.push(put("circle", "single", { cx: middle(at).toFixed(1), cy: y(column.mean).toFixed(1), r: 1.8 }));
    parts.push(line("span", middle(at), middle(at), y(column.least), Math.max(y(column.most), y(column.least) - HEIGHT)));
    path += `${pen}${middle(at).toFixed(1)} ${y(column.mean).toFixed(1)}`;
    pen = "L";
  });
  parts.push(put("path", "mean", { d: path }), ...rest);
  // Rings that would cover each other are left out; those beyond 3 σ come first.
  const rings = marks ? marks.columns.filter((mark) => mark.x !== null).sort((a, b) => a.test - b.test) : [];
  const taken = new Set();
  const isFree = ({ x: at, test }) => { const cell = Math.round(x(at) / 8); if (taken.has(cell) || (test > 1 && taken.has(cell - 1))) return false; taken.add(cell); return true; };
  for (const mark of rings.filter(isFree)) parts.push(put("circle", "marked", { cx: x(mark.x).toFixed(1), cy: y(mark.value).toFixed(1), r: 3.4 }));
  const drift = marks && marks.drift;
  if (drift && drift.x !== null) parts.push(line("drift", x(drift.x), x(drift.x), TOP, HEIGHT - BOTTOM), draw("text", { x: x(drift.x) + 4, y: HEIGHT - BOTTOM - 6 }, "drifts from here"));
  const tick = round((high - low) / 5);
  for (let at = Math.ceil(low / tick); at * tick <= high; at += 1) {
    parts.push(line("tick", LEFT - 4, LEFT, y(at * tick), y(at * tick)), draw("text", { x: LEFT - 8, y: y(at * tick) + 4, "text-anchor": "end" }, quantity(at * tick, gauge.unit)));
  }
  const many = Math.max(1, Math.floor(inner / 190));
  for (let at = 0; at <= many; at += 1) {
    const value = Math.round(from + (to - from) * at / many);
    const anchor = at === 0 ? "start" : at === many ? "end" : "middle";
    parts.push(line("tick", x(value), x(value), HEIGHT - BOTTOM, HEIGHT - BOTTOM + 4), draw("text", { x: x(value), y: HEIGHT - 8, "text-anchor": anchor }, place(axis, value)));
  }
  parts.push(put("rect", "frame-line", { x: LEFT, y: TOP, width: inner, height: HEIGHT - TOP - BOTTOM }), put("rect", "cursor", { x: 0, y: TOP, width: 0, height: HEIGHT - TOP - BOTTOM }));
  svg.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
  fill(svg, ...parts);
  return { step, left: LEFT, y };
}

// How values are distributed, with the limits of the last group.
export function histogram(svg, { histogram: bars, unit }, group) {
  const width = 320, height = 140, top = 6, bottom = 22;
  if (!bars) { fill(svg); return; }
  const { low, step, counts } = bars;
  const most = Math.max(...counts);
  // Values that are all equal have one bar.
  const wide = step > 0 ? step * counts.length : Math.abs(low) || 1;
  const x = (value) => 8 + (width - 16) * Math.min(1, Math.max(0, (value - low) / wide));
  const parts = counts.map((count, at) => draw("rect", {
    class: "bar", x: x(low + at * wide / counts.length).toFixed(1), width: ((width - 16) / counts.length - 0.6).toFixed(2),
    y: (height - bottom - (height - top - bottom) * count / most).toFixed(1), height: ((height - top - bottom) * count / most).toFixed(1),
  }));
  for (const limit of [group.low, group.high]) {
    if (limit !== null && limit >= low && limit <= low + wide) parts.push(draw("line", { class: "limit", x1: x(limit), x2: x(limit), y1: top, y2: height - bottom }));
  }
  parts.push(draw("text", { x: 8, y: height - 6 }, quantity(low, unit)), draw("text", { x: width - 8, y: height - 6, "text-anchor": "end" }, quantity(low + wide, unit)));
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("aria-label", `histogram from ${quantity(low, unit)} to ${quantity(low + wide, unit)}`);
  fill(svg, ...parts);
}

// Shares of FAIL (solid) and INVALID (hollow) in each column.
export function yieldChart(svg, { columns }) {
  const height = 60, width = 720;
  const shares = columns.map(([pass, fail, invalid]) => { const all = Math.max(1, pass + fail + invalid); return [fail / all, invalid / all]; });
  const most = Math.max(0.05, ...shares.map(([fail, invalid]) => fail + invalid));
  const step = width / columns.length;
  const bar = (kind, at, from, share) => draw("rect", { class: kind, x: (step * at).toFixed(2), width: Math.max(0.4, step - 0.6).toFixed(2), y: (height - (height - 2) * (from + share) / most).toFixed(2), height: ((height - 2) * share / most).toFixed(2) });
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("aria-label", `share of FAIL and INVALID over the period, up to ${(100 * most).toFixed(1)} %`);
  fill(svg, ...shares.flatMap(([fail, invalid], at) => [...(fail ? [bar("fail", at, 0, fail)] : []), ...(invalid ? [bar("invalid", at, fail, invalid)] : [])]));
  return most;
}
