// Shapes of features on the picture of golden, in camera pixels: made by touches, moved, and told apart. Pure functions.
import { cornersOf } from "./api.js";

// A region reaches so far beyond what it must around a contour; a section is so wide, mm.
const BEYOND_MM = 1;
const WIDTH_MM = 5;
// Corners of a circle, and how much their distances from the centre may differ, as a share.
const ROUND = 16;
const UNEVEN = 0.06;
// Share of a section's length that is taken to be flat at both ends: its joint need not be in the middle.
const FLAT = 0.25;

const far = ([u0, v0], [u1, v1]) => Math.hypot(u1 - u0, v1 - v0);
const tenth = (value) => Math.round(10 * value) / 10;
const middle = (corners) => [0, 1].map((axis) => corners.reduce((sum, point) => sum + point[axis], 0) / corners.length);

function ring([u, v], radius) {
  return Array.from({ length: ROUND }, (_, at) => {
    const turn = 2 * Math.PI * at / ROUND;
    return [tenth(u + radius * Math.cos(turn)), tenth(v + radius * Math.sin(turn))];
  });
}

// How many touches make a shape; 0: as many as somebody likes.
export const touches = (shape) => (shape === "polygon" ? 0 : 2);

// What a shape's touches make of a feature; `mm` is the size of a pixel, `around` what a region needs around the contour, mm.
export function drawn(shape, points, mm, around) {
  const [from, to] = points, length = far(from, to), beyond = (around + BEYOND_MM) / mm;
  const round = (all) => all.map((point) => point.map(tenth));
  if (shape === "circle") return { region: ring(from, length + beyond) };
  if (shape === "rectangle") return { region: round([from, [to[0], from[1]], to, [from[0], to[1]]]) };
  if (shape === "section") {
    const all = tenth(length * mm), flat = tenth(FLAT * length * mm);
    return { from: from.map(tenth), to: to.map(tenth), width_mm: WIDTH_MM, left: [0, flat], right: [tenth(all - flat), all] };
  }
  if (shape !== "points") return { region: round(points) };
  const side = [(to[1] - from[1]) / length, (from[0] - to[0]) / length].map((part) => part * beyond);
  const beside = ([u, v], by) => [u + by * side[0], v + by * side[1]];
  return { region: round([beside(from, 1), beside(to, 1), beside(to, -1), beside(from, -1)]) };
}

// Centre and radius of a region that is a circle, else null.
export function circle(shape, region) {
  if (shape !== "circle" || !region || region.length < 8) return null;
  const centre = middle(region), all = region.map((point) => far(centre, point));
  const radius = all.reduce((sum, one) => sum + one, 0) / all.length;
  return all.every((one) => Math.abs(one - radius) < UNEVEN * radius) ? { centre, radius } : null;
}

// The outline of a feature; of a section the stripe that it is.
export function outline(feature, mm) {
  if (feature.region) return feature.region;
  const { from, to, width_mm: wide } = feature, length = far(from, to) || 1;
  const [u, v] = [to[1] - from[1], from[0] - to[0]].map((part) => part / length * wide / mm / 2);
  return [[from, 1], [to, 1], [to, -1], [from, -1]].map(([at, by]) => [at[0] + by * u, at[1] + by * v]);
}

// The points by which a feature is changed: its corners, one on the rim of a circle, the ends of a section.
export function corners(shape, feature) {
  const round = circle(shape, feature.region);
  return round ? [[round.centre[0] + round.radius, round.centre[1]]] : cornersOf(feature);
}

const bounded = ({ width, height }, [u, v]) => [[u, width], [v, height]].map(([at, most]) => tenth(Math.min(most - 0.5, Math.max(-0.5, at))));

// Puts a corner, or what stands for it, elsewhere; all of a feature by `by` if there is no corner.
export function move(shape, feature, was, corner, by, camera) {
  const round = circle(shape, was.region);
  if (corner < 0) {
    const all = cornersOf(was);
    // The whole stays inside the picture.
    const within = [0, 1].map((axis) => {
      const at = all.map((point) => point[axis]), most = axis ? camera.height : camera.width;
      return Math.min(most - 0.5 - Math.max(...at), Math.max(-0.5 - Math.min(...at), by[axis]));
    });
    const put = (point) => point.map((value, axis) => tenth(value + within[axis]));
    if (was.region) feature.region = was.region.map(put);
    else Object.assign(feature, { from: put(was.from), to: put(was.to) });
  } else if (round) {
    const to = [round.centre[0] + round.radius + by[0], round.centre[1] + by[1]];
    feature.region = ring(round.centre, Math.max(3, far(round.centre, to)));
  } else {
    const at = cornersOf(was)[corner], to = bounded(camera, [at[0] + by[0], at[1] + by[1]]);
    if (was.region) feature.region[corner] = to;
    else feature[corner ? "to" : "from"] = to;
  }
}

// Whether a point lies inside a polygon: then an odd number of edges lies on one side of it.
export function inside(polygon, [u, v]) {
  let within = false;
  polygon.forEach(([u1, v1], at) => {
    const [u0, v0] = polygon[(at || polygon.length) - 1];
    if ((v1 > v) !== (v0 > v) && u < u1 + (u0 - u1) * (v - v1) / (v0 - v1)) within = !within;
  });
  return within;
}

export function area(polygon) {
  return Math.abs(polygon.reduce((sum, [u, v], at) => {
    const [u0, v0] = polygon[(at || polygon.length) - 1];
    return sum + u0 * v - u * v0;
  }, 0)) / 2;
}

// Outside of an outline, far enough that grips of so many pixels overlap neither each other nor the inside of a small outline.
export function outside(points, at, all, { target, grip }) {
  const centre = all.length > 2 ? middle(all) : points.length > 1 ? middle(points) : [points[at][0] - 1, points[at][1]];
  const by = [0, 1].map((axis) => points[at][axis] - centre[axis]), reach = Math.hypot(by[0], by[1]) || 1;
  // Squares of this side around a circle, evenly spread, touch each other at this radius.
  const least = points.length > 1 ? target * Math.SQRT1_2 / Math.sin(Math.PI / points.length) : target;
  const wanted = Math.max(reach + grip, least);
  return [0, 1].map((axis) => centre[axis] + 0.5 + by[axis] / reach * wanted);
}

// The name of the smallest of some features of which at least half of a region lies in; else of the one with most of it. A strip along
// an edge may lie beside all of them: then what counts is where one reaches that is three times as wide. Null if there is none.
export function around(region, features) {
  const centre = middle(region), sides = region.map((point, at) => middle([point, region[(at + 1) % region.length]]));
  const wide = sides.map((point) => point.map((value, axis) => centre[axis] + 3 * (value - centre[axis])));
  for (const points of [region, wide]) {
    const share = (one) => Math.min(0.5, points.filter((point) => inside(one.region, point)).length / points.length);
    const sorted = features.map((one) => [share(one), area(one.region), one.name]).filter(([found]) => found > 0);
    sorted.sort((one, other) => other[0] - one[0] || one[1] - other[1]);
    if (sorted.length) return sorted[0][2];
  }
  return null;
}
