// The part of a picture in space: its heights as a surface, on which lies what the picture shows, colours and lines.
import { make } from "./element.js";
import { words } from "./api.js";
import { heightsOf, linesOn, meshOf } from "./mesh.js";
import { surface } from "./surface.js";

// A phone or a tablet, which draws fewer triangles.
const FINGERS = matchMedia("(pointer: coarse)").matches;
const MOST = FINGERS ? 100000 : 300000;
const LEVELS = 5;
// The view at first: turned about z, and from above (radians); and the ways of a key or a button.
const FIRST = { yaw: -0.35, tilt: 0.85, zoom: 1, pan: [0, 0] };
const TURN = Math.PI / 18, MOVE = 0.15, ZOOM = 1.25, LEAST_ZOOM = 0.5, MOST_ZOOM = 60;
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const PAD = [["\u2190", "left", "ArrowLeft"], ["\u2192", "right", "ArrowRight"], ["\u2191", "up", "ArrowUp"], ["\u2193", "down", "ArrowDown"], ["+", "nearer", "+"], ["\u2212", "farther", "-"]];
const KEYS = "Arrow keys turn, with Shift they move; + and \u2212 zoom, 0 resets.";
const HELP = FINGERS ? "One finger turns, two move and zoom." : `Drag to turn, with Shift to move; the wheel zooms. ${KEYS}`;
const NO_WEBGL = "There is no 3-D view: this browser has no WebGL 2. The picture shows the same part.";
const LOST = "The browser has interrupted the 3-D view; the picture shows the same part.";

// How often the surface of a part with so many points is halved.
function levelOf(points) {
  let level = 0;
  while (level < LEVELS && 2 * points / Math.pow(4, level) > MOST) level += 1;
  return level;
}

function button(words, label, act) {
  const made = make("button", "", words);
  made.type = "button";
  // A sign is no word, so it is not part of the button's text.
  if (label) { made.dataset.sign = words; made.textContent = ""; made.setAttribute("aria-label", label); }
  made.addEventListener("click", act);
  return made;
}

function labelled(element, role, label) {
  element.setAttribute("role", role);
  element.setAttribute("aria-label", label);
  return element;
}

// Adds the view to a picture: a button behind the choice of its layers, and the view in the picture's frame while that is pressed.
// `overlay` has the lines over the picture. While it is not looked at, it asks for nothing and holds nothing.
export function viewOf(picture, overlay, choice) {
  const pointers = new Map();
  const seen = Object.assign({ middle: null, radius: 1 }, FIRST);
  // `part`: what the picture shows; `held`: what was loaded of it; `draws`: what draws it.
  let open = false, near = false, lost = false, moving = false, loading = false, frame = 0, part = null, held = null, draws = null, canvas = null;
  const plate = picture.parentElement.parentElement;
  const place = labelled(make("div", "space"), "application", `the part in 3-D. ${KEYS}`);
  place.tabIndex = 0;
  const help = labelled(make("p", "quiet"), "status", "about the 3-D view");
  const toggle = button("3-D", "", () => { open = !open; lost = false; wake(); });
  const mover = button("Move", "", () => { moving = !moving; tell(); });
  const pad = labelled(make("div", "pad"), "group", "3-D view");
  pad.append(...PAD.map(([sign, label, key]) => button(sign, label, () => act(key, moving))), mover, button("Reset", "", () => act("0")));

  function tell(problem) {
    toggle.setAttribute("aria-pressed", String(open));
    mover.setAttribute("aria-pressed", String(moving));
    for (const one of [place, pad]) one.hidden = !open || lost;
    plate.parentElement.classList.toggle("solid", open && !lost);
    help.textContent = problem || (lost ? LOST : open ? HELP : "");
  }

  function redraw() { if (!frame && draws) frame = requestAnimationFrame(paint); }

  function paint() {
    frame = 0;
    if (!draws) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [wide, high] = [Math.round(place.clientWidth * ratio), Math.round(place.clientHeight * ratio)];
    if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
    const { yaw, tilt, zoom, pan, radius } = seen;
    const [c, s, cos, sin] = [Math.cos(yaw), Math.sin(yaw), Math.cos(tilt), Math.sin(tilt)];
    const [x, y] = [Math.min(1, high / wide), Math.min(1, wide / high)];
    draws.draw({
      turn: [c, s * cos, -s * sin, -s, c * cos, -c * sin, 0, sin, cos], middle: seen.middle || [0, 0, 0],
      fit: [x * zoom / radius, y * zoom / radius, x * pan[0], y * pan[1]], near: 0.25 / radius, ratio,
    });
  }

  function line() {
    if (!draws || !held) return;
    draws.line(linesOn(held.heights, held.mesh, overlay));
    redraw();
  }

  function put() {
    const { heights, mesh } = held;
    draws.put(heights, mesh.triangles, picture, part.stride);
    // The next part lies about where the last one lay: the view stays.
    const off = seen.middle ? Math.hypot(...mesh.middle.map((mm, axis) => mm - seen.middle[axis])) : Infinity;
    if (off > seen.radius / 4 || Math.abs(mesh.radius / seen.radius - 1) > 0.25) Object.assign(seen, { middle: mesh.middle, radius: mesh.radius || 1 });
    line();
  }

  // One request at a time; of the parts that come meanwhile the newest is next.
  async function load() {
    if (loading || !draws || document.hidden) return;
    if (!part) { held = null; draws.clear(); redraw(); return; }
    if (held && held.path === part.path) { put(); return; }
    const { path, points, seq } = part;
    let problem = "";
    loading = true;
    try {
      const answer = await words(`${path}level=${levelOf(points)}`);
      if (draws && part && part.path === path) {
        if (seq && answer.about.seq !== seq) throw new Error("the frames are gone");
        const heights = heightsOf(answer);
        held = { path, heights, mesh: meshOf(heights) };
        put();
      }
    } catch (error) { problem = error.message; }
    loading = false;
    if (part && part.path !== path) load(); else if (open) tell(problem);
  }

  // Begins or ends, as the view is asked for and is on the screen.
  function wake() {
    const on = open && near;
    if (on && !canvas) {
      canvas = make("canvas");
      draws = surface(canvas);
      if (!draws) { canvas = null; open = false; toggle.disabled = true; tell(NO_WEBGL); return; }
      canvas.addEventListener("webglcontextlost", (event) => { if (event.target === canvas) { event.preventDefault(); lost = true; draws = null; tell(); } });
      canvas.addEventListener("webglcontextrestored", (event) => { if (event.target === canvas) { lost = false; draws = surface(canvas); held = null; tell(); load(); } });
      place.append(canvas);
      tell();
      load();
      return;
    }
    if (!on && canvas) {
      const [old, gone] = [canvas, draws];
      canvas = draws = held = null;
      old.remove();
      if (gone) gone.free();
    }
    tell();
  }

  function turn(x, y) {
    seen.yaw += x;
    seen.tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, seen.tilt + y));
  }

  function zoom(factor, at = [0, 0]) {
    const wanted = Math.min(MOST_ZOOM, Math.max(LEAST_ZOOM, seen.zoom * factor));
    seen.pan = seen.pan.map((was, axis) => at[axis] + (was - at[axis]) * wanted / seen.zoom);
    seen.zoom = wanted;
  }

  function move(x, y) { seen.pan = [seen.pan[0] + x, seen.pan[1] + y]; }

  // What a key does, or a button in its place; whether it does something.
  function act(key, shift) {
    const way = WAYS[key];
    if (way && shift) move(MOVE * way[0], MOVE * way[1]);
    else if (way) turn(TURN * way[0], TURN * way[1]);
    else if (key === "+" || key === "=") zoom(ZOOM);
    else if (key === "-") zoom(1 / ZOOM);
    else if (key === "0") { Object.assign(seen, FIRST, { middle: null }); if (held) put(); } else return false;
    redraw();
    return true;
  }

  // A point of the screen: from the middle of the view, in halves of its smaller side.
  function pointOf({ clientX, clientY }) {
    const box = place.getBoundingClientRect(), half = Math.min(box.width, box.height) / 2;
    return [(clientX - box.left - box.width / 2) / half, (box.top + box.height / 2 - clientY) / half];
  }

  // The middle of the pointers, and how far they are apart.
  function grip() {
    const all = Array.from(pointers.values()), [a] = all, b = all[all.length - 1];
    return { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, apart: Math.hypot(a[0] - b[0], a[1] - b[1]) };
  }

  function drag(event) {
    if (!pointers.has(event.pointerId)) return;
    const was = grip();
    pointers.set(event.pointerId, pointOf(event));
    const now = grip(), [x, y] = [now.x - was.x, now.y - was.y];
    if (pointers.size > 1 || moving || event.shiftKey || event.buttons > 1) move(x, y); else turn(1.6 * x, 1.6 * y);
    if (was.apart && now.apart) zoom(now.apart / was.apart, [now.x, now.y]);
    redraw();
  }

  place.addEventListener("pointerdown", (event) => { place.setPointerCapture(event.pointerId); pointers.set(event.pointerId, pointOf(event)); });
  place.addEventListener("pointermove", drag);
  for (const end of ["pointerup", "pointercancel"]) place.addEventListener(end, (event) => pointers.delete(event.pointerId));
  place.addEventListener("contextmenu", (event) => event.preventDefault());
  place.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.pow(ZOOM, -Math.sign(event.deltaY)), pointOf(event)); redraw(); }, { passive: false });
  place.addEventListener("keydown", (event) => { if (!event.ctrlKey && !event.altKey && !event.metaKey && act(event.key, event.shiftKey)) event.preventDefault(); });
  window.addEventListener("resize", redraw);
  document.addEventListener("visibilitychange", load);
  new MutationObserver(line).observe(overlay, { childList: true });
  new IntersectionObserver((entries) => { near = entries[entries.length - 1].isIntersecting; wake(); }).observe(plate);
  overlay.after(place);
  choice.after(toggle);
  plate.after(pad, help);
  tell();

  return {
    // The picture shows another part, or another layer: where its surface is (to be continued by `level=`), its SEQ, how many points it has, and
    // pixels of the camera per pixel of the picture; null: it shows nothing.
    show(shown) { part = shown; load(); },
  };
}
