// The part in front of a simulated head: shows it, and replaces it.
import { $, button, disable, fill, label, make, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { change, notice } from "./session.js";

const PLACE = "api/simulation/part";
const UNITS = { x: "mm", y: "mm", depth_mm: "mm", diameter_mm: "mm", degrees: "°" };
let kinds = [];
let part = null;
let asked = "";
// What the part lies over, and an example of all that can stand there.
let floor = null, floors = {};
// How light and part change in time.
let unsteady = null;
const CHANGING = ["lamp_depth", "flash", "projector_noise"];
const STANDING = ["pins", "clamps", "next_mm"];
let placing = false;

const copy = (value) => JSON.parse(JSON.stringify(value));
const words = (name) => name.replace(/_(mm|deg)$/, "").replace(/_/g, " ");

// A field for a number, with its name and unit.
function field(name, value, take) {
  const input = make("input");
  input.type = "number";
  input.step = name === "index" ? "1" : "any";
  input.required = true;
  input.value = String(value);
  on(input, "input", () => take(Number(input.value)));
  return make("label", "", words(name) + (UNITS[name] ? ` (${UNITS[name]})` : ""), input);
}

function showDefects() {
  const rows = (part.defects || []).map((defect, at) => {
    const numbers = Object.keys(defect).filter((name) => name !== "kind");
    const remove = label(button("Remove", "", () => { part.defects.splice(at, 1); showDefects(); }), `Remove the defect ${words(defect.kind)}`);
    return make("p", "line", make("b", "", words(defect.kind)), ...numbers.map((name) => field(name, defect[name], (number) => { defect[name] = number; })), remove);
  });
  fill($("part-defects"), ...rows);
  const { defects: offered, poses = [] } = kinds.find((one) => one.part.kind === part.kind);
  show("part-pose", poses.length > 0);
  fill($("pose"), new Option("as below", ""), ...poses.map((pose, at) => new Option(String(at + 1), String(at))));
  show("part-defect", offered.length > 0);
  fill($("defect-kind"), ...offered.map((defect) => new Option(words(defect.kind), defect.kind)));
}

function showPlacement({ shift_mm, tilt_deg, rotation_deg }) {
  [...shift_mm, ...tilt_deg, rotation_deg].forEach((number, at) => { $(`place-${at}`).value = String(number); });
}

function showFloor() {
  const [x, y] = floor ? floor.tilt_deg : [0, 0], there = floor || floors;
  $("floor").checked = Boolean(floor);
  show("floor-fields", floor);
  for (const [id, value] of [["albedo", there.albedo], ["depth", there.depth_mm], ["tilt-0", x], ["tilt-1", y], ["print", there.print_mm]]) $(`floor-${id}`).value = String(value);
  for (const name of STANDING) $(`floor-${name}`).checked = Boolean(floor && floor[name] && (name === "next_mm" || floor[name].length));
}

function showUnsteady() {
  const { shake_mm } = unsteady, changes = CHANGING.some((name) => unsteady[name] > 0) || shake_mm.some((mm) => mm > 0);
  $("unsteady").checked = changes;
  show("unsteady-fields", changes);
  if (!changes) return;
  for (const name of ["lamp_hz", "shake_hz", ...CHANGING]) $(`unsteady-${name}`).value = String(unsteady[name]);
  for (const at of [0, 2]) $(`unsteady-shake-${at}`).value = String(shake_mm[at]);
}

// What changes in time as the form says.
function changing() {
  const ticked = $("unsteady").checked, number = (id) => Number($(`unsteady-${id}`).value);
  const made = { ...unsteady, lamp_hz: number("lamp_hz"), shake_hz: number("shake_hz") };
  for (const name of CHANGING) made[name] = ticked ? number(name) : 0;
  made.shake_mm = unsteady.shake_mm.map((mm, at) => (!ticked ? 0 : at === 1 ? mm : number(`shake-${at}`)));
  return made;
}

// The floor as the form says; what stands on it stays as it is where it is ticked, or is the example.
function laid() {
  if (!$("floor").checked) return null;
  const number = (id) => Number($(`floor-${id}`).value);
  const made = { ...floor, albedo: number("albedo"), depth_mm: number("depth"), tilt_deg: [number("tilt-0"), number("tilt-1")], print_mm: number("print") };
  for (const name of STANDING) {
    const there = floor && floor[name] && (name === "next_mm" || floor[name].length) ? floor[name] : floors[name];
    if ($(`floor-${name}`).checked) made[name] = there; else delete made[name];
  }
  return made;
}

function showPart(answer) {
  show("simulation", answer.simulated);
  if (!answer.simulated) return;
  ({ kinds, part, floor, floors, unsteady } = answer);
  fill($("part-material"), new Option("as the scenario's light", ""), ...answer.materials.map((name) => new Option(words(name), name)));
  $("part-material").value = answer.material || "";
  fill($("part-kind"), ...kinds.map((one) => new Option(words(one.part.kind), one.part.kind)));
  $("part-kind").value = part.kind;
  showPlacement(answer.placement);
  showFloor();
  showUnsteady();
  showDefects();
}

// Whether something is on its way in front of the simulated head.
export const isPlacing = () => placing;

// Puts something else in front of the simulated head. Meanwhile the head sees what was there before, so no step begins.
export async function place(wanted, words) {
  const moved = (now) => {
    placing = now;
    window.dispatchEvent(new Event("head"));
  };
  moved(true);
  try {
    const answer = await change(() => {
      notice("the light of it is being computed…");
      return ask("PUT", PLACE, wanted);
    }, words);
    if (answer) showPart(answer);
  } finally { moved(false); }
}

async function put() {
  const number = (at) => Number($(`place-${at}`).value);
  const placement = { shift_mm: [0, 1, 2].map(number), tilt_deg: [3, 4].map(number), rotation_deg: number(5) };
  text("simulation-words", "the light of the part is being computed…");
  const material = $("part-material").value || null;
  await place({ part, material, placement, floor: laid(), unsteady: changing() }, "the part is in place: the next cycle sees it");
  text("simulation-words", "");
}

// Shows the part again after a start, and after teaching, which places the part that was asked for.
export async function showSimulation(now) {
  const key = `${now.boot_id}/${now.state === "boot"}/${Boolean(now.teach)}`;
  if (key === asked) return;
  asked = key;
  try { showPart(await ask("GET", PLACE)); } catch (gone) { asked = ""; }
}

export function start() {
  on($("part-kind"), "change", () => {
    part = copy(kinds.find((one) => one.part.kind === $("part-kind").value).part);
    showDefects();
  });
  on($("unsteady"), "change", () => show("unsteady-fields", $("unsteady").checked));
  on($("floor"), "change", () => show("floor-fields", $("floor").checked));
  on($("pose"), "change", () => {
    const { poses } = kinds.find((one) => one.part.kind === part.kind);
    if ($("pose").value !== "") showPlacement(poses[Number($("pose").value)]);
  });
  on($("defect-add"), "click", () => {
    const offered = kinds.find((one) => one.part.kind === part.kind).defects;
    part.defects.push(copy(offered.find((defect) => defect.kind === $("defect-kind").value)));
    showDefects();
  });
  on($("simulation"), "submit", async () => {
    disable($("part-put"), true);
    try { await put(); } finally { disable($("part-put"), false); }
  });
}
