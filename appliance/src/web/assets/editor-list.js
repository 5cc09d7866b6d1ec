// The list that is edited: features, datum systems and gauges of a recipe with its names, what is chosen of it, and undo and redo.
import { kindOf } from "./api.js";

const KEYS = ["name", "part_number", "guard_k", "features", "datums", "gauges"];
// Steps that can be taken back.
const KEPT = 50;
// The longest name of a feature, a datum system or a gauge.
export const LONGEST = 64;

// `chosen` has places in the list of features, `open` is "gauges 3": the form that is open. `found` is the last answer of a try.
export const state = { recipe: null, list: null, kinds: null, chosen: [], open: "", found: null, changed: null };
let past = [], future = [], last = "", stored = "";

const written = () => JSON.stringify(state.list);

// Takes over a stored recipe.
export function begin(recipe, kinds) {
  const list = {};
  for (const key of KEYS) list[key] = recipe[key];
  // What follows from a nominal value or from golden is worked out anew.
  for (const gauge of list.gauges) {
    delete gauge.golden_value;
    if (wayOf(gauge, kinds) !== "limits") { delete gauge.low; delete gauge.high; }
  }
  Object.assign(state, { recipe, list, kinds, chosen: list.features.length ? [0] : [], open: "", found: null });
  past = [];
  future = [];
  last = "";
  stored = written();
}

export const isChanged = () => Boolean(state.list) && written() !== stored;
export const steps = () => [past.length, future.length];

// Changes the list by `act` as one step; steps with the same key that follow each other are one. A step with a key leaves the forms
// as they are, because somebody types in them.
export function alter(key, act) {
  const before = written();
  act();
  record(before, key);
}

// The ways of stating limits, and the one of a gauge: that of a key which it has and no other way; a parameter of its kind is none.
export function waysOf(gauge, kinds) {
  const { parameters } = kindOf(kinds, gauge);
  const own = kinds.limits.filter(({ name, of }) => of.length === 1 && of[0] !== "master" && !parameters.some((other) => other.name === name));
  return own.reduce((ways, { of: [way] }) => (ways.includes(way) ? ways : ways.concat(way)), []);
}
export function wayOf(gauge, kinds) {
  // A stored gauge also has the limits that were worked out.
  return waysOf(gauge, kinds).reverse().find((way) => kinds.limits.some(({ name, of }) => of.length === 1 && of[0] === way && gauge[name] !== undefined)) || "limits";
}

// Makes a step of what has changed since the list was `before`.
export function record(before, key = "") {
  if (written() === before) return;
  if (!key || key !== last) past.push(before);
  if (past.length > KEPT) past.shift();
  last = key;
  future = [];
  state.changed(!key);
}

export const snapshot = written;
// Ends a run of steps with the same key.
export function pause() { last = ""; }

function go(from, to) {
  if (!from.length) return;
  to.push(written());
  state.list = JSON.parse(from.pop());
  last = "";
  state.chosen = state.chosen.filter((at) => at < state.list.features.length);
  state.changed(true);
}
export const undo = () => go(past, future);
export const redo = () => go(future, past);

// The name of a kind or word as people read it.
export const spoken = (word) => word.replace(/_/g, " ");
export const featureKind = ({ kind }) => state.kinds.features.find((one) => one.kind === kind);
export const parameterOf = (kind, name) => kind.parameters.find((one) => one.name === name);

// "hole 3": the first number that no other has.
export function free(word, all) {
  let number = 1;
  while (all.some(({ name }) => name === `${word} ${number}`)) number += 1;
  return `${word} ${number}`;
}

function freeSlot() {
  let slot = 1;
  while (state.list.gauges.some((gauge) => gauge.slot === slot)) slot += 1;
  return slot;
}

// The chosen features in the order in which a kind takes them; null if it does not take them.
export function fitting(kind) {
  const chosen = state.chosen.map((at) => state.list.features[at]);
  const fits = (order) => order.length === kind.takes.length && (order.length === 2
    ? kind.pairs.some((pair) => pair.every((one, at) => one === order[at].kind)) : kind.takes.every((place, at) => place.includes(order[at].kind)));
  return [chosen, chosen.slice().reverse()].find(fits) || null;
}

// What a gauge is called unless somebody renames it.
export function proposal(kind, of, own) {
  const name = `${of.join(" to ")} ${spoken(kind)}`.trim().slice(0, LONGEST);
  const others = state.list.gauges.filter((gauge) => gauge !== own);
  return others.some((gauge) => gauge.name === name) || !of.length ? free(name.slice(0, LONGEST - 4), others) : name;
}

// Puts a new gauge of a kind on features among the others, with its parameters as another of the kind has them.
function put(kind, of, limits) {
  const { gauges, datums } = state.list;
  const like = gauges.find((gauge) => gauge.kind === kind.kind) || {};
  const gauge = Object.assign({ slot: freeSlot(), name: proposal(kind.kind, of), kind: kind.kind, of }, limits);
  if (kind.datum && datums.length) gauge.datum = datums[datums.length - 1].name;
  for (const { name, default: usual } of kind.parameters) gauge[name] = JSON.parse(JSON.stringify(name in like && !Array.isArray(usual) ? like[name] : usual));
  let at = gauges.findIndex(({ slot }) => slot > gauge.slot);
  if (at < 0) at = gauges.length;
  state.open = `gauges ${at}`;
  gauges.splice(at, 0, gauge);
}

// A new gauge of a kind on the chosen features.
export const addGauge = (kind, limits) => alter("", () => put(kind, fitting(kind).map(({ name }) => name), limits));

// Features whose size nothing measures, as many as there is room for.
export function unmeasured() {
  const { features, gauges } = state.list;
  const sized = features.filter((one) => {
    const { size } = featureKind(one);
    return size && !gauges.some((gauge) => gauge.kind === size && gauge.of.includes(one.name));
  });
  return sized.slice(0, state.kinds.bounds.gauges - gauges.length);
}
// The kind of gauge that measures the size of a feature.
export const sizeKind = (feature) => kindOf(state.kinds, { kind: featureKind(feature).size });
// Gauges of their sizes, as one step.
export const addSizes = (usualLimits) => alter("", () => unmeasured().forEach((feature) => put(sizeKind(feature), [feature.name], usualLimits(sizeKind(feature)))));

// Functions that set every place where a feature or a datum system is named.
export function naming(what, one) {
  const { features, datums, gauges } = state.list, was = one.name, found = [(name) => { one.name = name; }];
  const entry = (of, at) => { if (of[at] === was) found.push((name) => { of[at] = name; }); };
  for (const holder of gauges.concat(datums)) if (what === "features") (holder.of || []).forEach((name, at) => entry(holder.of, at));
  for (const holder of what === "features" ? features : what === "datums" ? gauges : []) entry(holder, what === "features" ? "plane" : "datum");
  // A proposed name goes on to say what the gauge is of.
  for (const gauge of what === "features" ? gauges : []) {
    const { of = [], kind, name } = gauge;
    const proposed = () => proposal(kind, of, gauge);
    if (of.includes(was) && name === proposed()) found.push(() => { gauge.name = proposed(); });
  }
  return found;
}

// What is deleted together with a feature or a datum system, and the contours that lose their plane.
export function hanging(what, { name }) {
  const { features, datums, gauges } = state.list;
  const of = (holder) => (holder.of || []).includes(name);
  if (what === "gauges") return { datums: [], gauges: [], planes: [] };
  const gone = what === "datums" ? [] : datums.filter(of);
  const names = what === "datums" ? [name] : gone.map((datum) => datum.name);
  return {
    datums: gone, planes: what === "datums" ? [] : features.filter(({ plane }) => plane === name),
    gauges: gauges.filter((gauge) => names.includes(gauge.datum) || (what === "features" && of(gauge))),
  };
}

export function remove(what, one) {
  const { datums, gauges, planes } = hanging(what, one), { list } = state;
  alter("", () => {
    for (const contour of planes) delete contour.plane;
    list[what] = list[what].filter((other) => other !== one);
    list.datums = list.datums.filter((other) => !datums.includes(other));
    list.gauges = list.gauges.filter((other) => !gauges.includes(other));
    state.chosen = [];
    state.open = "";
  });
}

// Factor and symbol of a unit as people write it, and the smallest and largest value that the station accepts.
export function inUnits({ unit: symbol, low, high }) {
  return symbol ? [1, symbol, low, high] : [100, "%", 100 * low, 100 * high];
}

// What a try found of a feature or a gauge; null before its answer.
export const foundOf = (what, one) => (state.found && state.found[what].find((other) => (what === "gauges" ? other.slot === one.slot : other.name === one.name))) || null;
export const gaugeKind = (gauge) => kindOf(state.kinds, gauge);
