// The part of a picture in 3-D: heights as a surface, on which lies all that the picture shows.
import { button, make } from "./element.js";
import { words } from "./api.js";
import { heightsOf, linesOn, meshOf } from "./mesh.js";
import { surface } from "./surface.js";

// A phone or a tablet draws fewer triangles; its pixels are so fine that edges need no smoothing.
const FINGERS = matchMedia("(pointer: coarse)").matches;
const TRIANGLES = FINGERS ? 100000 : 200000, LEVELS = 5;
// The view at first, turned about z and from above (radians); and how far a key or a button goes.
const FIRST = { yaw: -0.35, tilt: 0.85, zoom: 1, pan: [0, 0], middle: [Infinity, 0, 0], radius: 1 };
const TURN = Math.PI / 18, MOVE = 0.15, ZOOM = 1.25, ZOOMS = [0.5, 60];
const WAYS = { Left: [-1, 0], Right: [1, 0], Up: [0, 1], Down: [0, -1] };
const KEYS = "Arrow keys turn, with Shift move; + and \u2212 zoom, 0 resets.";
const HELP = FINGERS ? "One finger turns, two move and zoom." : `Drag to turn, with Shift to move; the wheel zooms. ${KEYS}`;
const NO_WEBGL = "No 3-D view: this browser has no WebGL 2. The picture shows the same.";
const LOST = "The 3-D view is interrupted; the picture shows the same.";

function within(value, [least, most]) { return Math.min(most, Math.max(least, value)); }

function part(name, kind, attributes, ...children) {
  const made = make(name, kind, ...children);
  for (const key of Object.keys(attributes)) made.setAttribute(key, attributes[key]);
  return made;
}

// Adds the view to a picture: a button behind the choice of its layers, and the view in its frame while that is pressed. A view that is not
// looked at asks for nothing and holds nothing.
export function viewOf(picture) {
  const frame = picture.parentElement, plate = frame.parentElement, pointers = new Map();
  const seen = Object.assign({}, FIRST);
  // `wanted`: what the picture shows; `held`: what was loaded of it; `draws`: draws on the canvas, unless its context is lost.
  let open = false, near = false, moving = false, loading = false, due = 0, wanted = null, held = null, draws = null, canvas = null;
  const place = part("div", "space", { tabindex: 0, role: "application", "aria-label": `the part in 3-D. ${KEYS}` });
  const help = part("p", "quiet", { role: "status" });
  const toggle = button("3-D", "in-space", () => { open = !open; wake(); });
  const mover = button("Move", "", () => { moving = !moving; tell(); });
  const key = (name) => button(name, "", () => { act(name, moving); });
  const pad = part("div", "pad", { role: "group", "aria-label": "3-D view" }, ...Object.keys(WAYS).map(key), mover, ...["+", "\u2212", "Reset"].map(key));

  function tell(problem) {
    toggle.setAttribute("aria-pressed", open);
    mover.setAttribute("aria-pressed", moving);
    const lost = canvas && !draws, shown = open && !lost;
    place.hidden = pad.hidden = !shown;
    plate.parentElement.classList.toggle("solid", shown);
    help.textContent = problem || (shown ? HELP : lost ? LOST : "");
  }

  function redraw() { if (!due && draws) due = requestAnimationFrame(paint); }

  function paint() {
    due = 0;
    if (!draws) return;
    const ratio = Math.min(2, window.devicePixelRatio);
    const wide = Math.round(place.clientWidth * ratio), high = Math.round(place.clientHeight * ratio);
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    const { yaw, tilt, zoom, pan, radius, middle } = seen;
    const [c, s, cos, sin] = [Math.cos(yaw), Math.sin(yaw), Math.cos(tilt), Math.sin(tilt)];
    const x = Math.min(1, high / wide), y = Math.min(1, wide / high);
    draws.draw(held && {
      turn: [c, s * cos, -s * sin, -s, c * cos, -c * sin, 0, sin, cos], middle,
      fit: [x * zoom / radius, y * zoom / radius, x * pan[0], y * pan[1]], near: [0.25 / radius], pixel: [2 * ratio / wide, 2 * ratio / high],
    });
  }

  function line() {
    if (!draws || !held) return;
    draws.line(linesOn(held.heights, held.mesh, frame));
    redraw();
  }

  function put() {
    const { heights, mesh: { triangles, middle, radius } } = held;
    draws.put(heights, triangles, picture);
    // The view stays while parts lie about where they lay.
    const off = middle.map((mm, axis) => mm - seen.middle[axis]);
    if (Math.hypot(radius - seen.radius, ...off) > radius / 4) Object.assign(seen, { middle, radius });
    line();
  }

  // One request at a time; of the parts that come meanwhile the newest is next.
  async function load() {
    if (loading || !draws || document.hidden) return;
    if (!wanted) { held = null; redraw(); return; }
    const { path, points, seq } = wanted;
    if (held && held.path === path) { put(); return; }
    const others = () => !wanted || wanted.path !== path;
    const level = within(Math.ceil(Math.log2(2 * points / TRIANGLES) / 2), [0, LEVELS]);
    let problem = "";
    loading = true;
    try {
      const answer = await words(`${path}&level=${level}`);
      if (draws && !others()) {
        if (answer.about.seq !== seq) throw new Error(`the frames of no. ${seq} are gone`);
        const heights = heightsOf(answer);
        held = { path, heights, mesh: meshOf(heights) };
        put();
      }
    } catch (error) {
      // No older part is shown as this one.
      problem = error.message;
      held = null;
      redraw();
    }
    loading = false;
    if (others()) load(); else tell(problem);
  }

  function begin() {
    draws = surface(canvas, !FINGERS);
    if (!draws) { canvas.remove(); canvas = null; open = false; }
    tell(draws ? "" : NO_WEBGL);
    load();
  }

  // Begins or ends, as the view is open and on the screen.
  function wake() {
    if (open && near && !canvas) {
      const own = canvas = make("canvas");
      own.addEventListener("webglcontextlost", (event) => { event.preventDefault(); if (own === canvas) { draws = null; tell(); } });
      own.addEventListener("webglcontextrestored", () => { if (own === canvas) begin(); });
      place.append(own);
      begin();
      return;
    }
    if (canvas && !(open && near)) {
      canvas.remove();
      if (draws) draws.free();
      canvas = draws = held = null;
    }
    tell();
  }

  function turn(x, y) {
    seen.yaw += x;
    seen.tilt = within(seen.tilt + y, [-Math.PI / 2, Math.PI / 2]);
  }

  function move(x, y) { seen.pan = [seen.pan[0] + x, seen.pan[1] + y]; }

  function zoom(factor, at = [0, 0]) {
    const larger = within(seen.zoom * factor, ZOOMS);
    seen.pan = seen.pan.map((was, axis) => at[axis] + (was - at[axis]) * larger / seen.zoom);
    seen.zoom = larger;
  }

  // Does what a key stands for, if it stands for something.
  function act(key, shift) {
    const way = WAYS[key.replace("Arrow", "")];
    if (way && shift) move(MOVE * way[0], MOVE * way[1]);
    else if (way) turn(TURN * way[0], TURN * way[1]);
    else if (key === "+") zoom(ZOOM);
    else if (key === "-" || key === "\u2212") zoom(1 / ZOOM);
    else if (key === "0" || key === "Reset") { Object.assign(seen, FIRST); if (held) put(); } else return false;
    redraw();
    return true;
  }

  // A point of the screen, from the middle of the view in halves of its smaller side.
  function pointOf({ clientX, clientY }) {
    const { left, top, width, height } = place.getBoundingClientRect(), half = Math.min(width, height) / 2;
    return [(clientX - left - width / 2) / half, (top + height / 2 - clientY) / half];
  }

  // The middle of the pointers, and how far they are apart.
  function grip() {
    const all = Array.from(pointers.values()), [a] = all, b = all[all.length - 1];
    return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, Math.hypot(a[0] - b[0], a[1] - b[1])];
  }

  function hold(event) { pointers.set(event.pointerId, pointOf(event)); }

  function drag(event) {
    if (!pointers.has(event.pointerId)) return;
    const was = grip();
    hold(event);
    const now = grip(), x = now[0] - was[0], y = now[1] - was[1];
    if (pointers.size > 1 || moving || event.shiftKey) move(x, y); else turn(1.6 * x, 1.6 * y);
    if (was[2] && now[2]) zoom(now[2] / was[2], now);
    redraw();
  }

  const on = (kind, act, options) => place.addEventListener(kind, act, options);
  on("pointerdown", (event) => { place.setPointerCapture(event.pointerId); hold(event); });
  on("pointermove", drag);
  on("lostpointercapture", (event) => pointers.delete(event.pointerId));
  on("wheel", (event) => { event.preventDefault(); zoom(Math.pow(ZOOM, -Math.sign(event.deltaY)), pointOf(event)); redraw(); }, { passive: false });
  on("keydown", (event) => { if (!event.ctrlKey && !event.altKey && !event.metaKey && act(event.key, event.shiftKey)) event.preventDefault(); });
  window.addEventListener("resize", redraw);
  document.addEventListener("visibilitychange", load);
  for (const svg of frame.querySelectorAll("svg")) new MutationObserver(line).observe(svg, { childList: true });
  new IntersectionObserver((entries) => { near = entries.pop().isIntersecting; wake(); }).observe(plate);
  frame.append(place);
  plate.parentElement.querySelector(".choice").after(toggle);
  plate.after(pad, help);
  tell();

  return {
    // What the picture shows, after each change: the path of its part's surface with SEQ, and the number of points; or null.
    show(shown) { wanted = shown; load(); },
  };
}
