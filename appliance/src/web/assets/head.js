// The head: its live picture, its set-up step by step, and its drift.
import { $, fill, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { moment } from "./number.js";
import { trend } from "./trend.js";
import { openLive, showCamera, showVolume, start as startLive } from "./live.js";
import { showSteps, start as startSteps } from "./steps.js";
import { showGeometry, start as startGeometry } from "./geometry.js";
import { isPlacing } from "./simulation.js";

const EVERY_MS = 500;
let timer = 0;
let visible = false;

// Whether camera and projector are still where they were calibrated, by the last checks.
function showDrift(drift) {
  show("drift", drift);
  if (!drift) return;
  const when = drift.at_unix_s ? ` Checked ${moment({ utc_us: 1e6 * drift.at_unix_s })}.` : "";
  const off = `${drift.epipolar_px.toFixed(2)} px off their epipolar lines, limit ${drift.limit_px.toFixed(2)} px`;
  text("drift-words", drift.drifted
    ? `Camera and projector no longer stand as they were calibrated (${off}).${when}`
    : `Camera and projector stand as they were calibrated (${off}).${when}`);
  text("drift-remedy", drift.remedy ? `What to do: ${drift.remedy}` : "");
  const key = `${drift.trend.length} ${drift.at_unix_s} ${drift.epipolar_px}`;
  if ($("drift-trend").dataset.key === key) return;
  $("drift-trend").dataset.key = key;
  // One check is told by the words above.
  show("drift-chart", drift.trend.length > 1);
  const points = drift.trend.map((point) => ({ value: point.epipolar_px, pass: point.epipolar_px <= drift.limit_px }));
  fill($("drift-trend"), trend(points, { unit: "px", lowest: 0, highest: drift.limit_px }));
  text("drift-caption", `Distance from the epipolar lines in the last ${points.length} checks, the newest at the right; dashed: 0 and the limit, ${drift.limit_px.toFixed(2)} px`);
}

async function refresh() {
  let head;
  try { head = await ask("GET", "api/head"); } catch (error) { head = { open: false, problem: error.message }; }
  show("setup", head.open);
  if (!head.open) {
    show("bare", true);
    text("bare-problem", head.problem);
    text("bare-next", "");
    return;
  }
  openLive(visible, head.running ? head.running.said : "");
  showCamera(head.camera);
  showVolume(head);
  // Nothing begins while a step runs, or while the part that it is to see is not there yet.
  const busy = Boolean(head.running) || head.placing || isPlacing();
  showSteps(head, busy);
  showGeometry(head.geometry, busy);
  showDrift(head.drift);
  for (const line of document.querySelectorAll(".simulated")) line.hidden = !head.simulated;
}

export function openHead(open) {
  clearInterval(timer);
  visible = open;
  openLive(visible);
  if (!visible) return;
  refresh();
  timer = setInterval(refresh, EVERY_MS);
}

// A first visit to a head that is not calibrated starts with its set-up.
export async function lead() {
  if (location.hash) return;
  try {
    const { open, calibrated } = await ask("GET", "api/head");
    if (open && !calibrated && !location.hash) location.replace("#head");
  } catch (gone) { /* The live view says so. */ }
}

export function start() {
  startLive();
  startSteps();
  startGeometry();
  on(window, "head", refresh);
}
