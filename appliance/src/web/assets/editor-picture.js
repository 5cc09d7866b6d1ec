// The picture of golden in the editor: its layers and zoom, and the features on it, which are drawn and moved with a mouse, a finger or keys.
import { $, draw, fill, on, text } from "./element.js";
import { map } from "./api.js";
import { paint } from "./colour.js";
import { marks } from "./found.js";
import { notice } from "./session.js";
import { alter, featureKind, record, snapshot, state } from "./editor-list.js";
import { area, circle, corners, drawn, move, outline, outside, touches } from "./editor-shapes.js";

// Side of a corner's touch target, and radius of the grip that is drawn in it, in pixels of the screen.
const TARGET = 26;
const GRIP = 8;
// A pointer that moves by less has touched.
const STILL = 4;
const ZOOMS = [1, 1.5, 2, 3, 4, 6];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
// `pointers` are those that are down; `tool` is a shape that is being drawn, with its points so far and the one that follows the pointer.
const view = { layer: "modulation", asked: 0, mm: 1, zoom: 1, nodes: [], handles: [], tool: null, drag: null, pointers: {}, pinch: null, due: 0, made: null, choose: null };

const svg = () => $("editor-regions");
// Camera pixels per pixel of the screen, so that touch targets have the same size on every screen and at every zoom.
const scale = () => state.recipe.camera.width / (svg().getBoundingClientRect().width || state.recipe.camera.width);
const shapeOf = (feature) => featureKind(feature).shapes[0];
const points = (all) => all.map(([u, v]) => `${u + 0.5},${v + 0.5}`).join(" ");
// The feature with corners: the only one that is chosen.
const subject = () => (state.chosen.length === 1 ? state.chosen[0] : -1);
export const pixel = () => view.mm;

// Shows a layer of the recipe's picture.
export async function showLayer(layer = view.layer) {
  const turn = view.asked += 1;
  view.layer = layer;
  for (const one of document.querySelectorAll("[data-golden]")) one.setAttribute("aria-pressed", one.dataset.golden === layer);
  const { number, camera } = state.recipe;
  for (const id of ["editor-regions", "editor-found"]) $(id).setAttribute("viewBox", `0 0 ${camera.width} ${camera.height}`);
  try {
    const loaded = await map(`api/recipes/${number}/picture/${layer}`);
    if (turn !== view.asked) return;
    view.mm = loaded.about.pixel_mm;
    paint($("editor-map"), loaded, layer);
  } catch (error) { notice(error.message, true); }
}

function zoom(to, focus) {
  const frame = $("editor-plate"), box = frame.getBoundingClientRect();
  const middle = focus || [box.left + box.width / 2, box.top + box.height / 2];
  const at = [middle[0] - box.left, middle[1] - box.top], by = to / view.zoom;
  const was = [frame.scrollLeft, frame.scrollTop];
  // A part of the picture has the room of the whole.
  if (view.zoom === 1) view.height = box.height;
  frame.style.height = to > 1 ? `${view.height}px` : "";
  view.zoom = to;
  $("editor-stage").style.width = `${100 * to}%`;
  frame.scrollLeft = (was[0] + at[0]) * by - at[0];
  frame.scrollTop = (was[1] + at[1]) * by - at[1];
  text("zoom", `${Math.round(100 * to)} %`);
  placeHandles();
}
const nextZoom = (by) => zoom(by > 0 ? ZOOMS.find((one) => one > view.zoom * 1.01) || view.zoom : ZOOMS.slice().reverse().find((one) => one < view.zoom * 0.99) || 1);

// Draws all features anew, small ones above large ones.
export function drawShapes() {
  const { features } = state.list;
  view.nodes = features.map((feature, at) => draw("polygon", { "data-at": at, class: "region", "vector-effect": "non-scaling-stroke" }));
  features.forEach((feature, at) => placeShape(at));
  const size = (at) => area(outline(features[at], view.mm));
  const order = features.map((_, at) => at).sort((one, other) => size(other) - size(one));
  const held = svg().contains(document.activeElement) ? document.activeElement : null;
  fill(svg(), ...order.map((at) => view.nodes[at]), ...view.handles);
  if (view.tool) svg().append(view.tool.draft, view.tool.cross);
  markChosen();
  if (held) (svg().contains(held) ? held : view.nodes[held.getAttribute("data-at")] || svg()).focus({ preventScroll: true });
}

// Shows which features are chosen, and the corners if it is one.
export function markChosen() {
  view.nodes.forEach((node, at) => {
    const chosen = state.chosen.includes(at);
    node.classList.toggle("chosen", chosen);
    if (chosen) node.setAttribute("tabindex", 0); else node.removeAttribute("tabindex");
  });
  placeHandles();
  const feature = state.list.features[subject()];
  if (feature && !view.tool) text("editor-cursor", `${feature.name}: drag it by its inside or its corners; arrow keys move it`);
}

function placeShape(at) {
  const feature = state.list.features[at];
  view.nodes[at].setAttribute("points", points(outline(feature, view.mm)));
  view.nodes[at].setAttribute("aria-label", `${feature.kind} ${feature.name}`);
  view.nodes[at].setAttribute("role", "button");
}

function handle(corner) {
  const made = draw("g", { class: "handle", tabindex: 0, role: "button", "data-corner": corner },
    draw("rect", { class: "target" }), draw("line", { "vector-effect": "non-scaling-stroke" }), draw("circle", { class: "grip", "vector-effect": "non-scaling-stroke" }));
  svg().append(made);
  return made;
}

function placeHandles() {
  const feature = view.tool ? null : state.list.features[subject()];
  const all = feature ? corners(shapeOf(feature), feature) : [];
  while (view.handles.length > all.length) view.handles.pop().remove();
  while (view.handles.length < all.length) view.handles.push(handle(view.handles.length));
  if (!feature) return;
  const by = scale(), side = TARGET * by, round = circle(shapeOf(feature), feature.region), grips = { target: side, grip: (GRIP + 2) * by };
  all.forEach(([u, v], corner) => {
    const [x, y] = outside(all, corner, round ? feature.region : all, grips);
    const node = view.handles[corner], [target, line, grip] = node.children;
    const set = (one, values) => { for (const key of Object.keys(values)) one.setAttribute(key, values[key]); };
    set(target, { x: x - side / 2, y: y - side / 2, width: side, height: side });
    set(line, { x1: u + 0.5, y1: v + 0.5, x2: x, y2: y });
    set(grip, { cx: x, cy: y, r: GRIP * by });
    const what = round ? `rim of ${feature.name}: radius ${round.radius.toFixed(1)} px` : `corner ${corner + 1} of ${feature.name}: column ${u.toFixed(1)}, row ${v.toFixed(1)}`;
    node.setAttribute("aria-label", what);
    node.classList.toggle("chosen", corner === view.corner);
  });
}

export const showMarks = (features) => fill($("editor-found"), ...marks(features, state.recipe.camera.width / 200));
// The corner that was used last, of the feature that has corners.
export const corner = () => Math.max(0, Math.min(view.corner || 0, view.handles.length - 1));

function placed(event) {
  const box = svg().getBoundingClientRect(), { width, height } = state.recipe.camera;
  const at = [(event.clientX - box.left) / box.width * width - 0.5, (event.clientY - box.top) / box.height * height - 0.5];
  return [Math.min(width - 0.5, Math.max(-0.5, at[0])), Math.min(height - 0.5, Math.max(-0.5, at[1]))];
}

// Begins to draw a feature of a kind with a shape; without one ends it.
export function useTool(kind, shape) {
  if (view.tool) { view.tool.draft.remove(); view.tool.cross.remove(); }
  view.tool = null;
  svg().classList.toggle("drawing", Boolean(kind));
  if (kind) {
    const { width, height } = state.recipe.camera, node = (name, of) => draw(name, { class: of, "vector-effect": "non-scaling-stroke" });
    view.tool = { kind, shape, points: [], at: [width / 2, height / 2], draft: node("polygon", "draft"), cross: node("path", "cross") };
    svg().append(view.tool.draft, view.tool.cross);
    svg().focus({ preventScroll: true });
    draft();
  }
  markChosen();
  view.tooled();
}
export const tool = () => view.tool;

const HINTS = {
  circle: ["touch its centre", "touch its rim"], rectangle: ["touch a corner, or drag to the opposite one", "touch the opposite corner"],
  points: ["touch a point on the edge", "touch a second one, as far away as the edge is straight"],
  section: ["touch one sheet beside the joint", "touch the other sheet"],
};

function draft() {
  if (!view.tool) return;
  const { kind, shape, points: all, at, draft: node, cross } = view.tool;
  const arm = 14 * scale(), [u, v] = [at[0] + 0.5, at[1] + 0.5];
  cross.setAttribute("d", `M${u - arm} ${v}H${u + arm}M${u} ${v - arm}V${v + arm}`);
  const open = touches(shape) === 0, next = all.concat([at]);
  const of = !all.length ? null : open ? { region: next } : drawn(shape, next, view.mm, kind.around_mm || 0);
  node.setAttribute("points", of ? points(outline(of, view.mm)) : "");
  const hint = open ? (all.length < 3 ? "touch its corners in order" : "touch the next corner, or the first one to end") : HINTS[shape][all.length];
  text("editor-cursor", `${kind.kind}: ${hint}. Arrow keys move the cross, Enter touches, Escape ends.`);
}

// A touch of the shape that is being drawn.
function touch(at) {
  const { kind, shape, points: all } = view.tool, needed = touches(shape), near = ([u, v], most) => Math.hypot(u - at[0], v - at[1]) < most;
  const closes = !needed && all.length > 2 && near(all[0], TARGET * scale());
  // Two touches at one place are one.
  if (!closes && !(all.length && near(all[all.length - 1], 1))) all.push(at);
  view.tool.at = at;
  if (closes || (needed && all.length === needed)) finish(); else draft();
}

function finish() {
  const { kind, shape, points: all } = view.tool;
  const made = Object.assign({ kind: kind.kind }, drawn(shape, all, view.mm, kind.around_mm || 0));
  useTool(null);
  view.made(made);
}

function press(event) {
  view.pointers[event.pointerId] = [event.clientX, event.clientY];
  const down = Object.keys(view.pointers).map((id) => view.pointers[id]);
  svg().setPointerCapture(event.pointerId);
  if (down.length === 2) {
    release(true);
    view.pinch = { apart: Math.hypot(down[0][0] - down[1][0], down[0][1] - down[1][1]) || 1, zoom: view.zoom };
    return;
  }
  event.preventDefault();
  const at = placed(event), from = [event.clientX, event.clientY];
  if (view.tool) { view.drag = { tool: true, from, at }; view.tool.at = at; draft(); return; }
  const grip = event.target.closest("[data-corner]"), shape = event.target.closest("[data-at]"), frame = $("editor-plate");
  const feature = grip ? subject() : shape ? Number(shape.dataset.at) : -1;
  view.corner = grip ? Number(grip.dataset.corner) : 0;
  // In a part of the picture a drag moves the picture, unless it begins on what is chosen.
  const held = grip || view.zoom === 1 || state.chosen.includes(feature);
  if (feature >= 0 && !grip) view.choose(feature, event.shiftKey || event.ctrlKey);
  if (grip) placeHandles();
  view.drag = { feature: held ? feature : -1, corner: grip ? view.corner : -1, from, at, before: snapshot(), scroll: [frame.scrollLeft, frame.scrollTop], moving: false };
  if (feature >= 0) view.drag.was = JSON.parse(JSON.stringify(state.list.features[feature]));
}

function follow(event) {
  if (view.tool && !view.drag) { view.tool.at = placed(event); queue(draft); return; }
  if (!view.pointers[event.pointerId]) return;
  view.pointers[event.pointerId] = [event.clientX, event.clientY];
  if (view.pinch) {
    const [one, other] = Object.keys(view.pointers).map((id) => view.pointers[id]);
    if (other) zoom(Math.min(6, Math.max(1, view.pinch.zoom * Math.hypot(one[0] - other[0], one[1] - other[1]) / view.pinch.apart)), [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2]);
    return;
  }
  const { drag } = view;
  if (!drag) return;
  const by = [event.clientX - drag.from[0], event.clientY - drag.from[1]];
  if (!drag.moving && Math.hypot(by[0], by[1]) < STILL) return;
  drag.moving = true;
  const to = placed(event);
  queue(() => {
    if (drag.tool) { if (view.tool) { if (!view.tool.points.length && touches(view.tool.shape)) view.tool.points.push(drag.at); view.tool.at = to; draft(); } return; }
    if (drag.feature < 0) { const frame = $("editor-plate"); frame.scrollLeft = drag.scroll[0] - by[0]; frame.scrollTop = drag.scroll[1] - by[1]; return; }
    shift(drag.feature, drag.was, drag.corner, [to[0] - drag.at[0], to[1] - drag.at[1]]);
  });
}

// Does the last thing that was asked for once per picture of the screen.
function queue(act) {
  const idle = !view.due;
  view.due = act;
  if (idle) requestAnimationFrame(flush);
}
function flush() {
  const act = view.due;
  view.due = 0;
  if (act) act();
}

function shift(at, was, corner, by) {
  const feature = state.list.features[at];
  move(shapeOf(feature), feature, was, corner, by, state.recipe.camera);
  placeShape(at);
  placeHandles();
}

function release(broken) {
  flush();
  const { drag } = view;
  view.drag = null;
  if (!drag) return;
  if (drag.tool) { if (view.tool && broken !== true) touch(view.tool.at); return; }
  if (drag.feature >= 0 && drag.moving) record(drag.before, `drag ${drag.feature} ${drag.from}`);
}

function lift(event) {
  delete view.pointers[event.pointerId];
  if (!Object.keys(view.pointers).length) view.pinch = null;
  release(event.type === "pointercancel");
}

function keys(event) {
  const by = ARROWS[event.key], far = event.shiftKey ? 10 : 1;
  if (view.tool) {
    if (event.key === "Escape") useTool(null);
    else if (event.key === "Enter" || event.key === " ") touch(view.tool.at.slice());
    else if (by) {
      const { width, height } = state.recipe.camera, [u, v] = view.tool.at;
      view.tool.at = [Math.min(width - 1, Math.max(0, u + far * by[0])), Math.min(height - 1, Math.max(0, v + far * by[1]))];
      draft();
    } else return;
    event.preventDefault();
    return;
  }
  const grip = event.target.closest("[data-corner]"), shape = event.target.closest("[data-at]");
  if (!by || !(grip || shape)) return;
  event.preventDefault();
  const at = grip ? subject() : Number(shape.dataset.at), corner = grip ? Number(grip.dataset.corner) : -1;
  view.corner = Math.max(0, corner);
  // A rim grows to the right and upwards.
  const along = grip && circle(shapeOf(state.list.features[at]), state.list.features[at].region) ? [far * (by[0] - by[1]), 0] : [far * by[0], far * by[1]];
  alter(`keys ${at} ${corner}`, () => shift(at, JSON.parse(JSON.stringify(state.list.features[at])), corner, along));
}

// `made` gets a feature that was drawn, `choose` the place of one that was touched; `tooled` is called when a tool is taken or left.
export function start({ made, choose, tooled }) {
  Object.assign(view, { made, choose, tooled });
  for (const [kind, act] of [["pointerdown", press], ["pointermove", follow], ["pointerup", lift], ["pointercancel", lift], ["keydown", keys]]) on(svg(), kind, act);
  on($("editor-plate"), "wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.min(6, Math.max(1, view.zoom * (event.deltaY < 0 ? 1.2 : 1 / 1.2))), [event.clientX, event.clientY]);
  }, { passive: false });
  on(window, "resize", () => { if (state.list && !$("editor").hidden) placeHandles(); });
  on($("zoom-in"), "click", () => nextZoom(1));
  on($("zoom-out"), "click", () => nextZoom(-1));
  on($("zoom"), "click", () => zoom(1));
  for (const one of document.querySelectorAll("[data-golden]")) on(one, "click", () => showLayer(one.dataset.golden));
}
