// Health and event log.
import { $, fill, make } from "./element.js";
import { ask } from "./api.js";
import { followChanges, line, openChanges } from "./changes.js";
import { about, count, duration, milliseconds, moment } from "./number.js";
import { notice } from "./session.js";

let timer = 0;
let boot = "";

function known(value, unit, places = 0) {
  return value === null || value === undefined ? "not known" : count(value.toFixed(places)) + unit;
}

function listed(words) {
  return words.length ? words.join(", ") : "none";
}

// What the firmware of a Raspberry Pi says; other computers say nothing.
function power(now) {
  if (!now) return "not known";
  if (now.now.length) return listed(now.now);
  return now.since_start.length ? `good; since the start of the computer: ${listed(now.since_start)}` : "good";
}

// What the projector's controller says, if there is one.
function controller(health) {
  if (!health.projector_faults) return [];
  return [
    ["Projector temperature", known(health.projector_temperature_c, " °C", 1)],
    ["Projector LED current", known(health.led_current_steps, " steps")],
    ["Projector faults", listed(health.projector_faults)],
  ];
}

function condition(now) {
  const { health, result } = now;
  const pairs = [
    ["Measuring task", now.worker_alive ? "meets its deadlines" : "missed a deadline"],
    ["Calibration", now.calibration_valid ? "valid" : "missing or not fitting"],
    ["Warnings", now.warnings.length ? now.warnings.join(", ") : "none"],
    ["Head temperature", result && result.temperature_c !== null ? `${result.temperature_c.toFixed(1)} °C` : "not known"],
    ["Processor load", known(health.cpu_percent, " %")],
    ["Processor temperature", known(health.cpu_temperature_c, " °C", 1)],
    ["Camera temperature", known(health.camera_temperature_c, " °C", 1)],
    ["Power", power(health.power)],
    ["Free memory", known(health.free_memory_mib, " MiB")],
    ["Free storage", known(health.free_storage_mib, " MiB")],
    ["Storage errors", count(health.storage_errors)],
    ["Camera", `${health.camera_hz.toFixed(1)} frames/s`],
    ["Projector", `${health.projector_hz.toFixed(2)} Hz`],
    ...controller(health),
    ["Pattern to exposure", `${count(health.lag_us)} µs at most`],
    ["Dropped frames", count(health.dropped_frames)],
    ["Missed flips", count(health.missed_flips)],
    ["Repeated patterns", count(health.retaken_patterns)],
    ["Off the calibration", known(health.drift_px, " px", 2)],
    ["Processing, last", milliseconds(health.processing_us)],
    ["Processing, longest", milliseconds(health.processing_max_us)],
    ["Modbus clients", `${health.modbus_clients}${health.writer_connected ? ", one may write" : ""}`],
    ["Starts", count(health.boots)],
    ["Starts after a crash", count(health.unclean_boots)],
    ["Starts after a hang", count(health.watchdog_restarts)],
    ["Up for", duration(now.uptime_s)],
    ["Serial number", now.identity.serial],
    ["Program", now.identity.version],
    ["Kernel", health.kernel || "not known"],
    ["libcamera", health.libcamera || "not in use"],
  ];
  return pairs.map(([name, value]) => make("div", "", make("dt", "", name), make("dd", "", value)));
}

async function refresh() {
  try {
    const [log] = await Promise.all([ask("GET", "api/log"), followChanges()]);
    fill($("log-lines"), ...log.lines.map((entry) => line(moment(entry, boot), entry.words, "", about(entry))));
    if (!log.lines.length) fill($("log-lines"), line("", "nothing happened yet"));
  } catch (error) { notice(error.message, true); }
}

export function showDevice(now, visible) {
  if (visible) fill($("health"), ...condition(now));
}

export function openDevice(visible, now) {
  clearInterval(timer);
  boot = now.boot_id;
  if (!visible) return;
  openChanges(now);
  refresh();
  timer = setInterval(refresh, 2000);
}
