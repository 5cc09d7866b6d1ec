// Stored results, filtered, a page at a time.
import { $, button, cells, fill, label, make, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { openKept } from "./kept.js";
import { about, count, milliseconds, moment } from "./number.js";
import { decided, wrong } from "./verdict.js";

const PAGE = 50;
let oldest = null;
let boot = "";
let seen = false;
// What a chart has chosen, in place of dates.
let chosen = null;

// The beginning of the day of a field in the browser's time zone, or of the day `more` days later, µs since 1970 UTC.
function day(value, more) {
  const [year, month, date] = value.split("-").map(Number);
  return 1000 * Math.max(0, new Date(year, month - 1, date + more).getTime());
}

// Adds the days of a filter to a query.
export function setDays(wanted, id) {
  const [from, to] = [$(`${id}-from`).value, $(`${id}-to`).value];
  if (from) wanted.set("since_us", day(from, 0));
  if (to) wanted.set("until_us", day(to, 1));
}

function filter() {
  const wanted = new URLSearchParams();
  for (const [id, key] of [["filter-recipe", "recipe"], ["filter-verdict", "verdict"], ["filter-part", "part_id"]]) {
    if ($(id).value !== "") wanted.set(key, $(id).value);
  }
  if (chosen) {
    for (const key of Object.keys(chosen.keys)) wanted.set(key, chosen.keys[key]);
    return wanted;
  }
  setDays(wanted, "filter");
  return wanted;
}

function outside(entry) {
  if (entry.reason) return entry.reason;
  const bad = entry.gauges.filter((gauge) => !decided(gauge).pass);
  return bad.map((gauge) => `${gauge.name} ${wrong(gauge, decided(gauge))}`).join(", ");
}

function row(entry) {
  const frames = make("td");
  if (entry.recording) {
    const link = make("a", "", "ZIP");
    link.href = `api/history/${entry.seq}/recording.zip`;
    link.setAttribute("download", "");
    frames.append(label(link, `ZIP: frames of no. ${entry.seq}`));
  }
  const verdict = make("span", `tag ${entry.verdict.toLowerCase()}`, entry.verdict);
  const open = label(button(String(entry.seq), "open", () => openKept(entry.seq, boot)), `show no. ${entry.seq}`);
  const when = make("td", "nowrap", moment(entry, boot));
  when.title = about(entry);
  return make("tr", "", ...cells(open), when, ...cells(`${entry.recipe}`, String(entry.part_id), verdict), make("td", "nowrap", milliseconds(entry.total_us)), make("td", "", outside(entry)), frames);
}

async function load(more) {
  const wanted = filter();
  $("history-csv").href = `api/history.csv?${wanted}`;
  wanted.set("limit", PAGE);
  if (more && oldest !== null) wanted.set("before_seq", oldest);
  try {
    const { results, counts, undated } = await ask("GET", `api/history?${wanted}`);
    const rows = results.map(row);
    if (more) $("history-rows").append(...rows); else fill($("history-rows"), ...rows);
    if (results.length) oldest = results[results.length - 1].seq;
    show("history-more", results.length === PAGE);
    const all = counts.pass + counts.fail + counts.invalid;
    const share = all ? ` (${(100 * counts.pass / all).toFixed(1)} %)` : "";
    const notes = [all ? `${count(all)} results: ${count(counts.pass)} PASS${share}, ${count(counts.fail)} FAIL, ${count(counts.invalid)} INVALID` : "no result passes this filter"];
    if (undated) notes.push(`${count(undated)} left out because their time is not known`);
    if (results.some(about)) notes.push("≈ time from the browser of a signed-in user");
    text("history-counts", notes.join(" · "));
  } catch (error) {
    if (!more) fill($("history-rows"));
    show("history-more", false);
    text("history-counts", error.message);
  }
}

// Lists the results of a recipe that a chart has chosen, in words and as keys of a query.
export function listRange(recipe, keys, words) {
  chosen = { keys, words };
  for (const id of ["filter-verdict", "filter-part", "filter-from", "filter-to"]) $(id).value = "";
  $("filter-recipe").value = recipe;
  range();
  load(false);
  $("history-title").scrollIntoView({ block: "start" });
  $("history-csv").focus({ preventScroll: true });
}

function range() {
  show("filter-range", chosen);
  text("filter-range-words", chosen ? `from the chart: ${chosen.words}` : "");
}

export function showResult(seq) { return openKept(seq, boot); }

export function openHistory(visible, now) {
  boot = now.boot_id;
  seen = visible;
  if (visible) load(false);
}

export function start() {
  on($("filter"), "submit", () => load(false));
  on($("filter-range-drop"), "click", () => { chosen = null; range(); load(false); });
  on($("history-more"), "click", () => load(true));
  on(window, "dated", () => { if (seen) load(false); });
}
