// Where the time of a cycle goes.
import { $, fill, make, text } from "./element.js";
import { milliseconds } from "./number.js";

// What the stages of the computation are called here.
const NAMES = { strips: "frames to gauges" };

export function showTimes(result) {
  if (!result) return;
  text("total", milliseconds(result.total_us));
  const processing = [{ name: "processing", us: Math.max(0, result.total_us - result.exposure_us) }];
  const known = result.stages.length ? result.stages : processing;
  text("processing", milliseconds(known.reduce((sum, stage) => sum + stage.us, 0)));
  const stages = [{ name: "exposure", us: result.exposure_us }].concat(known);
  const spent = stages.reduce((sum, stage) => sum + stage.us, 0);
  if (result.total_us > spent) stages.push({ name: "waiting and storing", us: result.total_us - spent });
  const sum = Math.max(1, stages.reduce((total, stage) => total + stage.us, 0));
  fill($("stages-bar"), ...stages.map((stage, at) => {
    const part = make("span", `s${at % 8}`);
    part.style.width = `${100 * stage.us / sum}%`;
    return part;
  }));
  const line = (kind, name, us) => make("li", "", make("span", `swatch ${kind}`), make("span", "", name), make("b", "", milliseconds(us)));
  const lines = stages.map((stage, at) => line(`s${at % 8}`, NAMES[stage.name] || stage.name, stage.us));
  // What the computing threads spent, however busy the device was besides.
  if (result.cpu_us) lines.push(line("", "processor time", result.cpu_us));
  fill($("stages"), ...lines);
}
