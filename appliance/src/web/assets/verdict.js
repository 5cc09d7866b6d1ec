// The verdict in shape, words and colour, readable from a distance.
import { $, heading, make, text } from "./element.js";
import { clock, quantity } from "./number.js";

const SENTENCES = {
  PASS: "every gauge is within its limits",
  FAIL: "a gauge is outside its limits",
  INVALID: "not everything could be measured or decided: see the gauges, and measure the part again",
};

// The decision about a stored gauge by its bits, which are those of the register GAUGE_DECISION.
export function decided({ decision }) {
  const [pass, valid, low, high, doubtful, absent] = [1, 2, 4, 8, 16, 32].map((bit) => (decision & bit) !== 0);
  return { pass, valid, low, high, doubtful, absent };
}

// What U of a deviation, which is a mean over a square, leaves out.
const LEFT_OUT = "what that mean takes off a narrower dent is not in it";

// "± 0.012 mm" and "good parts 0.026 mm", a line each: the expanded uncertainty U, and what is expected where noise alone moves the value away from 0.
// "± –" if no σ is known. A deviation is a mean, which a dent narrower than its square changes by less than the dent's depth.
export function uncertainty({ uncertainty: expanded, expected, unit, square }) {
  const lines = [make("small", "", typeof expanded === "number" ? `± ${quantity(expanded, unit, 1)}` : "± –")];
  if (square) {
    const size = `${square.side} × ${square.side}`;
    lines.push(make("small", "", `mean of ${size} px`));
    for (const line of lines) line.title = `U is of the mean over ${size} pixels: ${LEFT_OUT}`;
  }
  if (typeof expected === "number") lines.push(make("small", "", `good parts ${quantity(expected, unit, 1)}`));
  return lines;
}

// Says that a gauge's decision is doubtful.
export function doubtful() {
  const made = make("small", "", "doubtful");
  made.title = "a limit lies within 2 σ of the value, or the value in the guard band";
  return made;
}

// The tag that shows the decision about a gauge.
export function tag({ pass, valid, low, high, absent }) {
  if (absent) return make("span", "tag fail", "✗ absent");
  // Within its limits, but closer to one than the guard band.
  const guarded = valid && !pass && !low && !high;
  const kind = !valid || guarded ? "invalid" : pass ? "pass" : "fail";
  const words = !valid ? "? invalid" : guarded ? "? too close" : pass ? "✓ pass" : low ? "✗ low" : high ? "✗ high" : "✗ fail";
  return make("span", `tag ${kind}`, words);
}

// "+0.612 mm too high": what is wrong with a gauge that did not pass.
export function wrong({ value, unit }, { low, absent }) {
  if (value === null) return absent ? "absent" : "not measured";
  return `${quantity(value, unit)} ${low ? "too low" : "too high"}`;
}

// The element that names a gauge, with its place in the registers.
export function named({ name, slot }) {
  return heading("row", name, make("small", "", `slot ${slot}`));
}

// "deviation +0.612 mm too high, opening 4 absent"
function outside(result) {
  const failed = result.gauges.filter((gauge) => gauge.absent || (gauge.valid && !gauge.pass));
  return failed.map((gauge) => `${gauge.name} ${wrong(gauge, gauge)}`).join(", ");
}

function partWords(result) {
  const words = [`no. ${result.seq}`, `part ${result.part_id}`];
  if (result.press_stroke) words.push(`stroke ${result.press_stroke}`);
  if (result.time_utc_us) words.push(clock(result.time_utc_us));
  if (result.doubtful) words.push("doubtful");
  if (result.simulated) words.push("simulated head");
  return words.join(" · ");
}

const recipeName = (recipe) => (recipe ? `recipe ${recipe.number} · ${recipe.name}` : "no recipe");

// The recipe that a result was measured with, as it was at its trigger.
const recipeOf = (result) => ({ number: result.recipe, name: result.recipe_name, fingerprint: result.fingerprint });

const isMeasuring = ({ state }) => state === "acquiring" || state === "processing";
const isOfActive = ({ recipe, result }) => Boolean(recipe) && recipe.number === result.recipe && recipe.fingerprint === result.fingerprint;

// Whether the verdict is of another recipe than the active one, or of an earlier version of it.
export function isOfOtherRecipe(now) { return Boolean(now.result) && !isMeasuring(now) && !isOfActive(now); }

// Whether the last verdict stays while the next part is measured: at full speed it could not be read otherwise.
export function isHeld(now) { return isMeasuring(now) && Boolean(now.result) && isOfActive(now); }

// Covers the verdict of another recipe: the part under the head is to be measured with the active one.
function coverOther(now, other) {
  document.body.classList.toggle("other", other);
  if (!other) { text("other-words", ""); return; }
  const { recipe, result } = now;
  const same = recipe && recipe.number === result.recipe;
  const measured = `${result.verdict} no. ${result.seq} is of ${recipeName(recipeOf(result))}`;
  const active = !recipe ? "no recipe is active" : same ? "that recipe was changed since" : `${recipeName(recipe)} is active`;
  text("other-words", `${measured}; ${active}`);
}

export function showVerdict(now) {
  const panel = $("verdict");
  const result = now.result;
  const held = isHeld(now);
  const measuring = isMeasuring(now) && !held;
  const other = isOfOtherRecipe(now);
  // A verdict that is not about the part under the head keeps its words but loses its colour.
  const past = Boolean(result) && !measuring && !held && (!now.ready || other);
  // The recipe beside a verdict is the one that measured it.
  const recipe = result && !measuring ? recipeOf(result) : now.recipe;
  text("recipe-name", recipeName(recipe));
  text("fingerprint", recipe ? recipe.fingerprint : "");
  coverOther(now, other);
  panel.classList.toggle("past", past);
  panel.classList.toggle("held", held);
  document.body.classList.toggle("past", past || measuring);
  panel.dataset.verdict = measuring ? "MEASURING" : result ? result.verdict : "NONE";
  if (measuring) {
    text("word", "MEASURING");
    text("sentence", now.state === "acquiring" ? "the part must lie still" : "the part may move");
    text("part", result ? `before: ${result.verdict}, no. ${result.seq}` : "");
  } else if (result) {
    const found = result.verdict === "FAIL" ? outside(result) : "";
    text("word", past ? `last: ${result.verdict}` : result.verdict);
    const sentence = result.verdict === "PASS" && result.judges_nothing ? "measured, not judged: the recipe has no limits" : SENTENCES[result.verdict];
    text("sentence", result.reason || found || sentence || "");
    text("part", partWords(result));
  } else {
    text("word", "NO RESULT");
    text("sentence", now.ready ? "waiting for the first trigger" : "nothing was measured since the start");
    text("part", "");
  }
}
