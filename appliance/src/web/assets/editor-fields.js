// Fields of the editor's forms, made from the table of kinds. A field that holds no number changes nothing, and says what it may be.
import { make, on } from "./element.js";
import { LONGEST, alter, naming, pause, spoken, state } from "./editor-list.js";

// An input with its words above it, and a name for programs that read the page.
export function labelled(words, input, name, about) {
  input.setAttribute("aria-label", name || words);
  on(input, "change", pause);
  if (about) input.title = about;
  return make("label", "", make("span", "", words), input);
}

// A field for a number; `of` says what it may be, `factor` how people write it. An empty one is null, if it is optional.
export function number(words, name, value, of, set) {
  const { factor = 1, unit = "", least, above, most, optional, whole, odd } = of, input = make("input", "limit");
  const known = (one) => one !== undefined && one !== null;
  Object.assign(input, { type: "number", required: !optional, step: odd ? 2 : whole ? 1 : "any" });
  const low = known(least) ? least : above;
  if (known(low)) input.min = low;
  if (known(most)) input.max = most;
  input.value = known(value) ? String(Number((value * factor).toPrecision(7))) : "";
  if (optional) input.placeholder = "none";
  const called = unit ? `${name} in ${unit}` : name;
  on(input, "input", () => {
    input.setCustomValidity("");
    const { validity } = input;
    const range = known(low) && known(most) ? ` from ${low} to ${most}` : known(low) ? ` from ${low} up` : "";
    const wrong = !validity.valid || (known(above) && input.value !== "" && Number(input.value) <= above);
    input.setCustomValidity(wrong ? `${called}: write ${odd ? "an odd" : "a"} number${range}` : "");
    if (!wrong) set(input.value === "" ? null : Number(input.value) / factor);
  });
  return labelled(unit ? `${words} (${unit})` : words, input, called, of.about);
}

// A list to choose from; `options` are pairs of words and value.
export function select(words, name, value, options, set, about) {
  const input = make("select", "", ...options.map(([label, of]) => new Option(label, of)));
  input.value = value;
  on(input, "change", () => set(input.value));
  return labelled(words, input, name, about);
}

// The name of a feature, a datum system or a gauge: what refers to it follows while it is typed.
export function nameField(what, one) {
  const input = make("input"), places = naming(what, one);
  Object.assign(input, { value: one.name, maxLength: LONGEST, required: true });
  on(input, "input", () => alter(`name ${what} ${state.list[what].indexOf(one)}`, () => { for (const put of places) put(input.value); }));
  return labelled("Name", input, `name of ${one.name}`);
}

// What is not known, zero, or a number: a list of these, and a field for the number.
function stated(words, called, value, { nothing, zero, number: other }, bounds, set) {
  const way = value === undefined || value === null ? "" : value > 0 ? "number" : "zero";
  const turn = (to) => set(to === "number" ? 0.1 : to === "zero" ? 0 : null);
  const fields = [select(words, called, way, [[nothing, ""], [zero, "zero"], [`${other} …`, "number"]], turn, bounds.about)];
  if (way === "number") fields.push(number(other, `${other}, ${called}`, value, { ...bounds, optional: false }, (to) => set(to, true)));
  return fields;
}

// The field of a parameter of a feature or a gauge: a list of its words, a feature, a number, or two.
export function parameter(holder, of, key) {
  const { name, about, choices, features, count, optional, unit } = of, words = spoken(name).replace(/ (mm|px|deg)$/, "");
  const set = (value, typed) => alter(typed ? `${key} ${name}` : "", () => { if (value === null || value === "") delete holder[name]; else holder[name] = value; });
  const called = `${words} of ${holder.name}`;
  if (choices) return [select(words, called, holder[name], choices.map(({ word }) => [spoken(word), word]), set, about)];
  if (features) {
    const fit = state.list.features.filter((one) => one !== holder && features.includes(one.kind));
    return [select(words, called, holder[name] || "", [["its own, fitted around it", ""], ...fit.map((one) => [one.name, one.name])], set, about)];
  }
  const { width, height } = state.recipe.camera, pixels = unit === "px";
  const bounds = { about, unit, optional, least: of.least, above: of.above, most: of.most || (pixels ? Math.max(width, height) : undefined), whole: pixels, odd: of.odd };
  // Two coordinates of the picture are drawn.
  if (count && pixels) return [];
  if (of.stated) return stated(words, called, holder[name], of.stated, bounds, set);
  if (!count) return [number(words, called, holder[name], bounds, (value) => set(value, true))];
  return Array.from({ length: count }, (_, at) => number(`${words} ${at + 1}`, `${words} ${at + 1} of ${holder.name}`, (holder[name] || [])[at], bounds, (value) => {
    alter(`${key} ${name} ${at}`, () => { holder[name] = (holder[name] || [0, 0]).map((other, place) => (place === at ? value : other)); });
  }));
}
