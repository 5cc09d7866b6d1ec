// The last values of a gauge as a small chart: its limits as lines, values outside of them as marks.
import { draw } from "./element.js";
import { quantity } from "./number.js";

const WIDTH = 132, HEIGHT = 36, EDGE = 4;

export function trend(points, gauge) {
  const chart = draw("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "trend", role: "img", preserveAspectRatio: "xMinYMid meet" });
  const known = points.filter((point) => point.value !== null);
  if (!known.length) { chart.setAttribute("aria-label", "no values yet"); return chart; }
  const values = known.map((point) => point.value);
  const least = Math.min(...values), most = Math.max(...values);
  chart.setAttribute("aria-label", `last ${known.length} values: ${quantity(least, gauge.unit)} to ${quantity(most, gauge.unit)}`);
  const ends = values.concat([gauge.lowest, gauge.highest].filter((limit) => limit !== null));
  let low = Math.min(...ends), high = Math.max(...ends);
  const pad = (high - low || Math.abs(high) || 1) * 0.08;
  low -= pad;
  high += pad;
  const y = (value) => (HEIGHT - EDGE - (HEIGHT - 2 * EDGE) * (value - low) / (high - low)).toFixed(1);
  // The newest value stands at the right edge.
  const step = (WIDTH - 2 * EDGE) / 99;
  const x = (at) => (WIDTH - EDGE - step * (points.length - 1 - at)).toFixed(1);
  for (const limit of [gauge.lowest, gauge.highest]) {
    if (limit !== null) chart.append(draw("line", { x1: EDGE, x2: WIDTH - EDGE, y1: y(limit), y2: y(limit), class: "limit" }));
  }
  let path = "", pen = "M";
  points.forEach((point, at) => {
    if (point.value === null) { pen = "M"; return; }
    path += `${pen}${x(at)} ${y(point.value)}`;
    pen = "L";
  });
  chart.append(draw("path", { d: path, class: "line" }));
  points.forEach((point, at) => {
    const last = at === points.length - 1;
    if (point.value === null || (point.pass && !last)) return;
    chart.append(draw("circle", { cx: x(at), cy: y(point.value), r: last ? 3 : 2.2, class: point.pass ? "last" : "out" }));
  });
  return chart;
}
