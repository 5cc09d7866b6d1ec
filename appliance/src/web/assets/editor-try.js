// Tries the list before it is stored: what it finds on golden after each change, what is wrong with it, and how it would judge the last parts.
import { $, fill, heading, make, on, scrolling, show, text } from "./element.js";
import { ask } from "./api.js";
import { quantity } from "./number.js";
import { decided, tag } from "./verdict.js";
import { state } from "./editor-list.js";
import { isBarred, needed } from "./session.js";

// A change is tried when nothing was changed for so long, ms. A try on parts has so many of them.
const PAUSE = 300;
const PARTS = 20;
const TRY = "POST /api/recipes/{number}/try";
let timer = 0, turn = 0, onParts = 0, hooks = null;

// The list as a request has it.
export const body = (more) => Object.assign({ fingerprint: state.recipe.fingerprint }, state.list, more);
const send = (more) => ask("POST", `api/recipes/${state.recipe.number}/try`, body(more));

function say(error) {
  show("editor-sign", error.status === 401);
  text("editor-state", error.status === 401 ? "Sign in to see what is found." : error.why === "outdated" ? `${error.message} What you typed is kept.` : `Not tried: ${error.message}`);
}

// The words of a problem, with a way to what it is about.
function problem({ words, refused, at, feature, datum, gauge }) {
  const what = feature !== undefined && feature !== null ? "features" : datum !== undefined && datum !== null ? "datums" : gauge !== undefined && gauge !== null ? "gauges" : "";
  const mark = make("span", "", refused ? "✗ " : "⚠ ");
  if (!what || typeof at !== "number") return make("li", refused ? "bad" : "", mark, words);
  const go = make("button", "plain", words);
  go.type = "button";
  on(go, "click", () => hooks.go(what, at));
  return make("li", refused ? "bad" : "", mark, go);
}

function take(answer) {
  state.found = answer;
  show("editor-sign", false);
  text("editor-state", `Tried on golden in ${answer.ms.toFixed(0)} ms; nothing is stored yet.`);
  fill($("editor-problems"), ...answer.problems.map(problem));
  hooks.found();
}

// Tries the list now; answers whether a PUT would take it, true if that is not known. An older answer is dropped.
export async function tryNow() {
  clearTimeout(timer);
  timer = 0;
  if (isBarred(TRY)) { text("editor-state", `To try it ${needed(TRY)}.`); return true; }
  const mine = turn += 1, { number } = state.recipe;
  try {
    const answer = await send({});
    if (mine !== turn || !state.recipe || state.recipe.number !== number) return true;
    take(answer);
    return !answer.problems.some(({ refused }) => refused);
  } catch (error) {
    if (mine === turn) say(error);
    return true;
  }
}

// Tries the list soon.
export function trySoon() {
  clearTimeout(timer);
  turn += 1;
  text("editor-state", "…");
  timer = setTimeout(() => (onParts ? trySoon() : tryNow()), PAUSE);
}

export function forget() {
  clearTimeout(timer);
  turn += 1;
  fill($("editor-problems"));
  fill($("parts"));
  text("editor-state", "");
}

function partRow(part, names) {
  const head = heading("row", part.seq === null ? "last" : `no. ${part.seq}`);
  if (part.error) {
    const cell = make("td", "bad", part.error);
    cell.colSpan = names.length + 2;
    return make("tr", "", head, cell);
  }
  const word = (verdict) => make("span", `tag ${verdict.toLowerCase()}`, verdict), gauges = names.map((name) => part.gauges.find((one) => one.name === name));
  const cells = gauges.map((one) => make("td", "nowrap", ...(!one ? ["–"] : [one.value === null ? one.reason || "no value" : quantity(one.value, one.unit), " ", tag(decided(one))])));
  const now = make("td", "", word(part.verdict));
  if (part.reason) now.title = part.reason;
  return make("tr", "", head, now, make("td", "", part.before ? word(part.before) : "–"), ...cells);
}

function drawParts(parts) {
  if (!parts.length) { fill($("parts"), make("p", "quiet", "There is no last part, and no part's frames are kept.")); return; }
  const names = state.list.gauges.map(({ name }) => name), judged = parts.filter(({ error }) => !error);
  const count = (key) => judged.filter((part) => part[key] === "PASS").length;
  const words = `${count("verdict")} of ${judged.length} parts would pass by this list; ${count("before")} passed when they were measured.`;
  const head = make("tr", "", ...["Part", "By this list", "Before"].concat(names).map((one) => heading("col", one)));
  fill($("parts"), make("p", "", words), scrolling("values of the last parts by this list", make("thead", "", head), make("tbody", "", ...parts.map((part) => partRow(part, names)))));
}

// Tries the list on the kept parts of this recipe and the last part.
export async function tryParts() {
  const { number } = state.recipe;
  clearTimeout(timer);
  onParts += 1;
  fill($("parts"), make("p", "quiet", "measuring the last parts by this list …"));
  try {
    const { results } = await ask("GET", `api/history?recipe=${number}&limit=200`);
    const kept = results.filter(({ recording }) => recording).map(({ seq }) => seq).slice(0, PARTS);
    const last = await send({ on: "last" });
    const others = kept.filter((seq) => !last.parts.some((part) => part.seq === seq));
    const more = others.length ? await send({ on: others }) : { parts: [] };
    if (state.recipe && state.recipe.number === number) {
      take(last);
      drawParts(last.parts.concat(more.parts));
    }
  } catch (error) {
    fill($("parts"));
    say(error);
  } finally { onParts -= 1; }
}

// `found` is called when a try was answered, `go` shows the feature, datum system or gauge at a place of the list.
export function start(of) { hooks = of; }
