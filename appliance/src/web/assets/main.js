// The page: follows the snapshots, and shows each in the view that is open.
import { $, disable, on, show, text } from "./element.js";
import { follow, leave } from "./stale.js";
import { isHeld, isOfOtherRecipe, showVerdict } from "./verdict.js";
import { showGauges } from "./gauges.js";
import { showTimes } from "./times.js";
import { showPicture, start as startPicture } from "./picture.js";
import { list, showRecipes, start as startRecipes } from "./recipes.js";
import { start as startEditor } from "./editor.js";
import { showRegisters, start as startRegisters } from "./registers.js";
import { openDevice, showDevice } from "./journal.js";
import { start as startChanges } from "./changes.js";
import { openUsers, start as startUsers } from "./users.js";
import { openBackup, start as startBackup } from "./backup.js";
import { openHistory, start as startHistory } from "./history.js";
import { openStatistics, start as startStatistics } from "./statistics.js";
import { start as startReport } from "./report.js";
import { openStudies, start as startStudies } from "./studies.js";
import { lead, openHead, start as startHead } from "./head.js";
import { start as startKept } from "./kept.js";
import { start as startQuestion } from "./question.js";
import { showSimulation, start as startSimulation } from "./simulation.js";
import { change, isLocked, open as signIn, refresh, start as startSession } from "./session.js";
import { ask } from "./api.js";
import { changes, count, duration, measures } from "./number.js";

const VIEWS = ["live", "history", "recipes", "registers", "head", "device"];
const STATES = {
  boot: ["starting", "wait"], ready: ["ready", "ready"], acquiring: ["exposing", "busy"], processing: ["computing", "busy"],
  loading: ["loading a recipe", "busy"], teaching: ["teaching", "busy"], offline: ["offline: the PLC has not set ONLINE", "wait"],
  commissioning: ["setting up", "busy"], fault: ["fault", "fault"], stopping: ["stopping", "wait"],
};
// Why a station in state ready accepts no trigger (its READY bit is 0), by REJECT_REASON.
const WAITING = { 3: "no recipe is active", 6: "another recipe is asked for" };
let view = "live";
let last = null;
let shown = null;
let locked = null;

function showCounters(now) {
  for (const name of ["triggers", "missed", "sequence", "buffered"]) text(name, count(now.counters[name]));
  $("missed-cell").classList.toggle("latched", now.missed_trigger);
  const measured = measures(now.result);
  for (const name of ["points", "coverage", "noise", "fitness"]) text(name, measured[name]);
  const notes = now.warnings.map((warning) => `warning: ${warning}`);
  if (now.result && now.result.light && now.warnings.includes("unsteady light")) notes.push(changes(now.result.light));
  if (now.buffer_overflow) notes.push("a result was not queued: the PLC does not acknowledge");
  if (now.warming_up) notes.push("warming up");
  if (now.error && !now.fault) notes.push(`error ${now.error.code}: ${now.error.words}`);
  text("notes", notes.join(" · "));
}

function showSnapshot(now) {
  const restarted = !last || last.boot_id !== now.boot_id;
  last = now;
  const [words, kind] = STATES[now.state] || [now.state, "wait"];
  const waiting = now.state === "ready" && !now.ready;
  $("state").dataset.state = waiting ? "wait" : kind;
  const why = now.calibration_valid ? WAITING[now.refusal && now.refusal.reason] : "uncalibrated";
  const loading = now.load && `${words}: ${now.load.words}, ${Math.round(100 * now.load.fraction)} %`;
  text("state-words", waiting ? why || "not ready" : loading || words);
  show("refusal", waiting);
  text("refusal", waiting ? `No trigger is accepted: ${now.refusal.words}.` : "");
  disable($("trigger"), !now.ready);
  show("fault", now.fault);
  if (now.fault) {
    text("fault-code", `${now.fault.code} · ${now.fault.family}`);
    text("fault-cause", now.fault.cause);
    text("fault-remedy", now.fault.remedy);
  }
  showVerdict(now);
  showCounters(now);
  showRecipes(now, view === "recipes");
  showDevice(now, view === "device");
  showSimulation(now);
  // Times that were recorded without a synchronised clock are relative to the start of the program, so the lists are read again when
  // BOOT_ID is known or has changed. The session may have ended with the program.
  if (restarted) {
    refresh();
    openLists(now);
  }
  const key = `${now.boot_id}/${now.result ? now.result.seq : "none"}`;
  if (key !== shown) {
    shown = key;
    showGauges(now.result, now.boot_id);
    showTimes(now.result);
  }
  showPicture(now.result, view === "live");
  text("identity", `${now.identity.product} · ${now.identity.serial} · ${now.identity.version}`);
  text("uptime", `up ${duration(now.uptime_s)} · heartbeat ${now.heartbeat}`);
  const live = now.result && (isHeld(now) || (now.ready && !isOfOtherRecipe(now)));
  document.title = `${live ? now.result.verdict : words} · fringed`;
}

function openLists(now) {
  for (const open of [openHistory, openStatistics, openStudies]) open(view === "history", now);
  for (const open of [openDevice, openUsers, openBackup]) open(view === "device", now);
}

function openView() {
  const wanted = location.hash.slice(1);
  if (!locked && wanted && !VIEWS.includes(wanted)) return;
  view = locked ? "" : wanted || "live";
  document.body.dataset.view = view;
  for (const name of VIEWS) show(`view-${name}`, name === view);
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash === `#${view}`) link.setAttribute("aria-current", "page"); else link.removeAttribute("aria-current");
  }
  if (view === "recipes") list();
  showRegisters(view === "registers");
  openHead(view === "head");
  if (last) {
    openLists(last);
    showPicture(last.result, view === "live");
    showDevice(last, view === "device");
  }
}

// Shows the page, or only the form to sign in while nothing may be looked at without. Then nothing is asked of the device.
function admit() {
  if (isLocked() === locked) return;
  locked = isLocked();
  document.body.classList.toggle("locked", locked);
  openView();
  if (locked) {
    leave();
    signIn(null);
  } else {
    follow(showSnapshot);
    lead();
  }
}

startQuestion();
startPicture();
startRecipes();
startEditor();
startRegisters();
startSimulation();
startHistory();
startKept();
startStatistics();
startReport(() => last);
startStudies();
startHead();
startChanges();
startUsers();
startBackup();
on($("trigger"), "click", () => change(() => ask("POST", "api/trigger")));
on($("reset"), "click", () => change(() => ask("POST", "api/reset"), "errors are reset"));
on(window, "hashchange", openView);
on(window, "recipes", list);
startSession().then(() => {
  on(window, "session", admit);
  admit();
});
