// The steps from a bare head to the first recipe: each can be run, and says what it found and what to do.
import { $, disable, fill, make, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { change, needs, notice } from "./session.js";
import { moment } from "./number.js";
import { exposure } from "./live.js";
import { teachNext } from "./recipes.js";

const NAMES = ["devices", "aim", "exposure", "timing", "geometry", "plane", "teach", "empty"];
// The last one may be left out.
const NEEDED = NAMES.length - 1;
const STATES = { open: ["", "to do"], running: ["…", "running"], done: ["✓", "done"], failed: ["✗", "failed"] };
const state = { next: "", ended: "", states: {} };

const title = (name) => $(`step-${name}`).querySelector("h3").textContent;
const order = (name, body) => ask("POST", `api/head/steps/${name}`, body);

// The check length that is typed; none if there is none.
function solving() {
  const field = $("board-length");
  if (!field.reportValidity()) return null;
  return Object.assign({ action: "solve" }, field.value === "" ? {} : { check_length_mm: Number(field.value) });
}

async function run(name) {
  const body = name === "exposure" ? exposure(true) : name === "geometry" ? solving() : {};
  if (!body) return;
  await change(() => (name === "teach" ? teachNext() : order(name, body)));
  window.dispatchEvent(new Event("head"));
}

// Says so when a step has ended.
function announce(step) {
  const before = state.states[step.name];
  state.states[step.name] = step.state;
  if (before !== "running" || !["done", "failed"].includes(step.state)) return;
  const failed = step.state === "failed";
  notice(`${title(step.name)}: ${failed ? step.remedy || step.said.join("; ") : STATES[step.state][1]}`, failed);
  if (failed) $(`step-${step.name}`).open = true;
}

function showStep(step, running, busy) {
  const place = $(`step-${step.name}`);
  const now = running && running.step === step.name ? running : null;
  const [mark, words] = STATES[step.state];
  place.dataset.state = step.state;
  place.querySelector(".tick").textContent = mark;
  place.querySelector(".is").textContent = words;
  const key = JSON.stringify(step.said);
  const said = place.querySelector(".said");
  if (said.dataset.key !== key) {
    said.dataset.key = key;
    fill(said, ...step.said.map((line) => make("li", "", line)));
  }
  place.querySelector(".remedy").textContent = step.remedy ? `What to do: ${step.remedy}` : "";
  const bar = place.querySelector(".bar");
  bar.hidden = !now;
  bar.value = now ? now.share : 0;
  place.querySelector(".now").textContent = now ? now.said : "";
  place.querySelector(".at").textContent = step.at_unix_s ? `last run ${moment({ utc_us: 1e6 * step.at_unix_s })}` : "";
  for (const button of place.querySelectorAll("button:not(.open, .end)")) disable(button, busy);
  place.querySelector(".end").hidden = !now;
  announce(step);
}

// The next step, if there is one: the first that is not done, on a calibrated head only teaching. It is opened when it becomes the next. The
// step before it stays open with what it has found, the one before that is folded; what somebody opens or closes stays so.
function advance({ calibrated, steps, problem }) {
  const next = steps.find((step) => step.name !== "empty" && step.state !== "done" && (!calibrated || step.name === "teach"));
  const name = next ? next.name : "";
  show("bare", !calibrated);
  text("bare-problem", (problem || "").replace(/`/g, ""));
  text("bare-next", next ? `step ${NAMES.indexOf(name) + 1} of ${NEEDED}, ${title(name)}` : "");
  if (name === state.next) return;
  if (state.ended && state.ended !== name) $(`step-${state.ended}`).open = false;
  state.ended = state.next;
  state.next = name;
  if (next) $(`step-${name}`).open = true;
}

export function showSteps(head, busy) {
  for (const step of head.steps) showStep(step, head.running, busy);
  text("setup-words", head.running ? `${title(head.running.step)} is running: ${head.running.said}` : "");
  advance(head);
}

// What each step shows besides its own words.
function furnish(name, at) {
  const place = $(`step-${name}`);
  const summary = place.querySelector("summary");
  summary.prepend(make("span", "number", String(at + 1)));
  const tick = make("span", "tick");
  tick.setAttribute("aria-hidden", "true");
  summary.append(make("span", "state", tick, " ", make("span", "is")));
  const act = place.lastElementChild;
  act.className = "strong";
  on(act, "click", () => run(name));
  needs(act, `POST /api/${name === "teach" ? "recipes/{number}/teach" : "head/steps/{name}"}`);
  const bar = make("progress", "bar");
  bar.max = 1;
  bar.setAttribute("aria-label", `how far ${title(name)} is`);
  const end = make("button", "end", "Stop this step");
  end.type = "button";
  end.hidden = true;
  on(end, "click", () => change(() => ask("DELETE", `api/head/steps/${name}`)));
  needs(end, "DELETE /api/head/steps/{name}");
  for (const part of [make("ul", "said"), make("p", "remedy"), bar, make("p", "now quiet"), end]) place.insertBefore(part, act);
  place.append(make("span", "at quiet"));
}

export function start() {
  NAMES.forEach(furnish);
  on($("bare-next"), "click", () => {
    const place = $(`step-${state.next}`);
    place.open = true;
    place.querySelector("summary").focus({ preventScroll: true });
    place.scrollIntoView({ block: "start" });
  });
}
