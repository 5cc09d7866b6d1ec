// The record of changes: who changed what, filtered, a page at a time.
import { $, fill, make, on, show } from "./element.js";
import { ask } from "./api.js";
import { setDays } from "./history.js";
import { about, moment } from "./number.js";
import { notice } from "./session.js";

let boot = "";
// The filter that is shown, the number of the oldest change that is shown, and whether older pages are.
let asked = "", oldest = null, older = false;
let turn = 0;

// A line of a list, with its time.
export function line(when, words, kind, title) {
  const moment = make("span", "when", when);
  if (title) moment.title = title;
  return make("li", kind || "", moment, make("span", "", words));
}

// "by anna (technician) from 10.0.0.7"; older records know only from where.
function by({ user, role, way, from }) {
  if (user) return `by ${user} (${role}) from ${from}`;
  return way === "plc" ? `by PLC ${from}` : way === "command line" ? `by ${from} at the command line` : `from ${from}`;
}

function row(entry) {
  const { action, subject, outcome, changed } = entry;
  const words = `${action} (${subject}) ${by(entry)}: ${outcome}${changed ? `: ${changed}` : ""}`;
  return line(moment(entry, boot), words, outcome === "done" ? "" : "refused", about(entry));
}

async function load(more) {
  const mine = turn += 1;
  older = more;
  try {
    const { changes, more: left } = await ask("GET", `api/changes?${asked}${more ? `&before=${oldest}` : ""}`);
    if (mine !== turn) return;
    const rows = changes.map(row);
    if (more) $("change-lines").append(...rows);
    else fill($("change-lines"), ...(rows.length ? rows : [line("", asked ? "no change passes this filter" : "nothing was changed yet")]));
    oldest = changes.length ? changes[changes.length - 1].number : null;
    show("changes-more", left && oldest);
  } catch (error) { notice(error.message, true); }
}

// Reads the newest changes again, unless others were asked for.
export function followChanges() { return asked || older ? undefined : load(false); }

export function openChanges(now) {
  boot = now.boot_id;
  older = false;
  if (asked) load(false);
}

export function start() {
  on($("changes"), "submit", () => {
    const wanted = new URLSearchParams();
    for (const key of ["user", "recipe"]) if ($(`changes-${key}`).value.trim()) wanted.set(key, $(`changes-${key}`).value.trim());
    setDays(wanted, "changes");
    asked = String(wanted);
    $("changes-csv").href = `api/changes.csv?${asked}`;
    load(false);
  });
  on($("changes-more"), "click", () => load(true));
}
