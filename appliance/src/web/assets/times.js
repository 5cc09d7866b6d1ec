// The cycle time and its stages.
import { $, fill, make, text } from "./element.js";
import { milliseconds } from "./number.js";

// Names of stages on the page, where they differ.
const NAMES = { strips: "phase, height, gauges" };
export const nameOf = (stage) => NAMES[stage.name] || stage.name;

export function showTimes(result) {
  if (!result) return;
  const { stages } = result;
  text("total", milliseconds(result.total_us));
  text("processing", stages.length ? milliseconds(result.processing_us) : "–");
  // Unlike the times above, processor time does not depend on the load of the device.
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
