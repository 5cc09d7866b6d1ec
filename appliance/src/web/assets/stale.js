// Follows the events, and never trusts what the page shows: when the one-second heartbeat is missed twice, or the
// measuring task's heartbeat stands still for as long, the verdict is covered. The cover also comes by itself, by CSS,
// unless a whole event pushes it back: also when these scripts hang or fail.
import { $, text } from "./element.js";

// Two beats of one second and what a network may be late by.
const STALE_MS = 2400;
// The page itself slept (a closed tablet): what it shows is as old as its sleep.
const SLEPT_MS = 1600;

const state = { source: null, event: -Infinity, beat: null, beatAt: -Infinity, checked: 0, boot: null, phase: false };
// Time that also passes while the device sleeps; the larger step of both clocks counts.
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
  const at = now();
  if (at - state.checked > SLEPT_MS && state.checked > 0) state.event = -Infinity;
  state.checked = at;
  const silent = at - state.event > STALE_MS;
  const still = at - state.beatAt > STALE_MS;
  const seconds = (since) => (since === -Infinity ? "" : ` for ${Math.floor((at - since) / 1000)} s`);
  if (silent) cover(true, `no word from the sensor${seconds(state.event)}`);
  else if (still) cover(true, `the measuring task's heartbeat stands still${seconds(state.beatAt)}`);
  else cover(false, "");
  // The browser reconnects by itself unless the server refused it.
  if (state.source.readyState === EventSource.CLOSED) open();
}

// Begins the time of the cover anew.
function push() {
  state.phase = !state.phase;
  $("stale").className = state.phase ? "one" : "two";
}

let shown = () => {};
function open() {
  state.source = new EventSource("/events");
  state.source.addEventListener("snapshot", (event) => {
    const snapshot = JSON.parse(event.data);
    const at = now();
    if (snapshot.boot_id !== state.boot || snapshot.heartbeat !== state.beat) state.beatAt = at;
    state.boot = snapshot.boot_id;
    state.beat = snapshot.heartbeat;
    shown(snapshot);
    // Only what was shown whole counts as fresh.
    state.event = at;
    state.checked = at;
    if (at - state.beatAt <= STALE_MS) push();
    check();
  });
}

export function follow(show) {
  shown = show;
  open();
  setInterval(check, 400);
  document.addEventListener("visibilitychange", check);
}
