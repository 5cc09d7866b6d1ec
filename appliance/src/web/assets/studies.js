// Guided studies: begins one, asks for part, appraiser and trial one after the other, and shows the report.
import { $, button, cells, fill, heading, label, make, on, scrolling, show, text } from "./element.js";
import { ask } from "./api.js";
import { change, needs, notice } from "./session.js";
import { choose } from "./question.js";
import { quantity } from "./number.js";

const EVERY_MS = 500;
let visible = false;
let timer = 0;
// The study that is open, and what its table was made of.
let open = null;
let made = "";

const path = (number, what = "") => `api/studies/${number}${what}`;

async function list() {
  const { studies } = await ask("GET", "api/studies");
  show("study-list", studies.length > 0);
  fill($("study-rows"), ...studies.map((study) => {
    const look = label(button(String(study.number), "open", () => openStudy(study.number)), `open study ${study.number}`);
    const drop = label(button("Delete", "", () => change(() => remove(study))), `Delete study ${study.number}`);
    const words = study.error ? [study.error, "", ""] : [study.name, String(study.recipe), `${study.taken} of ${study.all}`];
    return make("tr", "", ...cells(look, ...words), make("td", "actions", needs(drop, "DELETE /api/studies/{number}")));
  }));
}

async function remove({ number, name }) {
  const words = `"${name}": its values are lost, and its results count for the process again.`;
  if (!await choose(`Delete study ${number}?`, words, [["Delete", true]])) return;
  await ask("DELETE", path(number));
  if (open && open.number === number) close();
  list();
}

function close() {
  open = null;
  clearInterval(timer);
  show("study", false);
}

// The gauges of the recipe, to be chosen.
async function gauges() {
  const { gauges: all } = await ask("GET", `api/recipes/${$("study-recipe").value}`);
  fill($("study-slots"), make("legend", "", "Gauges"), ...all.map(({ slot, name }) => {
    const tick = make("input");
    tick.type = "checkbox";
    tick.value = String(slot);
    tick.checked = true;
    return make("label", "tick", tick, ` ${name}`);
  }));
}

async function begin() {
  const parts = Array.from({ length: Number($("study-parts").value) }, (_, at) => String(at + 1));
  const appraisers = $("study-appraisers").value.split(",").map((name) => name.trim());
  const slots = Array.from(document.querySelectorAll("#study-slots input:checked"), (tick) => Number(tick.value));
  const { number } = await ask("POST", "api/studies", {
    name: $("study-name").value.trim(), recipe: Number($("study-recipe").value), slots, parts, appraisers, trials: Number($("study-trials").value),
  });
  await list();
  openStudy(number);
}

// One cell of the table: what was taken, and a way to take it again.
function cell(study, of, words) {
  const taken = study.taken.find(({ of: other }) => other.part === of.part && other.appraiser === of.appraiser && other.trial === of.trial);
  const now = study.next && study.next.part === of.part && study.next.appraiser === of.appraiser && study.next.trial === of.trial;
  if (!taken) return make("td", now ? "now" : "", now ? "next" : "·");
  const again = label(button(String(taken.seq), "open", () => change(() => run(of))), `result ${taken.seq}: take ${words} again`);
  again.title = "take this trial again";
  return make("td", now ? "now" : "", needs(again, "POST /api/studies/{number}/{name}"));
}

function table(study) {
  const { parts, appraisers, trials } = study.asked;
  const columns = appraisers.flatMap((name, appraiser) => Array.from({ length: trials }, (_, trial) => ({ appraiser, trial, words: `${name ? `${name} ` : ""}${trial + 1}` })));
  const head = make("tr", "", ...["Part", ...columns.map(({ words }) => words)].map((words) => heading("col", words)));
  const rows = parts.map((name, part) => make("tr", "", make("td", "", name), ...columns.map(({ appraiser, trial, words }) => cell(study, { part, appraiser, trial }, `part ${name}, ${words},`))));
  fill($("study-table"), make("thead", "", head), make("tbody", "", ...rows));
}

function showStudy(study) {
  open = study;
  const done = study.taken.length === study.all && !study.running;
  text("study-title", `${study.number}: ${study.asked.name}`);
  text("study-next", done ? "All trials were taken." : `${study.running ? "Now" : "Next"}: ${study.words}`);
  text("study-how", study.running ? "Place the part, then trigger: here, or as the line does. The next result is taken for this trial." : "");
  text("study-note", study.note || "");
  $("study-bar").value = study.taken.length / study.all;
  text("study-count", `${study.taken.length} of ${study.all} trials`);
  text("study-run", study.running ? "Pause" : study.taken.length ? "Go on" : "Start");
  show("study-run", !done);
  show("study-trigger", study.running);
  show("study-csv", study.taken.length > 0);
  $("study-csv").href = path(study.number, "/values.csv");
  const key = JSON.stringify([study.number, study.taken.map(({ of, seq }) => [of, seq]), study.next]);
  if (key === made) return;
  made = key;
  list().catch(() => {});
  table(study);
  if (study.taken.length === study.all) report(study.number); else fill($("study-report"));
}

async function run(again) {
  showStudy(await ask("POST", path(open.number, "/run"), again ? { again } : {}));
  $("study-next").scrollIntoView({ block: "center" });
}

const digits = (number, many = 4) => (number === null ? "not defined" : number === 0 ? "0" : Math.abs(number) < 1e-4 ? number.toExponential(2) : String(Number(number.toPrecision(many))));
const TAGS = { fit: "pass", "not fit": "fail" };

function rows(name, head, lines) {
  return scrolling(name, make("thead", "", make("tr", "", ...head.map((one) => heading("col", one)))), make("tbody", "", ...lines.map((words) => make("tr", "", ...cells(...words)))));
}

function judged(study) {
  const { characteristic, unit, judgement, anova, components, prediction, model, ndc, ndc_unrounded } = study;
  const verdict = make("span", `tag ${TAGS[judgement.verdict] || "invalid"}`, judgement.verdict);
  const facts = [`ndc ${digits(ndc)} (${digits(ndc_unrounded)})`, model];
  const ev = components.find(({ name }) => name === "EV");
  if (prediction) facts.push(`predicted σ ${quantity(prediction.sigma, unit, 1)}${prediction.u === null ? "" : `, U ${quantity(prediction.u, unit, 1)}`}; EV ${quantity(ev.sigma, unit, 1)} ${prediction.agrees ? "agrees with it" : "disagrees with it"} (p ${digits(prediction.p, 2)})`);
  const of = (share) => (share === null ? "–" : share.toFixed(2));
  const section = make("section", "", make("h3", "", `${characteristic} `, verdict), make("p", "", judgement.reasons.join(" · ")), make("p", "quiet", facts.join(" · ")));
  // Without any scatter there is nothing to divide.
  if (ndc === null) return section;
  const table = rows(`analysis of variance of ${characteristic}`, ["Source", "df", "SS", "MS", "F", "p"], anova.map(({ source, df, ss, ms, f, p }) => [source, String(df), digits(ss), ...[ms, f, p].map((one) => (one === null ? "" : digits(one)))]));
  section.append(rows(`components of ${characteristic}`, ["Component", `σ (${unit || "%"})`, "% of study", "% of tolerance"], components.map(({ name, sigma, of_study, of_tolerance }) => [name, quantity(sigma, unit, 1, true), of(of_study), of(of_tolerance)])),
    make("details", "", make("summary", "", "Analysis of variance"), table));
  return section;
}

async function report(number) {
  try {
    const { studies } = await ask("GET", path(number, "/report.json"));
    fill($("study-report"), ...studies.map(judged));
  } catch (error) { fill($("study-report"), make("p", "bad", error.message)); }
}

// The study that is open, for a report.
export function asked() { return { ...open.asked, number: open.number }; }

async function refresh() {
  if (!open) return;
  try { showStudy(await ask("GET", path(open.number))); } catch (error) { text("study-note", error.message); }
}

async function openStudy(number) {
  made = "";
  showStudy(await ask("GET", path(number)));
  show("study", true);
  $("study").focus();
  follow();
}

function follow() {
  clearInterval(timer);
  if (visible && open) timer = setInterval(refresh, EVERY_MS);
}

export function openStudies(open_view, now) {
  if (open_view !== visible && open_view) {
    const active = now.recipe && now.recipe.number;
    if (active && !$("study-recipe").value) $("study-recipe").value = String(active);
    list().catch((error) => notice(error.message, true));
    if ($("study-recipe").value) gauges().catch(() => fill($("study-slots")));
  }
  visible = open_view;
  follow();
}

export function start() {
  on($("study-recipe"), "change", () => gauges().catch((error) => { fill($("study-slots")); notice(error.message, true); }));
  on($("study-begin"), "submit", () => change(begin));
  on($("study-close"), "click", close);
  on($("study-run"), "click", () => change(async () => {
    if (open.running) showStudy(await ask("POST", path(open.number, "/pause"))); else await run(null);
  }));
  on($("study-trigger"), "click", () => change(() => ask("POST", "api/trigger")));
}
