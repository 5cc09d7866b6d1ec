// The gauges of the last result against their limits, each with its last values.
import { $, fill, make, show, text } from "./element.js";
import { limits, quantity } from "./number.js";
import { ask } from "./api.js";
import { trend } from "./trend.js";
import { decided, doubtful, named, tag, uncertainty } from "./verdict.js";

// Values of a trend.
const KEPT = 100;
let trends = new Map();
let of = "";

function bar(gauge) {
  const { lowest, highest, value } = gauge;
  const track = make("div", "track");
  if (lowest === null && highest === null) return track;
  const low = lowest !== null ? lowest : Math.min(0, highest);
  const high = highest !== null ? highest : gauge.kind === "share" ? 1 : lowest + Math.abs(lowest);
  const span = high - low || 1;
  const from = lowest === null ? low : low - span / 4;
  const to = highest === null ? high : high + span / 4;
  const place = (at) => `${Math.min(100, Math.max(0, 100 * (at - from) / (to - from)))}%`;
  const band = make("span", "band");
  band.style.left = place(low);
  band.style.right = `calc(100% - ${place(high)})`;
  track.append(band);
  if (value !== null) {
    const mark = make("span", "mark");
    mark.style.left = place(value);
    track.append(mark);
  }
  return track;
}

function row(gauge) {
  const value = make("td", "", gauge.value === null ? make("span", "value why", gauge.reason || "not measured") : make("span", "value", quantity(gauge.value, gauge.unit)));
  const lines = gauge.value !== null ? uncertainty(gauge) : [];
  value.append(...(lines.length ? lines : [make("small", "room", "\u00a0")]));
  const range = make("td", "limits", bar(gauge), make("small", "", limits(gauge.lowest, gauge.highest, gauge.unit)));
  const points = trends.get(gauge.name) || [];
  const verdict = make("td", "", tag(gauge));
  verdict.append(gauge.doubtful ? doubtful() : make("small", "room", "\u00a0"));
  return make("tr", "", named(gauge), value, range, make("td", "trend-cell", trend(points, gauge)), verdict);
}

// Reads the last values from the device's history; later ones are added as they come.
async function load(result) {
  trends = new Map();
  try {
    const stored = await ask("GET", "api/trends");
    for (const gauge of stored.gauges) {
      trends.set(gauge.name, gauge.points.map((point) => ({ seq: point.seq, value: point.value, pass: decided(point).pass })));
    }
  } catch (none) { /* Without a history the trends begin now. */ }
  add(result);
  draw(result);
}

function add(result) {
  for (const gauge of result.gauges) {
    const points = trends.get(gauge.name) || [];
    if (points.length && points[points.length - 1].seq >= result.seq) continue;
    points.push({ seq: result.seq, value: gauge.value, pass: gauge.pass });
    trends.set(gauge.name, points.slice(-KEPT));
  }
}

function draw(result) {
  fill($("gauge-rows"), ...result.gauges.map(row));
}

// Shows a new result.
export function showGauges(result, boot) {
  show("no-gauges", !result || result.gauges.length === 0);
  if (!result) { fill($("gauge-rows")); return; }
  text("no-gauges", "this result has no gauges");
  const now = `${boot}/${result.recipe}/${result.fingerprint}`;
  if (now !== of) { of = now; load(result); } else { add(result); }
  draw(result);
}
