// The lists of the editor: each feature, datum system and gauge is a row that opens as a form.
import { $, button, fill, make, on, text } from "./element.js";
import { choose } from "./question.js";
import { addGauge, addSizes, featureKind, fitting, foundOf, hanging, remove, sizeKind, spoken, state, unmeasured } from "./editor-list.js";
import { nameField, parameter } from "./editor-fields.js";
import { gaugeForm, gaugeWords, usualLimits } from "./editor-gauges.js";
import { profile } from "./found.js";
import { signed } from "./number.js";

const LISTS = { features: "editor-features", datums: "editor-datums", gauges: "editor-gauges" };
// Functions that show what a try has found in the rows and in the open form.
let shown = [];
let hooks = null;

const many = (all, word) => (all.length ? [`${all.length === 1 ? word : `${all.length} ${word}s`} ${all.map(({ name }) => name).join(", ")}`] : []);

async function ask(what, one) {
  const { gauges, datums, planes } = hanging(what, one);
  const gone = many(datums, "datum system").concat(many(gauges, "gauge")), own = planes.length ? ` ${planes.map(({ name }) => name).join(", ")} will have a plane fitted around ${planes.length === 1 ? "it" : "each"}.` : "";
  const words = `${gone.length ? `Deleted with it: ${gone.join("; ")}.` : "Nothing else is deleted."}${own} Undo brings everything back.`;
  if (gone.length + planes.length === 0 || await choose(`Delete ${one.name}?`, words, [["Delete", true]])) remove(what, one);
}

// "found 98 %, 10.012 mm": what a try has found of a feature, with a sign that says it without colour.
function featureWords(feature) {
  const of = foundOf("features", feature);
  if (!of) return ["", ""];
  if (of.state !== "found") return [`✗ ${of.state}: ${of.reason || "not found"}`, "bad"];
  const share = of.found === null ? "" : ` ${(100 * of.found).toFixed(0)} %`;
  return [`✓ found${share}${of.size.length ? ` · ${of.size.map((size) => signed(size, 3)).join(" × ")} mm` : ""}`, ""];
}

// What a try says about an open feature.
function details(feature, place) {
  const of = foundOf("features", feature);
  if (!of) { fill(place); return; }
  const parts = [];
  if (of.reason || of.remedy) parts.push(make("p", "bad", [of.reason, of.remedy].filter(Boolean).join(" – ")));
  const facts = [];
  if (of.plane) facts.push(of.plane === "own" ? "its plane is fitted around it" : `in the plane ${of.plane}`);
  if (of.centre) facts.push(`centre ${of.centre.map((value) => signed(value, 3)).join(", ")} mm as taught`);
  if (of.pieces && of.pieces.length) {
    const why = {};
    for (const piece of of.pieces) if (!piece.accepted) why[piece.why] = (why[piece.why] || 0) + 1;
    const refused = Object.keys(why).map((word) => `${why[word]} ${word}`);
    facts.push(`${of.pieces.filter(({ accepted }) => accepted).length} of ${of.pieces.length} pieces accepted (●)${refused.length ? `, refused (×): ${refused.join(", ")}` : ""}`);
  }
  if (facts.length) parts.push(make("p", "quiet", facts.join("; ")));
  if (of.profile && of.profile.points.length) {
    const drawing = profile(of.profile);
    parts.push(drawing, make("p", "", drawing.getAttribute("aria-label")));
  }
  fill(place, ...parts);
}

function featureForm(feature, key) {
  const place = make("div", "details"), kind = featureKind(feature), { region } = feature;
  shown.push(() => details(feature, place));
  const fields = [nameField("features", feature), ...[].concat(...kind.parameters.map((of) => parameter(feature, of, key)))];
  const corners = [];
  if (region && kind.shapes.includes("polygon") && kind.shapes[0] !== "circle") {
    corners.push(button("Add corner", "", () => hooks.corner(feature, 1)), button("Remove corner", "", () => hooks.corner(feature, -1)));
  }
  return [make("p", "quiet", kind.about), make("div", "fields", ...fields), place, make("p", "line", ...corners, button("Delete", "", () => ask("features", feature)))];
}

const datumForm = (datum) => [make("div", "fields", nameField("datums", datum)), make("p", "line", button("Change", "", () => hooks.datum(datum)), button("Delete", "", () => ask("datums", datum)))];

const FORMS = {
  features: { words: featureWords, kind: (one) => one.kind, form: featureForm },
  datums: { words: () => ["", ""], kind: (one) => one.of.map((name, at) => `${"ABC"[at]} ${name}`).join(", "), form: datumForm },
  gauges: {
    words: gaugeWords, kind: (one) => `slot ${one.slot}`,
    form: (gauge, key) => [...gaugeForm(gauge, key, shown), make("p", "line", button("Delete", "", () => ask("gauges", gauge)))],
  },
};

function row(what, one, at) {
  const { words, kind, form } = FORMS[what], key = `${what} ${at}`, open = state.open === key;
  const name = make("b"), sort = make("small"), found = make("span", "found"), head = make("button", "row", name, sort, found);
  head.type = "button";
  head.id = `row-${what}-${at}`;
  head.setAttribute("aria-expanded", String(open));
  on(head, "click", () => { state.open = open ? "" : key; if (what === "features") state.chosen = [at]; hooks.opened(); });
  const update = () => {
    const [said, tone] = words(one);
    name.textContent = one.name;
    sort.textContent = kind(one);
    found.textContent = said;
    found.className = `found ${tone}`;
  };
  update();
  shown.push(update);
  const line = make("li", open ? "opened" : "");
  if (what === "features") {
    const box = make("input");
    box.type = "checkbox";
    box.id = `choose-${at}`;
    box.checked = state.chosen.includes(at);
    box.setAttribute("aria-label", `${one.name} for a new gauge`);
    on(box, "change", () => { state.chosen = state.chosen.filter((other) => other !== at).concat(box.checked ? [at] : []); hooks.chosen(); });
    line.append(make("label", "pick", box));
  }
  line.append(head);
  if (open) line.append(make("div", "form", ...form(one, key)));
  return line;
}

// The kinds of gauges that fit the chosen features.
function drawOffers() {
  const chosen = state.chosen.map((at) => state.list.features[at].name);
  const fit = state.kinds.kinds.filter(fitting);
  text("gauge-of", chosen.length ? `New gauge of ${chosen.join(" and ")}:` : "New gauge of the whole part, or choose one or two features:");
  const full = state.list.gauges.length >= state.kinds.bounds.gauges;
  fill($("gauge-kinds"), ...fit.map((kind) => {
    const add = button(spoken(kind.kind), "", () => {
      addGauge(kind, usualLimits(kind));
      document.getElementById(`row-${state.open.replace(" ", "-")}`).focus();
    });
    add.title = kind.about;
    add.disabled = full;
    return add;
  }), ...(fit.length ? [] : [make("span", "quiet", "no gauge takes these together")]));
  const sized = unmeasured(), which = sized.length === 1 ? `of ${sized[0].name}` : `of ${sized.length} features`;
  fill($("gauge-holes"), ...(sized.length ? [button(`Measure the ${spoken(sizeKind(sized[0]).kind)} ${which}`, "", () => addSizes(usualLimits))] : []));
}

// Draws the lists anew; the focus stays in its row, or at its place in the open form.
export function drawRows() {
  const { id } = document.activeElement, inForm = () => Array.from($("editor-form").querySelectorAll(".form input, .form select, .form button"));
  const at = inForm().indexOf(document.activeElement);
  shown = [];
  for (const what of Object.keys(LISTS)) fill($(LISTS[what]), ...state.list[what].map((one, place) => row(what, one, place)));
  drawOffers();
  showFound();
  const again = id ? document.getElementById(id) : inForm()[at];
  if (again && again !== document.activeElement) again.focus();
}

// Shows which features are chosen, without drawing the rows anew.
export function markRows() {
  state.list.features.forEach((_, at) => { $(`choose-${at}`).checked = state.chosen.includes(at); });
  drawOffers();
}

// Shows names and what was found in rows that are there.
export function showFound() { for (const show of shown) show(); }

// `opened` is called when a row is opened or closed, `chosen` when features are chosen, `corner` adds or removes one, `datum` opens its dialogue.
export function start(of) { hooks = of; }
