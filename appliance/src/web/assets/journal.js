// Health, event log and the record of changes.
import { $, fill, make } from "./element.js";
import { ask } from "./api.js";
import { moment } from "./number.js";
import { notice } from "./session.js";

let timer = 0;

function line(when, words, kind) {
  return make("li", kind || "", make("span", "when", when), make("span", "", words));
}

// "CAMERA_FPS" with its meaning "frames per second x 100" is shown as it is: numbers of registers, in words.
function health(registers) {
  const known = registers.filter((register) => register.block === "HEALTH" && register.served);
  return known.map((register) => make("div", "", make("dt", "", register.name.toLowerCase().replace(/_/g, " ")), make("dd", "", register.values.join(" ")), make("dd", "quiet unit", register.meaning)));
}

function condition(now) {
  const hours = Math.floor(now.uptime_s / 3600), minutes = Math.floor(now.uptime_s / 60) % 60;
  const result = now.result;
  const pairs = [
    ["Measuring task", now.worker_alive ? "meets its deadlines" : "missed a deadline"],
    ["Calibration", now.calibration_valid ? "valid" : "missing or not fitting"],
    ["Warnings", now.warnings.length ? now.warnings.join(", ") : "none"],
    ["Head temperature", result && result.temperature_c !== null ? `${result.temperature_c.toFixed(1)} °C` : "not known"],
    ["Up for", `${hours} h ${String(minutes).padStart(2, "0")} min`],
    ["Serial number", now.identity.serial],
    ["Program", now.identity.version],
  ];
  return pairs.map(([name, value]) => make("div", "", make("dt", "", name), make("dd", "", value)));
}

let last = null;
async function refresh() {
  try {
    const [log, changes, registers] = await Promise.all([ask("GET", "/api/log"), ask("GET", "/api/changes"), ask("GET", "/api/registers")]);
    fill($("log-lines"), ...log.lines.map((entry) => line(entry.utc_us ? moment(entry.utc_us) : `${entry.uptime_s} s after the start`, entry.words)));
    if (!log.lines.length) fill($("log-lines"), line("", "nothing happened yet"));
    fill($("change-lines"), ...changes.changes.map((entry) =>
      line(moment(entry.utc_us), `${entry.action}, ${entry.subject}, from ${entry.from}: ${entry.outcome}`, entry.outcome === "done" ? "" : "refused")));
    if (!changes.changes.length) fill($("change-lines"), line("", "nothing was changed yet"));
    if (last) fill($("health"), ...condition(last), ...health(registers.registers));
  } catch (error) { notice(error.message, true); }
}

export function showDevice(now) { last = now; }

export function openDevice(visible) {
  clearInterval(timer);
  if (!visible) return;
  refresh();
  timer = setInterval(refresh, 2000);
}
