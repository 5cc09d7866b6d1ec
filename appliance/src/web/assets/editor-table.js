// A table of nominal values, as a spreadsheet copies it: each line becomes the limits of the gauge that it names.
import { $, on, text } from "./element.js";
import { alter, gaugeKind, inUnits, state } from "./editor-list.js";
import { unitOf } from "./api.js";

const LIMITS = ["low", "high", "golden", "plus", "minus"];

// A number with a decimal point or comma; NaN if it is none.
const number = (words) => (/^[+-]?\d*[.,]?\d+$/.test(words) ? Number(words.replace(",", ".")) : NaN);

// "0.1", "±0.1" or "+0.1/-0.2" as what lies above and below; null if it is none.
function tolerance(words) {
  const [above, below] = words.replace(/[±\s]/g, "").split("/").map(number);
  const found = [above, below === undefined ? above : -below];
  return found.every((one) => one >= 0) ? found : null;
}

// The gauge of a line and what its limits become, or why it cannot be taken over.
function read(line) {
  const [name, nominal, allowed] = line.split(line.includes("\t") ? "\t" : ";").map((word) => word.trim());
  const gauge = state.list.gauges.find((one) => one.name.toLowerCase() === name.toLowerCase());
  if (!gauge) return { wrong: `no gauge is called ${name}` };
  const [plus, minus] = tolerance(allowed || "") || [NaN, NaN], middle = number(nominal || "");
  if (Number.isNaN(middle + plus + minus)) return { wrong: `${name} has no nominal value and tolerance, such as 8.000; 0.1` };
  if (gaugeKind(gauge).parameters.some((one) => one.name === "nominal")) return { wrong: `${name} has a nominal place, which is drawn` };
  const [factor] = inUnits(unitOf(state.kinds, gauge));
  return { gauge, limits: { nominal: middle / factor, plus: plus / factor, minus: minus / factor } };
}

function take() {
  const found = $("editor-table").value.split("\n").filter((line) => line.trim()).map(read);
  const sound = found.filter(({ gauge }) => gauge), wrong = found.filter((one) => one.wrong);
  alter("", () => {
    for (const { gauge, limits } of sound) {
      for (const name of LIMITS) delete gauge[name];
      Object.assign(gauge, limits);
    }
  });
  text("editor-taken", [`Gauges with new limits: ${sound.length}.`].concat(wrong.map((one) => `Left out: ${one.wrong}.`)).join(" "));
}

export function start() { on($("editor-take"), "click", take); }
