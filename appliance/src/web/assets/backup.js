// Backs the device up, and restores a backup: it is checked, what would come back is shown, and the next start puts it in place.
import { $, cells, fill, heading, make, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { count, moment } from "./number.js";
import { choose } from "./question.js";
import { change, may } from "./session.js";

const PLACE = "api/restore";
const CHOICES = { everything: "Everything", recipes: "Recipes only", calibration: "Calibration only" };
const PRESENT = { same: "the same", other: "another, is replaced", none: "none" };
let visible = false;
let plan = null;
// Whether an answer is awaited.
let busy = false;

const chosen = () => $("plan").elements.what.value;
const ticked = (id) => chosen() === "everything" && $(`plan-${id}`).checked;
const results = (many, last) => (many ? `${count(many)} up to no. ${count(last)}` : "none");

// What comes back of what is chosen: a name, what the backup has, what is here, and a problem.
function lines() {
  const { recipes, removed, calibration, history, users, recordings, configuration_differs: differs } = plan;
  const what = chosen(), all = what === "everything", found = [];
  if (what !== "calibration") {
    for (const { number, name, fingerprint, present, problem } of recipes) found.push([`recipe ${number} · ${name}`, fingerprint.slice(0, 8), PRESENT[present], problem]);
    for (const { number, name } of removed) found.push([`recipe ${number} · ${name}`, "none", "is put aside"]);
  }
  if (what !== "recipes" && calibration) found.push(["calibration", calibration.fingerprint.slice(0, 8), PRESENT[calibration.present]]);
  if (all && history && (plan.same_device || ticked("replaces"))) found.push(["results", results(history.results, history.last), results(history.present_results, history.present_last)]);
  else if (all) found.push(["results", `of ${plan.serial}`, "stay"]);
  if (users && ticked("users")) for (const { name, role, present_role: now } of users) found.push([`user ${name}`, role, now || "none"]);
  if (all && recordings) found.push(["recordings of parts", String(recordings), ""]);
  if (differs) found.push(["configuration", "as fringed.toml", "differs, is not restored"]);
  return found;
}

function row([name, there, here, problem]) {
  return make("tr", "", heading("row", name, ...(problem ? [make("small", "bad", `cannot be used: ${problem}`)] : [])), ...cells(there, here));
}

// Follows what is chosen.
function showLines() {
  const all = chosen() === "everything";
  show("plan-with-users", all && Boolean(plan.users));
  show("plan-replacing", all && !plan.same_device);
  fill($("plan-rows"), ...lines().map(row));
}

function choice({ what, refused }, at, all) {
  const input = Object.assign(make("input"), { type: "radio", name: "what", value: what, required: true, disabled: Boolean(refused) });
  input.checked = at === all.findIndex((one) => !one.refused);
  return make("label", "tick", input, CHOICES[what] + (refused ? `: ${refused}` : ""));
}

function showPlan() {
  const { made_at_unix_s: at, made_by: by, serial, same_device: same, choices } = plan;
  text("plan-made", `Made ${at ? moment({ utc_us: 1e6 * at }) : "at an unknown time"}${by ? ` by ${by}` : ""} of ${same ? "this device" : `another device, ${serial}`}.`);
  text("plan-serial", serial);
  for (const id of ["users", "replaces"]) $(`plan-${id}`).checked = false;
  fill($("plan-choices"), make("legend", "", "What comes back"), ...choices.map(choice));
  showLines();
}

function showState({ checked, ordered, before, restarts }) {
  plan = ordered ? null : checked;
  for (const id of ["plan", "restore-order"]) show(id, plan);
  if (plan) showPlan();
  const what = ordered && (CHOICES[ordered.what] ? `the backup (${CHOICES[ordered.what].toLowerCase()})` : "the state before the last restore");
  text("ordered", ordered ? `At the next start ${what} is put in place, by order of ${ordered.by}.${restarts ? "" : " Restart the device to carry it out."}` : "");
  show("restart", ordered && restarts);
  show("restore-discard", plan || ordered);
  show("before", before && !ordered);
  if (before) text("before-words", `The state before the restore${before.at_unix_ms ? ` of ${moment({ utc_us: 1000 * before.at_unix_ms })}` : ""} is kept.`);
}

async function load() {
  if (busy) return;
  try { showState(visible && may("GET /api/restore") ? await ask("GET", PLACE) : {}); } catch (error) { text("restore-words", error.message); }
}

// Makes a request that answers with the state of restoring, and says meanwhile what is done.
function order(method, path, body, words = "") {
  return change(async () => {
    busy = true;
    text("restore-words", words);
    try { showState(await ask(method, path, body)); } finally { busy = false; }
    text("restore-words", "");
    $("restore").focus({ preventScroll: true });
  }, "", "restore-words");
}

// A link that downloads cannot say why it failed, so whether it may is asked before.
function download() {
  const wanted = ["users", "recordings"].filter((name) => $(`backup-${name}`).checked).map((name) => `${name}=true`);
  change(async () => {
    text("restore-words", "");
    await ask("GET", PLACE);
    Object.assign(make("a"), { href: `api/backup.zip?${wanted.join("&")}`, download: "" }).click();
  }, "", "restore-words");
}

async function undo() {
  const words = `${$("before-words").textContent} It is put back at the next start, in place of what is here then.`;
  if (await choose("Undo the restore?", words, [["Undo it", true]])) order("POST", `${PLACE}/undo`);
}

async function restart() {
  if (!await choose("Restart now?", "Nothing is measured until the program has started again.", [["Restart", true]])) return;
  change(async () => {
    await ask("POST", "api/restart");
    text("restore-words", "the program starts again");
  }, "", "restore-words");
}

export function openBackup(open) {
  visible = open;
  if (!busy) text("restore-words", "");
  load();
}

export function start() {
  on(window, "session", load);
  on($("backup-form"), "submit", download);
  on($("restore-form"), "submit", () => order("POST", PLACE, $("restore-file").files[0], "The file is being sent and checked: this can take minutes."));
  on($("plan"), "submit", () => order("PUT", PLACE, { what: chosen(), users: Boolean(plan.users) && ticked("users"), replaces_device: !plan.same_device && ticked("replaces") }));
  on($("plan"), "change", showLines);
  on($("restore-discard"), "click", () => order("DELETE", PLACE));
  on($("restore-undo"), "click", undo);
  on($("restart"), "click", restart);
}
