// What was found of features: contours with the pieces that were accepted and refused, drawn over a picture, and the profile of a section.
import { draw } from "./element.js";
import { signed } from "./number.js";

const path = (kind, d) => draw("path", { d, class: kind, "vector-effect": "non-scaling-stroke" });
const at = ([u, v]) => `${(u + 0.5).toFixed(1)} ${(v + 0.5).toFixed(1)}`;

// The nodes of all features for an overlay whose units are pixels of the camera; a cross reaches `arm` of them to each side. Pieces
// of a kind are one node, so that thousands of them stay quick.
export function marks(features, arm) {
  const seen = [], lost = [], fits = [], centres = [];
  const cross = ([u, v]) => `M${at([u - arm, v - arm])}l${2 * arm} ${2 * arm}m0 ${-2 * arm}l${-2 * arm} ${2 * arm}`;
  for (const { fit, pieces } of features) {
    for (const piece of pieces || []) (piece.accepted ? seen : lost).push(piece.at);
    if (!fit || !pieces || !pieces.length) continue;
    fits.push(`M${fit.outline.map(at).join("L")}${fit.closed ? "Z" : ""}`);
    if (fit.closed) centres.push(`M${at([fit.centre[0] - arm, fit.centre[1]])}h${2 * arm}m${-arm} ${-arm}v${2 * arm}`);
  }
  const dots = seen.map((one) => `M${at(one)}h0`).join(""), crosses = lost.map(cross).join("");
  return [path("fit", fits.join("") + centres.join("")), path("lost shade", crosses), path("lost", crosses), path("seen shade", dots), path("seen", dots)];
}

// The profile of a section: points, both lines and circles, and between which points gap and flush are measured. s and z have one scale.
export function profile({ points, lines, circles, extremes, tangents, gap, flush }) {
  const s = points.map(([along]) => along), z = points.map(([, height]) => height);
  const [left, low] = [Math.min(...s), Math.min(...z)], wide = Math.max(...s) - left || 1, high = Math.max(...z) - low, edge = wide / 40;
  const place = ([along, height]) => `${(along - left).toFixed(3)} ${(low + high - height).toFixed(3)}`;
  const polyline = (kind, all) => path(kind, `M${all.map(place).join("L")}`);
  const parts = [path("points", points.map((point) => `M${place(point)}h0`).join(""))];
  for (const line of lines || []) parts.push(polyline("fit", line));
  for (const { centre, radius } of circles || []) {
    parts.push(draw("circle", { cx: centre[0] - left, cy: low + high - centre[1], r: radius, class: "fit", "vector-effect": "non-scaling-stroke" }));
  }
  for (const [kind, pair] of [["gap", extremes], ["flush", tangents]]) if (pair) parts.push(polyline(kind, pair));
  const words = gap === null ? "gap and flush are not found" : `gap ${signed(gap, 3)} mm, flush ${signed(flush, 3)} mm`;
  return draw("svg", { viewBox: `${-edge} ${-edge} ${wide + 2 * edge} ${high + 2 * edge}`, class: "profile", role: "img", "aria-label": `profile of the section: ${words}` }, ...parts);
}
