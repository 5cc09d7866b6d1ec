// One stored result: its values, and the pictures of its part if the frames were kept.
import { $, fill, make, on, show, text } from "./element.js";
import { ask, map } from "./api.js";
import { paint } from "./colour.js";
import { marks } from "./found.js";
import { about, changes, limits, measures, milliseconds, moment, quantity, signed } from "./number.js";
import { over, rings } from "./ring.js";
import { drawScale } from "./scale.js";
import { nameOf } from "./times.js";
import { decided, doubtful, named, tag, uncertainty } from "./verdict.js";
import { viewOf } from "./view.js";

const COMPONENTS = ["x", "y", "z", "about x", "about y", "about z"];
const state = { seq: 0, layer: "height", asked: 0, failed: [], found: null, result: null };

// The view in 3-D, and the number of points of the part.
let view = null, points = 0;

function gauge(entry) {
  const decision = decided(entry);
  const verdict = make("td", "", tag(decision));
  if (decision.doubtful) verdict.append(doubtful());
  const value = make("td", "nowrap", entry.value === null ? entry.reason || "not measured" : quantity(entry.value, entry.unit));
  if (entry.value !== null) value.append(...uncertainty(entry));
  return make("tr", "", named(entry), value, make("td", "", limits(entry.low, entry.high, entry.unit)), verdict);
}

// The pose of the part relative to its taught pose; a component that its shape does not determine is left out.
function placement({ values, reach_mm }) {
  const known = values.flatMap((value, at) => (value === null ? [] : [`${COMPONENTS[at]} ${signed(value, 3)}${at < 3 ? " mm" : "°"}`]));
  return [...known, `${reach_mm.toFixed(3)} mm at its farthest corner`].join(", ");
}

function facts({ result, flags }, boot) {
  const { points, coverage, noise, fitness } = measures(result);
  const when = make("dd", "", moment(result, boot));
  when.title = about(result);
  const pairs = [
    ["Time", when],
    ["Recipe", `${result.recipe} · ${result.fingerprint}`],
    ["Part", String(result.part_id)],
    ["Press stroke", String(result.press_stroke)],
    ["Token", result.token ? String(result.token) : "none"],
    ["Trigger to result", milliseconds(result.total_us)],
    ["Points", points],
    ["Coverage", coverage],
    ["Height noise (1 σ)", noise],
    ["Pattern fitness", fitness],
    ["Stages", result.stages.map((stage) => `${nameOf(stage)} ${milliseconds(stage.us)}`).join(" · ") || "–"],
    ["Placement", result.placement ? placement(result.placement) : "not known"],
    ["Light", result.light ? changes(result.light) : "steady"],
    ["How it was measured", flags.length ? flags.join(", ") : "–"],
  ];
  return pairs.map(([name, value]) => make("div", typeof value === "string" && value.length > 24 ? "wide" : "", make("dt", "", name), typeof value === "string" ? make("dd", "", value) : value));
}

function empty(words) {
  const canvas = $("kept-map");
  canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
  fill($("kept-scale"));
  fill($("kept-ring"));
  text("kept-shown", "");
  text("kept-words", words);
  show("kept-words", true);
  view.show(null);
}

async function picture() {
  const turn = state.asked += 1;
  empty("computing the picture");
  let loaded;
  let found;
  try {
    // The contours are asked for once for all of its pictures.
    state.found = state.found || ask("GET", `api/history/${state.seq}/features`).then(({ features }) => features, () => []);
    [loaded, found] = await Promise.all([map(`api/history/${state.seq}/picture/${state.layer}`), state.found]);
  } catch (error) {
    if (turn === state.asked) empty(error.message);
    return;
  }
  if (turn !== state.asked) return;
  paint($("kept-map"), loaded, state.layer);
  drawScale($("kept-scale"), loaded.about, state.layer);
  over($("kept-ring"), loaded.about, ...marks(found, loaded.about.width * loaded.about.stride / 200), ...rings(loaded.about, state.failed));
  text("kept-shown", loaded.about.words);
  show("kept-words", false);
  view.show({ path: `api/history/${state.seq}/picture/surface?seq=${state.seq}`, seq: state.seq, points });
}

// Shows the result of a SEQ.
export async function openKept(seq, boot) {
  state.seq = seq;
  state.found = null;
  state.asked += 1;
  let found;
  try { found = await ask("GET", `api/history/${seq}`); } catch (error) {
    text("history-counts", error.message);
    return;
  }
  if (state.seq !== seq) return;
  const { result, no_frames } = found;
  state.result = result;
  state.failed = result.gauges.filter((one) => one.square && !decided(one).pass).map((one) => one.square);
  points = result.valid_points;
  text("kept-number", `no. ${seq}`);
  $("kept-verdict").className = `tag ${result.verdict.toLowerCase()}`;
  text("kept-verdict", result.verdict);
  text("kept-reason", result.reason || "");
  fill($("kept-gauges"), ...result.gauges.map(gauge));
  fill($("kept-facts"), ...facts(found, boot));
  show("kept-pictures", !no_frames);
  $("kept-frames").href = `api/history/${seq}/recording.zip`;
  text("no-frames", no_frames ? `No pictures: ${no_frames}.` : "");
  show("kept", true);
  $("kept").focus({ preventScroll: true });
  $("kept").scrollIntoView({ block: "start" });
  if (!no_frames) picture();
}

// The result that is shown.
export function kept() { return state.result; }

export function start() {
  view = viewOf($("kept-map"));
  on($("kept-close"), "click", () => { state.asked += 1; state.seq = 0; show("kept", false); });
  for (const choice of document.querySelectorAll("[data-kept]")) {
    on(choice, "click", () => {
      for (const other of document.querySelectorAll("[data-kept]")) other.setAttribute("aria-pressed", other === choice);
      state.layer = choice.dataset.kept;
      picture();
    });
  }
}
