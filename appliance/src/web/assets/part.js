// What teaching took for the part: shown in colour, corrected by touches or by an outline, and taught again.
import { $, draw, fill, on, show, text } from "./element.js";
import { words } from "./api.js";
import { change, notice } from "./session.js";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const nothing = () => ({ outline: [], part: [], others: [] });
// `size` is that of the frame; `part` has 1 for each pixel of the map that was taken for the part; `at` is where the cross of the keys is.
const view = { number: 0, size: [1, 1], stride: 1, columns: 1, part: [], marking: nothing(), outlining: false, at: null, place: null };

const svg = () => $("part-marks");

// The values of the planes of a map, one behind the other; NaN where there is none.
function planesOf({ about, buffer }) {
  const pixels = about.width * about.height, read = new DataView(buffer);
  return about.planes.map(({ low, step }, plane) => Float32Array.from({ length: pixels }, (_, at) => {
    const word = read.getUint16(2 * (plane * pixels + at), true);
    return word === 65535 ? NaN : low + step * word;
  }));
}

// The light in grey, and the part in colour.
function paint({ width, height, planes }, [light, part]) {
  const canvas = $("part-map"), [dark, bright] = planes[0].scale;
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d"), image = context.createImageData(width, height);
  for (let at = 0; at < light.length; at += 1) {
    const grey = 30 + 200 * Math.min(1, Math.max(0, (light[at] - dark) / (bright - dark || 1)));
    image.data.set(part[at] > 0.5 ? [0.25 * grey, 60 + 0.75 * grey, 80 + 0.6 * grey, 255] : [grey, grey, grey, 255], 4 * at);
  }
  context.putImageData(image, 0, 0);
}

// Draws what is marked, the place for which teaching was refused, and the cross of the keys.
function mark() {
  const by = view.size[0] / (svg().getBoundingClientRect().width || view.size[0]), r = 11 * by;
  const at = ([u, v]) => ({ cx: u + 0.5, cy: v + 0.5, r });
  const cross = ([u, v], arm) => `M${u + 0.5 - arm} ${v + 0.5 - arm}l${2 * arm} ${2 * arm}m0 ${-2 * arm}l${-2 * arm} ${2 * arm}`;
  const { outline, part, others } = view.marking, made = [];
  if (outline.length) made.push(draw(view.outlining ? "polyline" : "polygon", { class: "outline", points: outline.map(([u, v]) => `${u + 0.5},${v + 0.5}`).join(" "), "vector-effect": "non-scaling-stroke" }));
  for (const one of part) made.push(draw("circle", { class: "is-part", "vector-effect": "non-scaling-stroke", ...at(one) }));
  for (const one of others) made.push(draw("path", { class: "is-not", "vector-effect": "non-scaling-stroke", d: cross(one, 0.7 * r) }));
  if (view.place) made.push(draw("circle", { class: "refused", "vector-effect": "non-scaling-stroke", cx: view.place[0] + 0.5, cy: view.place[1] + 0.5, r: 1.8 * r }));
  if (view.at) made.push(draw("path", { class: "keys", "vector-effect": "non-scaling-stroke", d: `M${view.at[0] - r} ${view.at[1]}h${2 * r}M${view.at[0]} ${view.at[1] - r}v${2 * r}` }));
  fill(svg(), ...made);
  $("part-outline").setAttribute("aria-pressed", view.outlining);
  const said = outline.length + part.length + others.length > 0;
  $("part-forget").disabled = !said;
  text("part-cursor", view.outlining ? `Outline: touch its corners in order, with everything of the part inside${outline.length > 2 ? "; the first one ends it" : ""}. Arrow keys move the cross, Enter touches, Escape ends.`
    : "Touch what is wrong: a grey piece becomes the part, a coloured one is left out. Arrow keys move a cross, Enter touches.");
}

function touch([u, v]) {
  const { outline, part, others } = view.marking, reach = 14 * view.size[0] / (svg().getBoundingClientRect().width || view.size[0]);
  if (view.outlining) {
    if (outline.length > 2 && Math.hypot(outline[0][0] - u, outline[0][1] - v) < reach) view.outlining = false;
    else outline.push([u, v]);
  } else {
    const near = ([column, row]) => Math.hypot(column - u, row - v) < reach;
    const [before, other] = [part.findIndex(near), others.findIndex(near)];
    // A second touch takes the first one back.
    if (before >= 0) part.splice(before, 1);
    else if (other >= 0) others.splice(other, 1);
    else if (view.part[Math.floor(v / view.stride) * view.columns + Math.floor(u / view.stride)] > 0.5) others.push([u, v]);
    else part.push([u, v]);
  }
  mark();
}

function inFrame([u, v]) { return [u, v].map((at, i) => Math.min(view.size[i] - 1, Math.max(0, Math.round(at)))); }

function endOutline() {
  view.outlining = false;
  if (view.marking.outline.length < 3) view.marking.outline = [];
}

function keys(event) {
  const by = ARROWS[event.key], far = event.shiftKey ? 10 : 1;
  if (by) view.at = inFrame((view.at || view.size.map((side) => side / 2)).map((at, i) => at + far * by[i]));
  else if ((event.key === "Enter" || event.key === " ") && view.at) { touch(view.at.slice()); event.preventDefault(); return; }
  else if (event.key === "Escape" && view.outlining) endOutline();
  else return;
  event.preventDefault();
  mark();
}

// Shows what was taken for the part that was taught last, as this number.
export async function showPart(number) {
  let seen;
  try { seen = await words("api/teach/part"); } catch (error) { show("part-seen", false); return; }
  const { width, height, stride, marking, place } = seen.about, planes = planesOf(seen);
  Object.assign(view, { number, stride, columns: width, size: [width * stride, height * stride], part: planes[1], marking, outlining: false, at: null, place: place && [place.column, place.row] });
  svg().setAttribute("viewBox", `0 0 ${view.size[0]} ${view.size[1]}`);
  show("part-seen", true);
  paint(seen.about, planes);
  mark();
}

// `teach` teaches a number again with what is marked.
export function start({ teach }) {
  on(svg(), "click", (event) => {
    const box = svg().getBoundingClientRect();
    touch(inFrame([(event.clientX - box.left) / box.width * view.size[0] - 0.5, (event.clientY - box.top) / box.height * view.size[1] - 0.5]));
  });
  on(svg(), "keydown", keys);
  on($("part-outline"), "click", () => {
    if (view.outlining) endOutline();
    else { view.outlining = true; view.marking.outline = []; svg().focus({ preventScroll: true }); }
    mark();
  });
  on($("part-forget"), "click", () => { view.marking = nothing(); view.outlining = false; mark(); });
  on($("part-teach"), "click", () => {
    endOutline();
    change(() => teach(view.number, view.marking)).catch((error) => notice(error.message, true));
  });
}
