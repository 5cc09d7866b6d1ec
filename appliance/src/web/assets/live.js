// The live picture of the head: each is asked for when the one before is shown, so nothing is exposed unless somebody looks.
import { $, disable, draw, fill, make, on, show, text } from "./element.js";
import { ask, picture } from "./api.js";
import { signed } from "./number.js";
import { change, isSignedIn, may, needed, notice, open } from "./session.js";

const PICTURE = "GET /api/head/live";
// Until it is asked again, while the head is busy with something else, ms.
const RETRY_MS = 400;
// Largest share of saturated pixels and least brightness under white, as shares of full scale: the doctor's limits.
const SATURATED = 0.01, DARK = 0.2;
// Contrast of fringes below which the doctor rejects the focus.
const BLURRED = 0.5;
// Share of the contrast per pixel at the steepest edge, above which the camera is in focus.
const SHARP = 0.2;
// Whole refreshes of the projector that are offered as exposures.
const REFRESHES = [1, 2, 3, 4, 5, 6, 8, 10, 12];
// Pictures over which the rate is shown.
const RECENT = 8;

const state = { visible: false, busy: "", turn: 0, shown: [], edited: false, refresh_us: 0, best: {}, edge: null };
const pause = (ms) => new Promise((done) => { setTimeout(done, ms); });
const isWanted = () => state.visible && !state.busy && !document.hidden && may(PICTURE);
const percent = (share, places) => `${(100 * share).toFixed(places)} %`;

function drawHistogram({ histogram, saturated, brightest }) {
  const most = Math.max(1, ...histogram), wide = 256 / histogram.length;
  // Square roots, so that a few bright pixels can be seen beside many dark ones.
  fill($("histogram"), ...histogram.map((pixels, at) => {
    const high = 72 * Math.sqrt(pixels / most);
    const kind = at === histogram.length - 1 && saturated > 0 ? "over" : "bar";
    return draw("rect", { x: at * wide, y: 72 - high, width: wide * 0.86, height: high, class: kind });
  }));
  $("histogram").setAttribute("aria-label", `histogram: the brightest pixels are at ${percent(brightest, 0)} of full scale`);
}

function showBest(id, value, best) { fill($(id), value, make("small", "", `best ${best}`)); }

// The contrast of fringes, and the best since the page was opened: the one to come back to while a lens is turned.
function showContrast(pitch, contrast) {
  if (contrast === null) return;
  // A response that is not linear may give more than the whole contrast.
  const known = Math.min(1, contrast);
  state.best[pitch] = Math.max(known, state.best[pitch] || 0);
  showBest(`live-fringes${pitch}`, percent(known, 0), percent(state.best[pitch], 0));
}

// The width of the sharpest edge, and the least so far with the same projection.
function showEdge({ show: shown, sharpness }) {
  if (shown !== "white" && shown !== "focus") return;
  if (shown === "white") state.edge = sharpness;
  state.best[shown] = Math.max(sharpness, state.best[shown] || 0);
  const width = (share) => (share > 0 ? `${(1 / share).toFixed(1)} px` : "–");
  showBest("live-edge", width(sharpness), width(state.best[shown]));
}

function advice(figures) {
  const { show: shown, saturated, brightest } = figures;
  if (shown === "white" && saturated > SATURATED) return "Too bright: shorten the exposure or lower the gain until no pixel of the part is red.";
  if (shown === "white" && brightest < DARK) return "Too dark: lengthen the exposure, or lay something bright into the picture.";
  if (shown === "white") return "The sharpest edge of something printed tells the focus of the camera alone: turn the camera's lens until it is narrowest.";
  const contrast = shown === "fringes8" ? figures.modulation_8 : shown === "fringes12" ? figures.modulation_12 : null;
  if (contrast === null) return "";
  if (contrast >= BLURRED) return "The fringes are sharp enough. Turn the projector's lens until their contrast is highest.";
  if (state.edge === null) return "The fringes are blurred. Project white on something printed to see whether it is the camera.";
  return state.edge >= SHARP ? "The fringes are blurred but edges under white are sharp: focus the projector." : "The fringes are blurred, and edges under white are, too: project white on something printed and focus the camera first.";
}

function showRate() {
  state.shown = state.shown.concat(performance.now()).slice(-RECENT);
  const count = state.shown.length - 1;
  text("live-rate", count > 1 ? `${(1000 * count / (state.shown[count] - state.shown[0])).toFixed(1)} pictures/s` : "");
}

// Offers the exposures of a camera, and fills in the one in use unless somebody is changing it.
export function showCamera({ refresh_us, exposure_us, gain, least_gain, adjustable }) {
  $("live-gain").min = String(least_gain);
  if (refresh_us !== state.refresh_us) {
    state.refresh_us = refresh_us;
    const offered = REFRESHES.map((refreshes) => refreshes * refresh_us).concat(exposure_us);
    const once = offered.filter((us, at) => offered.findIndex((other) => Math.abs(other - us) < refresh_us / 8) === at).sort((a, b) => a - b);
    fill($("live-exposure"), ...once.map((us) => new Option(`${(us / 1000).toFixed(1)} ms`, us)));
  }
  for (const field of $("live-form").querySelectorAll(".exposing")) disable(field, !adjustable);
  if (state.edited) return;
  const options = Array.from($("live-exposure").options);
  const chosen = options.find((option) => Math.abs(option.value - exposure_us) < refresh_us / 8);
  if (chosen) $("live-exposure").value = chosen.value;
  $("live-gain").value = String(gain);
}

// The outlines of the measuring volume, each with a label in a corner of its own.
export function showVolume({ volume, camera }) {
  show("live-outlined", volume.length > 0);
  const key = JSON.stringify(volume);
  if ($("live-volume").dataset.key === key) return;
  $("live-volume").dataset.key = key;
  $("live-volume").setAttribute("viewBox", `0 0 ${camera.columns} ${camera.rows}`);
  const size = camera.columns / 28;
  // Below right, above left and below left.
  const corners = [([x, y]) => x + y, ([x, y]) => -x - y, ([x, y]) => y - x];
  fill($("live-volume"), ...volume.flatMap(({ z_mm, points }, at) => {
    const far = corners[at % 3];
    const [x, y] = points.reduce((best, point) => (far(point) > far(best) ? point : best));
    const label = draw("text", {
      x: at === 0 ? x - size / 3 : x + size / 3, y: at === 1 ? y + 1.2 * size : y - size / 2, "font-size": size, "text-anchor": at === 0 ? "end" : "start",
    }, `z = ${signed(z_mm, 0)} mm`);
    return [draw("polygon", { points: points.map((point) => point.join(",")).join(" "), class: z_mm === 0 ? "plane" : "end" }), label];
  }));
}

// Shows the picture at a path on a canvas, in place of words.
export async function showPicture(canvas, words, path) {
  const bitmap = await picture(path);
  const place = $(canvas);
  if (place.width !== bitmap.width || place.height !== bitmap.height) {
    place.width = bitmap.width;
    place.height = bitmap.height;
  }
  place.getContext("2d").drawImage(bitmap, 0, 0);
  show(words, false);
}

async function next(turn) {
  await showPicture("live-picture", "live-words", `api/head/live?show=${$("live-show").value}`);
  const figures = await ask("GET", "api/head/live/figures");
  if (turn !== state.turn) return;
  $("live-picture").dataset.number = figures.number;
  drawHistogram(figures);
  text("live-saturated", percent(figures.saturated, 2));
  showContrast(8, figures.modulation_8);
  showContrast(12, figures.modulation_12);
  showEdge(figures);
  text("live-advice", advice(figures));
  showRate();
}

function stop(words) {
  state.shown = [];
  text("live-rate", "");
  text("live-words", words);
  show("live-words", words);
}

async function follow() {
  const turn = state.turn += 1;
  show("live-locked", !may(PICTURE));
  show("live-open", may(PICTURE));
  show("live-sign", !isSignedIn());
  text("live-needs", `The live picture ${needed(PICTURE)}.`);
  stop(state.busy);
  while (turn === state.turn && isWanted()) {
    try { await next(turn); } catch (error) {
      if (turn !== state.turn) return;
      stop(error.message);
      if (error.status === 401 || error.role) return;
      await pause(RETRY_MS);
    }
  }
}

// Exposure and gain as in the fields; nothing if they cannot be set or are no numbers.
export function exposure(keep) {
  if ($("live-gain").disabled) return {};
  if (!$("live-form").reportValidity()) return null;
  return { exposure_us: Number($("live-exposure").value), gain: Number($("live-gain").value), keep };
}

function expose(keep) {
  const wanted = exposure(keep);
  if (!wanted) return;
  change(async () => {
    await ask("POST", "api/head/steps/exposure", wanted);
    state.edited = false;
    notice(keep ? "exposure and gain are kept" : "exposure and gain are tried");
  });
}

// Shows pictures while the view is open, unless the head is busy with what the words say.
export function openLive(visible, busy = "") {
  if (visible === state.visible && busy === state.busy) return;
  state.visible = visible;
  state.busy = busy;
  follow();
}

export function start() {
  on(document, "visibilitychange", follow);
  on(window, "session", follow);
  on($("live-sign"), "click", () => open(null));
  for (const field of $("live-form").querySelectorAll(".exposing")) on(field, "input", () => { state.edited = true; });
  on($("live-form"), "submit", () => expose(false));
  on($("live-outline"), "change", () => { $("live-volume").toggleAttribute("hidden", !$("live-outline").checked); });
  on($("live-keep"), "click", () => expose(true));
}
