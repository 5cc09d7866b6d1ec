// Where the time of a cycle goes.
import { $, fill, make, text } from "./element.js";
import { milliseconds } from "./number.js";

// What the stages are called here.
const NAMES = { strips: "phase, height, gauges" };
export const nameOf = (stage) => NAMES[stage.name] || stage.name;

export function showTimes(result) {
  if (!result) return;
  const { stages } = result;
  text("total", milliseconds(result.total_us));
  text("processing", stages.length ? milliseconds(result.processing_us) : "–");
  // What the computing threads spent, however busy the device was besides.
  text("processor-time", result.cpu_us ? milliseconds(result.cpu_us) : "–");
  const sum = Math.max(1, stages.reduce((total, stage) => total + stage.us, 0));
  fill($("stages-bar"), ...stages.map((stage, at) => {
    const part = make("span", `s${at}`);
    part.style.width = `${100 * stage.us / sum}%`;
    return part;
  }));
  fill($("stages"), ...stages.map((stage, at) =>
    make("li", "", make("span", `swatch s${at}`), make("span", "", nameOf(stage)), make("b", "", milliseconds(stage.us)))));
}
