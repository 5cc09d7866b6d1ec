// Follows the events, and covers the verdict when it may be old: when two of the one-second heartbeats are missed, or the measuring
// task's heartbeat stands still for as long. A CSS animation also covers it after three seconds unless each event restarts it, so the
// cover comes even if these scripts hang or fail.
import { $, text } from "./element.js";

// Two heartbeats of one second, and a margin for the network.
const STALE_MS = 2400;
// A longer pause between two checks means that the page itself slept, as on a closed tablet.
const SLEPT_MS = 1600;

// Takes each snapshot; and the timer of the checks while events are followed.
let shown = () => {}, checking = 0;
const state = { source: null, event: -Infinity, beat: null, beatAt: -Infinity, checked: 0, boot: null, phase: false };
// Time that also passes while the device sleeps: whichever of the two clocks advanced more counts.
let offset = 0, lastMono = performance.now(), lastWall = Date.now();
function now() {
  const mono = performance.now(), wall = Date.now();
  const ahead = (wall - lastWall) - (mono - lastMono);
  if (ahead > 500) offset += ahead;
  lastMono = mono;
  lastWall = wall;
  return mono + offset;
}

function cover(stale, words) {
  document.body.classList.toggle("stale", stale);
  if (!stale) { text("stale-words", ""); return; }
  document.title = "STALE · fringed";
  $("state").dataset.state = "wait";
  text("state-words", "not live");
  text("stale-words", words);
}

function check() {
  if (!checking) return;
  const at = now();
  if (at - state.checked > SLEPT_MS && state.checked > 0) state.event = -Infinity;
  state.checked = at;
  const silent = at - state.event > STALE_MS;
  const still = at - state.beatAt > STALE_MS;
  const seconds = (since) => (since === -Infinity ? "" : ` for ${Math.floor((at - since) / 1000)} s`);
  if (silent) cover(true, `no word from the device${seconds(state.event)}`);
  else if (still) cover(true, `the measuring task's heartbeat stands still${seconds(state.beatAt)}`);
  else cover(false, "");
  // The browser reconnects by itself unless the server refused it.
  if (state.source.readyState === EventSource.CLOSED) {
    window.dispatchEvent(new Event("refused"));
    open();
  }
}

// Restarts the animation of the cover.
function push() {
  state.phase = !state.phase;
  $("stale").className = state.phase ? "one" : "two";
}

function open() {
  state.source = new EventSource("events");
  state.source.addEventListener("snapshot", (event) => {
    const snapshot = JSON.parse(event.data);
    const at = now();
    if (snapshot.boot_id !== state.boot || snapshot.heartbeat !== state.beat) state.beatAt = at;
    state.boot = snapshot.boot_id;
    state.beat = snapshot.heartbeat;
    shown(snapshot);
    // An event counts only after it was shown completely.
    state.event = at;
    state.checked = at;
    if (at - state.beatAt <= STALE_MS) push();
    check();
  });
}

export function follow(show) {
  shown = show;
  open();
  checking = setInterval(check, 400);
  document.addEventListener("visibilitychange", check);
}

// Follows no events until `follow` is called again.
export function leave() {
  clearInterval(checking);
  checking = 0;
  if (state.source) state.source.close();
  document.title = "fringed";
}
