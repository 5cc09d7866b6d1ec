// The triangles of a part's heights, and lines that lie on them.

// A triangle whose z differ by more than this many distances of neighbours lies across a jump.
const JUMP = 3;
// The word for "no value".
const NONE = 65535;
// Distances at which heights beside a line are looked for, in points.
const FAR = [1.5, 5, 12];
// Colours and widths of lines go by the style of what is drawn over the picture.
const DRAWN = "polygon, polyline, line, circle";

// The heights of an answer: three planes of words, x, y and z.
export function heightsOf({ about, buffer }) {
  const { width, height, stride, planes } = about;
  const [low, mm] = ["low", "step"].map((key) => planes.slice(0, 3).map((plane) => plane[key]));
  return { width, height, stride, low, mm, words: new Uint16Array(buffer, 0, 3 * width * height) };
}

function placeOf({ words, low, mm, width, height }, at) {
  return low.map((least, axis) => least + mm[axis] * words[axis * width * height + at]);
}

// From a point to the one `by` words further, in mm in the plane: medians.
function neighbour(heights, by) {
  const { words, width, height } = heights;
  const size = width * height, every = Math.max(1, Math.floor(size / 5000)), found = [];
  for (let at = 0; at + by < size; at += every) {
    if (words[2 * size + at] === NONE || words[2 * size + at + by] === NONE || (by === 1 && at % width === width - 1)) continue;
    const [from, to] = [placeOf(heights, at), placeOf(heights, at + by)];
    found.push([to[0] - from[0], to[1] - from[1]]);
  }
  return [0, 1].map((axis) => found.map((one) => one[axis]).sort((a, b) => a - b)[found.length >> 1] || 0);
}

// The triangles between known heights, without those across jumps; the middle and the radius of what they cover, in mm; and how far it is
// to the next point of a row (`right`) and to the next row (`down`).
export function meshOf(heights) {
  const { words, mm, width, height } = heights;
  const size = width * height, z = words.subarray(2 * size);
  const [right, down] = [neighbour(heights, 1), neighbour(heights, width)];
  const most = JUMP * Math.hypot(right[0], right[1]) / mm[2];
  const corners = new Uint32Array(6 * (width - 1) * (height - 1));
  let count = 0;
  const add = (a, b, c) => {
    const high = Math.max(z[a], z[b], z[c]);
    if (high === NONE || high - Math.min(z[a], z[b], z[c]) > most) return;
    corners[count] = a;
    corners[count + 1] = b;
    corners[count + 2] = c;
    count += 3;
  };
  for (let v = 0; v + 1 < height; v += 1) {
    for (let u = 0; u + 1 < width; u += 1) {
      const a = v * width + u, b = a + 1, c = a + width, d = c + 1;
      // The other diagonal where a corner of this one is missing.
      if (z[b] === NONE || z[c] === NONE) { add(a, c, d); add(a, d, b); } else { add(a, c, b); add(b, c, d); }
    }
  }
  const triangles = corners.slice(0, count);
  const ends = [0, 1, 2].map((axis) => {
    let least = NONE, largest = 0;
    for (const at of triangles) {
      const word = words[axis * size + at];
      if (word < least) least = word;
      if (word > largest) largest = word;
    }
    return [heights.low[axis] + mm[axis] * least, heights.low[axis] + mm[axis] * largest];
  });
  const radius = Math.hypot(...ends.map(([from, to]) => (to - from) / 2));
  return { triangles, right, down, radius, middle: ends.map(([from, to]) => (from + to) / 2) };
}

// A pixel's place on the surface: beside what was measured closest to it, in points; none if that is far. At an edge it lies on the upper
// side, whose rim the camera sees.
function onto(heights, { right, down }, u, v) {
  const { width, height, stride, words } = heights;
  const column = u / stride, row = v / stride;
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

// The corners of what is drawn over a picture, in its pixels, and whether the last leads to the first.
function path(shape) {
  const number = (name) => Number(shape.getAttribute(name));
  if (shape.tagName === "line") return [["x1", "y1"], ["x2", "y2"]].map((pair) => pair.map(number));
  if (shape.tagName === "circle") {
    const [x, y, r] = ["cx", "cy", "r"].map(number);
    return Array.from({ length: 33 }, (_, at) => [x + r * Math.cos(Math.PI * at / 16), y + r * Math.sin(Math.PI * at / 16)]);
  }
  const points = shape.getAttribute("points").trim().split(/\s+/).map((pair) => pair.split(",").map(Number));
  return shape.tagName === "polygon" ? points.concat(points.slice(0, 1)) : points;
}

// What is drawn over a picture as pieces of lines on the surface: both ends in mm, colour with opacity, width in pixels of the screen.
export function linesOn(heights, mesh, overlay) {
  const pieces = [];
  for (const shape of overlay.querySelectorAll(DRAWN)) {
    const { stroke, strokeWidth } = getComputedStyle(shape);
    const colour = (stroke.match(/[\d.]+/g) || []).map(Number);
    if (colour.length < 3) continue;
    const look = [colour[0] / 255, colour[1] / 255, colour[2] / 255, colour.length > 3 ? colour[3] : 1, parseFloat(strokeWidth)];
    const corners = path(shape);
    let last = null;
    corners.slice(1).forEach(([u, v], at) => {
      const [u0, v0] = corners[at];
      const steps = Math.max(1, Math.ceil(Math.hypot(u - u0, v - v0) / heights.stride));
      for (let step = at ? 1 : 0; step <= steps; step += 1) {
        const place = onto(heights, mesh, u0 + (u - u0) * step / steps - 0.5, v0 + (v - v0) * step / steps - 0.5);
        if (last && place && Math.abs(place[2] - last[2]) < mesh.radius / 4) pieces.push(...last, ...place, ...look);
        last = place;
      }
    });
  }
  return pieces;
}
