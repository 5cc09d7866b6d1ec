// Rings around the squares that the values of gauges are of.
import { draw, fill } from "./element.js";

// The circles of a ring about a square; a quiet one where the gauge passed.
function ring({ column, row, side }, { width, stride }, quiet) {
  const place = { cx: column + 0.5, cy: row + 0.5, r: Math.max(0.9 * side, width * stride / 18), "vector-effect": "non-scaling-stroke" };
  return (quiet ? ["most"] : ["most", "most over"]).map((kind) => draw("circle", Object.assign({ class: kind }, place)));
}

// Rings for a map: about the squares that failed; where none did, a quiet one about the square of the gauge that a map of deviations is of.
export function rings(about, failed) {
  if (failed.length) return failed.flatMap((square) => ring(square, about, false));
  const square = about.shown && about.shown.gauge && about.shown.gauge.square;
  return square ? ring(square, about, true) : [];
}

// Replaces an overlay, whose units are pixels of the camera.
export function over(svg, { width, height, stride }, ...parts) {
  svg.setAttribute("viewBox", `0 0 ${width * stride} ${height * stride}`);
  fill(svg, ...parts);
}
