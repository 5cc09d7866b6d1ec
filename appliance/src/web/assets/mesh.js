// Triangles of a part's heights, and lines on them.
import { draw } from "./element.js";

// A triangle lies across a jump if its z differ by more than so many distances of neighbours.
const JUMP = 3;
// The word for "no value".
const NONE = 65535;
// How far around a line heights are sought, in their distances.
const FAR = [1.5, 5, 12];

// The heights of an answer: words for x, y and z, and what they are in mm.
export function heightsOf({ about: { width, height, stride, planes }, buffer }) {
  const [low, mm] = ["low", "step"].map((key) => planes.slice(0, 3).map((plane) => plane[key]));
  return { width, height, stride, low, mm, words: new Uint16Array(buffer, 0, 3 * width * height) };
}

function placeOf({ words, low, mm, width, height }, at) {
  return low.map((least, axis) => least + mm[axis] * words[axis * width * height + at]);
}

// From a point to the one `by` words further, in mm in the plane: medians.
function neighbour(heights, by) {
  const { words, width, height } = heights, size = width * height, found = [];
  for (let at = 0; at + by < size; at += Math.ceil(size / 5000)) {
    if (words[2 * size + at] === NONE || words[2 * size + at + by] === NONE) continue;
    const from = placeOf(heights, at);
    found.push(placeOf(heights, at + by).map((mm, axis) => mm - from[axis]));
  }
  return [0, 1].map((axis) => found.map((one) => one[axis]).sort((a, b) => a - b)[found.length >> 1] || 0);
}

// The triangles between known heights that do not jump; middle and radius of what they cover, in mm; and the ways to the next point of a row
// (`right`) and to the next row (`down`).
export function meshOf(heights) {
  const { words, low, mm, width, height } = heights, size = width * height, z = words.subarray(2 * size);
  const right = neighbour(heights, 1), down = neighbour(heights, width);
  const most = JUMP * Math.hypot(...right) / mm[2];
  const corners = new Uint32Array(6 * size);
  let count = 0;
  const add = (a, b, c) => {
    const high = Math.max(z[a], z[b], z[c]);
    if (high === NONE || high - Math.min(z[a], z[b], z[c]) > most) return;
    corners[count] = a;
    corners[count + 1] = b;
    corners[count + 2] = c;
    count += 3;
  };
  for (let a = 0; a < size - width; a += 1) {
    if (a % width === width - 1) continue;
    const b = a + 1, c = a + width, d = c + 1;
    // The other diagonal where a corner of this one is missing.
    if (z[b] === NONE || z[c] === NONE) { add(a, c, d); add(a, d, b); } else { add(a, c, b); add(b, c, d); }
  }
  const triangles = corners.slice(0, count);
  const ends = low.map((from, axis) => {
    const along = words.subarray(axis * size);
    let least = NONE, largest = 0;
    for (const at of triangles) {
      least = Math.min(least, along[at]);
      largest = Math.max(largest, along[at]);
    }
    return [from + mm[axis] * least, from + mm[axis] * largest];
  });
  const radius = Math.hypot(...ends.map(([from, to]) => (to - from) / 2)) || 1;
  return { triangles, right, down, radius, middle: ends.map(([from, to]) => (from + to) / 2) };
}

// The place of a pixel, beside the closest heights; null if those are far. At an edge it lies on the upper side, whose rim the camera sees.
function onto(heights, { right, down }, u, v) {
  const { width, height, stride, words } = heights, column = u / stride, row = v / stride;
  let best = -1, high = -1;
  for (const far of FAR) {
    for (let y = Math.max(0, Math.ceil(row - far)); y <= Math.min(height - 1, row + far); y += 1) {
      for (let x = Math.max(0, Math.ceil(column - far)); x <= Math.min(width - 1, column + far); x += 1) {
        const z = words[(2 * height + y) * width + x];
        if (z !== NONE && z > high) { high = z; best = y * width + x; }
      }
    }
    if (best >= 0) break;
  }
  if (best < 0) return null;
  const [x, y, z] = placeOf(heights, best), over = column - best % width, below = row - Math.floor(best / width);
  return [x + over * right[0] + below * down[0], y + over * right[1] + below * down[1], z];
}

// What is drawn over a picture, as pieces of lines on the surface: both ends in mm, colour with opacity, width in pixels of the screen.
export function linesOn(heights, mesh, frame) {
  const pieces = [], most = heights.stride / 2;
  for (const shape of frame.querySelectorAll("svg polygon, svg circle, svg path")) {
    const { stroke, strokeWidth } = getComputedStyle(shape);
    const [red, green, blue, opacity = 1] = (stroke.match(/[\d.]+/g) || []).map(Number);
    if (blue === undefined) continue;
    const lines = shape.tagName === "path" ? shape.getAttribute("d").split(/(?=M)/).map((d) => draw("path", { d })) : [shape];
    for (const line of lines) {
      const length = line.getTotalLength(), steps = Math.ceil(length / most);
      // A path without a place has no point, either.
      if (!length) continue;
      let last = null, from = null;
      for (let step = 0; step <= steps; step += 1) {
        const at = line.getPointAtLength(length * step / steps), place = onto(heights, mesh, at.x - 0.5, at.y - 0.5);
        // A path may move on without a line.
        const drawn = last && place && Math.hypot(at.x - from.x, at.y - from.y) < 1.1 * most;
        if (drawn) pieces.push(...last, ...place, red / 255, green / 255, blue / 255, opacity, parseFloat(strokeWidth));
        last = place;
        from = at;
      }
    }
  }
  return pieces;
}
