// Reports for print and PDF by the browser: one part, a period, a study. Each page names the device, the recipe, the calibration, the
// program, who printed it and when, and its number; browsers without margin boxes say it on the first page only.
import { $, fill, make, on } from "./element.js";
import { ask } from "./api.js";
import { kept } from "./kept.js";
import { date } from "./number.js";
import { enter } from "./question.js";
import { notice } from "./session.js";
import { drawFor, period } from "./statistics.js";
import { asked } from "./studies.js";

// Width of a chart on paper, CSS pixels.
const PAPER = 690;
const KINDS = {
  live: (now) => ({ title: `Part, result no. ${now.result.seq}`, recipe: now.result.recipe, fingerprint: now.result.fingerprint, shown: ["verdict", "gauges", "picture", "counters"] }),
  part: () => ({ title: `Part, result no. ${kept().seq}`, recipe: kept().recipe, fingerprint: kept().fingerprint, shown: ["kept"] }),
  period: () => ({ title: `Statistics, ${period().words}`, recipe: Number(period().recipe), shown: ["statistics"] }),
  study: () => ({ title: `Study ${asked().number}: ${asked().name}`, recipe: asked().recipe, shown: ["study"] }),
};
let latest = () => null;

const quoted = (words) => `"${words.replace(/["\\]/g, "\\$&").replace(/\s+/g, " ")}"`;

// What the recipe says of itself; one that was deleted says nothing.
function manifest(number) { return ask("GET", `api/recipes/${number}`).catch(() => ({})); }

async function print(kind) {
  const now = latest();
  if (!now || (kind === "live" && !now.result)) { notice("there is no result to print", true); return; }
  const by = await enter("Print a report", "The browser prints it, or saves it as PDF.", "Printed by", localStorage.getItem("printed-by") || "", "Print");
  if (by === null) return;
  localStorage.setItem("printed-by", by);
  const { title, recipe, fingerprint, shown } = KINDS[kind](now);
  const { name, fingerprint: own, calibration } = await manifest(recipe);
  const facts = [
    ["Device", `${now.identity.product}, serial ${now.identity.serial}`],
    ["Recipe", `${recipe}${name ? ` (${name})` : ""}, fingerprint ${(fingerprint || own || "not known").slice(0, 8)}`],
    ["Calibration", calibration ? calibration.slice(0, 8) : "not known"],
    ["Program", now.identity.version],
    ["Printed", `${date(1000 * Date.now())} by ${by || "somebody who gave no name"}`],
  ];
  const [device, of, calibrated, program, printed] = facts.map(([what, words]) => `${what} ${words}`);
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(`@page {
    @top-left { content: ${quoted(`${title}. ${of}`)}; } @top-right { content: "page " counter(page) " of " counter(pages); }
    @bottom-left { content: ${quoted(`${device}. ${program}. ${calibrated}`)}; } @bottom-right { content: ${quoted(printed)}; }
  }`);
  document.adoptedStyleSheets = [sheet];
  fill($("report-head"), make("h1", "", title), make("dl", "", ...facts.map(([what, words]) => make("div", "", make("dt", "", what), make("dd", "", words)))));
  document.body.dataset.report = kind;
  for (const id of shown) $(id).classList.add("printed");
  // What is folded on the screen is on the paper.
  for (const one of document.querySelectorAll(".printed details:not([open])")) { one.open = true; one.classList.add("unfolded"); }
  if (kind === "period") drawFor(PAPER);
  document.title = `${title} · ${now.identity.serial}`;
  window.print();
}

function done() {
  if (!document.body.dataset.report) return;
  delete document.body.dataset.report;
  document.adoptedStyleSheets = [];
  for (const one of document.querySelectorAll(".unfolded")) { one.open = false; one.classList.remove("unfolded"); }
  for (const one of document.querySelectorAll(".printed")) one.classList.remove("printed");
  drawFor(0);
}

export function start(snapshot) {
  latest = snapshot;
  for (const one of document.querySelectorAll("[data-report]")) on(one, "click", () => print(one.dataset.report));
  on(window, "afterprint", done);
}
