// The forms of gauges: what they measure, limits with what a try has found beside them, datum system, slot and master.
import { fill, make } from "./element.js";
import { unitOf } from "./api.js";
import { limits, quantity } from "./number.js";
import { decided, tag } from "./verdict.js";
import { alter, foundOf, gaugeKind, inUnits, proposal, state, wayOf, waysOf } from "./editor-list.js";
import { nameField, number, parameter, select } from "./editor-fields.js";

// The tolerance of a new gauge to both sides of golden, in its unit, and how many σ of a gauge and of golden its limits leave for noise.
const TOLERANCE = 0.1;
const NOISE = 6 * Math.SQRT2;
const WAYS = { limits: "lowest and highest", nominal: "nominal value ± tolerance", golden: "golden ± tolerance" };

// Where a value has ends, as a share, golden may lie at one of them: then somebody must say on which side a limit is.
export function usualLimits(kind) {
  const { low, high } = unitOf(state.kinds, Object.assign({ kind: kind.kind }, ...kind.parameters.map(({ name, default: usual }) => ({ [name]: usual }))));
  return high - low > 1 ? { golden: true, plus: TOLERANCE, minus: TOLERANCE } : {};
}

// "✓ pass 10.012 mm ± 0.004 mm": the decision about golden by words as well as a colour, value and U that a try has found.
export function gaugeWords(gauge) {
  const of = foundOf("gauges", gauge), unit = unitOf(state.kinds, gauge).unit;
  if (!of) return [wayOf(gauge, state.kinds) === "limits" ? limits(gauge.low, gauge.high, unit) : "", ""];
  if (of.value === null) return [`✗ ${of.reason || "no value"}`, "bad"];
  const decision = decided(of);
  return [`${tag(decision).textContent} ${quantity(of.value, unit)}${of.u ? ` ± ${quantity(of.u, unit, 1)}` : ""} · ${limits(of.low, of.high, unit)}${of.too_fine ? " · too fine for this head" : ""}`, decision.pass && !of.too_fine ? "" : "bad"];
}

function limitFields(gauge, key, way) {
  const [factor, symbol, low, high] = inUnits(unitOf(state.kinds, gauge));
  const sources = state.kinds.limits.filter(({ name, of }) => of.includes(way) && name !== "golden");
  const words = { low: "lowest", high: "highest", nominal: "nominal", plus: "up to +", minus: "down to −", master: "master value", master_u: "its standard uncertainty" };
  return sources.map(({ name, about, unit }) => {
    const bounds = name === "low" || name === "high" ? { least: low, most: high } : name === "master_u" ? { least: 0 } : {};
    const of = Object.assign({ about, factor, unit: unit || symbol, optional: name !== "nominal" }, bounds);
    return number(words[name] || name, `${words[name] || name} ${gauge.name}`, gauge[name], of, (value) => alter(`${key} ${name}`, () => { if (value === null) delete gauge[name]; else gauge[name] = value; }));
  });
}

// Takes over another way of stating limits, with limits that are as wide.
function turn(gauge, way) {
  const of = foundOf("gauges", gauge) || gauge, known = (one) => typeof one === "number";
  const { low, high } = of, round = (value) => Number(value.toPrecision(6)), half = known(low) && known(high) ? round((high - low) / 2) : TOLERANCE;
  alter("", () => {
    for (const name of ["low", "high", "plus", "minus", "golden"]) delete gauge[name];
    if (waysOf(gauge, state.kinds).includes("nominal")) delete gauge.nominal;
    if (way === "limits") {
      if (known(low)) gauge.low = round(low);
      if (known(high)) gauge.high = round(high);
      return;
    }
    if (way === "golden") gauge.golden = true;
    else gauge.nominal = known(low) && known(high) ? round((low + high) / 2) : known(of.value) ? round(of.value) : 0;
    Object.assign(gauge, { plus: half, minus: half });
  });
}

// What a try says beside the limits: U, whether they are too fine, and how wide they must be so that noise does not reject golden.
function judgement(gauge, place) {
  const of = foundOf("gauges", gauge), unit = unitOf(state.kinds, gauge).unit, parts = [];
  if (of && of.value === null) parts.push(make("p", "bad", `no value: ${of.reason || "golden has nothing to measure here"}`));
  if (of && of.value !== null) {
    parts.push(make("p", "", make("b", "", quantity(of.value, unit)), ` on golden${of.sigma ? `, σ ${quantity(of.sigma, unit, 1)}` : ""}, `, make("b", "", of.u ? `U ${quantity(of.u, unit, 1)}` : "U not known"), `; limits ${limits(of.low, of.high, unit)}`));
    if (of.too_fine) parts.push(make("p", "bad", `⚠ too fine for this head: the limits are less than 4 U = ${quantity(4 * of.u, unit)} apart`));
    if (of.u_rims > of.u / 2) parts.push(make("p", "quiet", `${quantity(of.u_rims, unit, 1)} of U is for rims: state at the feature or its plane whether they are sharp. With the value of a master, U is ${quantity(of.u_master, unit, 1)}`));
    const least = (of.u || 0) + NOISE * (of.sigma || 0);
    if (gauge.golden && Math.min(gauge.plus || 0, gauge.minus || 0) < least) parts.push(make("p", "quiet", `with ± ${quantity(least, unit)} or more, noise and the guard band leave good parts room`));
  }
  fill(place, ...parts);
}

export function gaugeForm(gauge, key, shown) {
  const kind = gaugeKind(gauge), { features, datums } = state.list, way = wayOf(gauge, state.kinds), place = make("div", "details");
  shown.push(() => judgement(gauge, place));
  const set = (name, value) => alter("", () => { if (value === "") delete gauge[name]; else gauge[name] = value; });
  const fields = [nameField("gauges", gauge)];
  kind.takes.forEach((takes, at) => {
    const fit = features.filter((one) => takes.includes(one.kind));
    fields.push(select(kind.takes.length > 1 ? `Feature ${at + 1}` : "Feature", `feature ${at + 1} of ${gauge.name}`, gauge.of[at], fit.map(({ name }) => [name, name]), (value) => alter("", () => {
      const proposed = gauge.name === proposal(gauge.kind, gauge.of, gauge);
      gauge.of[at] = value;
      if (proposed) gauge.name = proposal(gauge.kind, gauge.of, gauge);
    })));
  });
  fields.push(...[].concat(...kind.parameters.map((of) => parameter(gauge, of, key))));
  if (kind.datum) fields.push(select("Measured in", `datum system of ${gauge.name}`, gauge.datum || "", [["the frame as taught", ""], ...datums.map(({ name }) => [name, name])], (value) => set("datum", value)));
  const ways = waysOf(gauge, state.kinds).map((one) => [WAYS[one] || one, one]);
  const bounds = [select("Limits", `limits of ${gauge.name}`, way, ways, (value) => turn(gauge, value)), ...limitFields(gauge, key, way)];
  const slot = number("Slot", `slot of ${gauge.name}`, gauge.slot, { least: 1, most: state.kinds.bounds.gauges, whole: true }, (value) => alter(`${key} slot`, () => { gauge.slot = value; }));
  return [make("p", "quiet", `${kind.kind.replace(/_/g, " ")}: ${kind.about}`), make("div", "fields", ...fields), make("div", "fields", ...bounds), place, make("div", "fields", slot, ...limitFields(gauge, key, "master"))];
}
