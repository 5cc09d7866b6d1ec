// Stored results with a filter, a page at a time.
import { $, fill, make, show, text } from "./element.js";
import { ask } from "./api.js";
import { count, milliseconds, moment, quantity } from "./number.js";

const PAGE = 50;
const PASS = 1, VALID = 2, LOW = 4;
let oldest = null;
let boot = "";

function filter() {
  const wanted = new URLSearchParams();
  for (const [id, key] of [["filter-recipe", "recipe"], ["filter-verdict", "verdict"], ["filter-part", "part_id"]]) {
    if ($(id).value !== "") wanted.set(key, $(id).value);
  }
  return wanted;
}

function outside(entry) {
  if (entry.reason) return entry.reason;
  const bad = entry.gauges.filter((gauge) => !(gauge.decision & PASS) || !(gauge.decision & VALID));
  return bad.map((gauge) => (gauge.value === null ? `${gauge.name} not measured` : `${gauge.name} ${quantity(gauge.value, gauge.unit)} ${gauge.decision & LOW ? "too low" : "too high"}`)).join(", ");
}

function row(entry) {
  const frames = make("td");
  if (entry.recording) {
    const link = make("a", "", "ZIP");
    link.href = `/api/history/${entry.seq}/recording.zip`;
    link.setAttribute("download", "");
    link.setAttribute("aria-label", `frames of no. ${entry.seq}`);
    frames.append(link);
  }
  const verdict = make("span", `tag ${entry.verdict.toLowerCase()}`, entry.verdict);
  return make("tr", "", make("td", "", String(entry.seq)), make("td", "nowrap", moment(entry, boot)), make("td", "", `${entry.recipe}`), make("td", "", String(entry.part_id)),
    make("td", "", verdict), make("td", "nowrap", milliseconds(entry.total_us)), make("td", "", outside(entry)), frames);
}

async function load(more) {
  const wanted = filter();
  $("history-csv").href = `/api/history.csv?${wanted}`;
  wanted.set("limit", PAGE);
  if (more && oldest !== null) wanted.set("before_seq", oldest);
  try {
    const { results, counts } = await ask("GET", `/api/history?${wanted}`);
    const rows = results.map(row);
    if (more) $("history-rows").append(...rows); else fill($("history-rows"), ...rows);
    if (results.length) oldest = results[results.length - 1].seq;
    show("history-more", results.length === PAGE);
    const all = counts.pass + counts.fail + counts.invalid;
    const share = all ? ` (${(100 * counts.pass / all).toFixed(1)} %)` : "";
    text("history-counts", all ? `${count(all)} results: ${count(counts.pass)} PASS${share}, ${count(counts.fail)} FAIL, ${count(counts.invalid)} INVALID` : "no result passes this filter");
  } catch (error) {
    if (!more) fill($("history-rows"));
    show("history-more", false);
    text("history-counts", error.message);
  }
}

export function openHistory(visible, now) {
  boot = now.boot_id;
  if (visible) load(false);
}

export function start() {
  $("filter").addEventListener("submit", (event) => { event.preventDefault(); load(false); });
  $("history-more").addEventListener("click", () => load(true));
}
