// Numbers as people read them: with their unit, and with as many digits as are significant.
const MINUS = "\u2212";
const THIN = "\u202f";

export function milliseconds(us) {
  if (us < 100) return `${us} µs`;
  const ms = us / 1000;
  return ms >= 1000 ? `${(ms / 1000).toFixed(2)} s` : ms >= 10 ? `${ms.toFixed(0)} ms` : `${ms.toFixed(1)} ms`;
}

export function count(number) {
  return String(number).replace(/\B(?=(\d{3})+(?!\d))/g, THIN);
}

export function signed(value, places) {
  return value.toFixed(places).replace("-", MINUS);
}

// Factor, decimal places and symbol of a unit. A share is shown in per cent.
function form(unit) {
  if (unit === "mm") return [1, 3, " mm"];
  if (unit === "mm³") return [1, 2, " mm³"];
  if (unit === "°") return [1, 3, "°"];
  if (unit === "px") return [1, 2, " px"];
  return [100, 2, " %"];
}

// A value of a gauge; a σ gets one more digit.
export function quantity(value, unit, more = 0, bare = false) {
  const [factor, places, symbol] = form(unit);
  return signed(factor * value, places + more) + (bare ? "" : symbol);
}

// "0.98 … 1.02 mm", "≤ 0.25 mm" or "no limits".
export function limits(low, high, unit) {
  const has = (limit) => limit !== null && limit !== undefined;
  if (has(low) && has(high)) return `${quantity(low, unit, 0, true)} … ${quantity(high, unit)}`;
  if (has(low)) return `≥ ${quantity(low, unit)}`;
  return has(high) ? `≤ ${quantity(high, unit)}` : "no limits";
}

// What a result measured besides its gauges; dashes where it measured nothing.
export function measures(result) {
  const measured = result && result.valid_points > 0;
  const percent = (permille) => `${(permille / 10).toFixed(1)} %`;
  return {
    points: measured ? count(result.valid_points) : "–",
    coverage: measured ? percent(result.coverage_permille) : "–",
    noise: measured && result.height_noise_mm !== null ? `${(1000 * result.height_noise_mm).toFixed(1)} µm` : "–",
    fitness: measured ? percent(result.fitness_permille) : "–",
  };
}

// How the light changed from frame to frame within a cycle.
export function changes({ other_counts, gain, shift_turns, hz }) {
  const half = (Math.max(...other_counts) - Math.min(...other_counts)) / 2;
  const most = Math.max(...gain.map(Math.abs));
  const moved = Math.max(...shift_turns.map(Math.abs));
  const shook = moved > 0.005 ? `, fringes moved by ± ${moved.toFixed(3)} turns: does the part shake?` : "";
  return `other light changed by ± ${half.toFixed(1)} counts between frames${hz ? `: a lamp of ${hz} Hz?` : ""}, the projector's by ± ${(100 * most).toFixed(1)} %${shook}; corrected`;
}

export function clock(utc_us) {
  return utc_us ? new Date(utc_us / 1000).toLocaleTimeString("en-GB") : "";
}

export function duration(s) {
  const hours = Math.floor(s / 3600), minutes = Math.floor(s / 60) % 60;
  return `${hours} h ${String(minutes).padStart(2, "0")} min`;
}

// A remark where a time is known only by the clock of a browser, else nothing.
export function about(entry) {
  return !entry.utc_us && !entry.time_utc_us && entry.browser_utc_us ? "time from the browser of a signed-in user: the clock was not synchronised" : "";
}

// A moment in this device's time zone, to the minute.
export function date(us) {
  const two = (number) => String(number).padStart(2, "0");
  const at = new Date(us / 1000);
  return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())} ${two(at.getHours())}:${two(at.getMinutes())}`;
}

// When something happened. If the clock was not synchronised: by the clock of a browser, else the time since that start of the device.
export function moment(entry, boot) {
  const utc_us = entry.utc_us || entry.time_utc_us || entry.browser_utc_us;
  if (!utc_us) {
    const two = (number) => String(Math.floor(number)).padStart(2, "0");
    const since = `${Math.floor(entry.uptime_s / 3600)}:${two(entry.uptime_s / 60 % 60)}:${two(entry.uptime_s % 60)}`;
    return `${since} after ${!entry.boot_id || entry.boot_id === boot ? "the" : "an earlier"} start`;
  }
  return `${about(entry) ? "≈ " : ""}${date(utc_us).slice(0, 10)} ${clock(utc_us)}`;
}
