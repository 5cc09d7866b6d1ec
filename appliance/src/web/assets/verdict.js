// The verdict in shape, words and colour, readable from across the hall.
import { $, text } from "./element.js";
import { clock, quantity } from "./number.js";

const SENTENCES = {
  PASS: "every gauge is within its limits",
  FAIL: "a gauge is outside its limits",
  INVALID: "not everything could be measured",
};

// "deviation +0.612 mm, opening 4 too high"
export function outside(result) {
  const failed = result.gauges.filter((gauge) => gauge.valid && !gauge.pass);
  return failed.map((gauge) => `${gauge.name} ${quantity(gauge.value, gauge.unit)} ${gauge.low ? "too low" : "too high"}`).join(", ");
}

function partWords(result) {
  const words = [`no. ${result.seq}`, `part ${result.part_id}`];
  if (result.press_stroke) words.push(`stroke ${result.press_stroke}`);
  if (result.time_utc_us) words.push(clock(result.time_utc_us));
  if (result.doubtful) words.push("close to a limit");
  if (result.simulated) words.push("simulated head");
  return words.join(" · ");
}

export function showVerdict(now) {
  const panel = $("verdict");
  const result = now.result;
  const measuring = now.state === "acquiring" || now.state === "processing";
  // An old verdict keeps its words but loses its colour: it says nothing about what lies under the head now.
  const past = Boolean(result) && !measuring && now.state !== "ready";
  panel.classList.toggle("past", past);
  document.body.classList.toggle("past", past || measuring);
  panel.dataset.verdict = measuring ? "MEASURING" : result ? result.verdict : "NONE";
  if (measuring) {
    text("word", "MEASURING");
    text("sentence", now.state === "acquiring" ? "the part must lie still" : "the part may move");
    text("part", result ? `before: ${result.verdict}, no. ${result.seq}` : "");
  } else if (result) {
    const found = result.verdict === "FAIL" ? outside(result) : "";
    text("word", past ? `last: ${result.verdict}` : result.verdict);
    text("sentence", result.reason || found || SENTENCES[result.verdict] || "");
    text("part", partWords(result));
  } else {
    text("word", "NO RESULT");
    text("sentence", now.ready ? "waiting for the first trigger" : "nothing was measured since the start");
    text("part", "");
  }
}
