// The scale beside a map.
import { draw, fill } from "./element.js";
import { colours } from "./colour.js";
import { signed } from "./number.js";

// The smallest of 1, 2, 5 × 10ⁿ that is at least `least`.
export function round(least) {
  const decade = Math.pow(10, Math.floor(Math.log10(least)));
  return [1, 2, 5, 10].map((factor) => factor * decade).find((step) => step >= least * 0.999999);
}

// Draws what the colours of a map mean.
export function drawScale(svg, about, layer) {
  const { scale: [low, high], unit } = about;
  const top = 24, bottom = 290, left = 2, wide = 14;
  const parts = [draw("text", { x: left, y: 14 }, unit)];
  const palette = colours(layer), count = 64;
  for (let at = 0; at < count; at += 1) {
    const y = bottom - (bottom - top) * (at + 1) / count;
    const colour = palette[Math.round(at * 255 / (count - 1))];
    parts.push(draw("rect", { x: left, y: y.toFixed(2), width: wide, height: ((bottom - top) / count + 0.5).toFixed(2), fill: `rgb(${colour.join(",")})` }));
  }
  const span = high - low;
  const gauge = about.shown && about.shown.gauge;
  for (const limit of gauge ? [gauge.low, gauge.high] : []) {
    if (limit === null || limit < low || limit > high) continue;
    const y = bottom - (bottom - top) * (limit - low) / span;
    parts.push(draw("line", { x1: left - 2, x2: left + wide + 4, y1: y, y2: y, class: "limit" }));
  }
  if (span > 0) {
    const step = round(span / 5);
    const places = Math.max(0, -Math.floor(Math.log10(step)));
    for (let tick = Math.ceil(low / step); tick * step <= high; tick += 1) {
      const y = bottom - (bottom - top) * (tick * step - low) / span;
      parts.push(draw("line", { x1: left + wide, x2: left + wide + 4, y1: y, y2: y }));
      parts.push(draw("text", { x: left + wide + 7, y: y + 4 }, signed(tick * step + 0, places).replace(/^\u2212(0(\.0*)?)$/, "$1")));
    }
  }
  fill(svg, ...parts);
}
