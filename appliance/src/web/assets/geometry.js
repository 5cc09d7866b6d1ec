// The poses of the board: takes, shows and forgets them, and says which are missing.
import { $, button, disable, fill, label, make, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { change, needs } from "./session.js";
import { choose } from "./question.js";
import { showPicture } from "./live.js";
import { place } from "./simulation.js";

// Poses that are needed for a good result, and those that are recommended.
const LEAST = 6, GOOD = 10;
// Where to put the board for each of the recommended poses; in the last one it lies in the reference plane.
const POSES = [
  "left in the picture, its upper side lifted by 30°", "right in the picture, its lower side lifted by 30°",
  "turned by 90°, in the upper half of the picture, its left side lifted by 30°", "turned by 90°, in the lower half of the picture, its right side lifted by 30°",
  "in the upper right of the picture, its left side lifted by 35°", "in the lower left of the picture, its right side lifted by 25°",
  "turned by 45° and nearer to the head, one corner lifted by 30°", "turned by 45° the other way and farther from the head, the opposite corner lifted by 30°",
  "as far from the head as parts may be, turned and tilted by 15°", "flat in the reference plane z = 0, where the parts will lie",
];
const state = { board: null, edited: false, chosen: 0, shown: "", key: "", poses: [] };

const boardAsTyped = () => `checker:${$("board-columns").value}x${$("board-rows").value}:${Number($("board-square").value)}`;

async function send(body) {
  await change(async () => {
    await ask("POST", "api/head/steps/geometry", body);
    state.edited = false;
  });
  window.dispatchEvent(new Event("head"));
}

async function take() {
  if (!$("board").reportValidity()) return;
  const board = boardAsTyped();
  const other = state.board && board !== state.board && state.poses.length;
  const words = "The poses that were taken show another board. They are forgotten when a pose of this one is taken.";
  if (!other || await choose("Take another board?", words, [["Forget the poses", true]])) send({ action: "pose", board });
}

async function showPose() {
  const pose = state.poses.find((one) => one.number === state.chosen);
  for (const row of $("poses").children) row.querySelector(".open").setAttribute("aria-pressed", Number(row.dataset.pose) === state.chosen);
  show("pose-shown", pose);
  const wanted = pose ? `${pose.number}/${pose.corners}/${pose.problem}/${state.poses.length}` : "";
  if (wanted === state.shown) return;
  state.shown = wanted;
  if (!pose) return;
  $("pose-picture").setAttribute("aria-label", `the board in pose ${pose.number}, with the corners that were found: ${pose.corners} of ${pose.of}`);
  try { await showPicture("pose-picture", "pose-words", `api/head/poses/${pose.number}/picture`); } catch (error) {
    text("pose-words", error.message);
    show("pose-words", true);
  }
}

// "117 of 117 corners · tilted by 24° · camera 0.05 px, projector 0.04 px"
function figures({ corners, of, tilt_degrees, camera_px, projector_px }) {
  const words = [`${corners} of ${of} corners`];
  if (tilt_degrees !== null) words.push(`tilted by ${tilt_degrees.toFixed(0)}°`);
  if (camera_px !== null) words.push(`camera ${camera_px.toFixed(2)} px, projector ${projector_px.toFixed(2)} px`);
  return words.join(" · ");
}

function row(pose, busy) {
  const { number, usable, problem } = pose;
  const look = button(`Pose ${number}`, "open", () => { state.chosen = number; showPose(); });
  const forget = label(button("Forget", "", () => send({ action: "forget", pose: number })), `Forget pose ${number}`);
  needs(forget, "POST /api/head/steps/{name}");
  disable(forget, busy);
  const words = make("div", "", make("span", usable ? "" : "bad", usable ? "✓ can be used" : `✗ cannot be used: ${problem}`), make("small", "", figures(pose)));
  const line = make("li", "", look, words, forget);
  line.dataset.pose = number;
  return line;
}

function advice(usable, result) {
  if (result) return "";
  if (usable >= GOOD) return `${usable} poses can be used: solve.`;
  const many = `${usable} ${usable === 1 ? "pose" : "poses"} can be used`;
  const more = usable < LEAST ? `at least ${LEAST - usable} more needed` : `you may solve, but ${GOOD} are better, and in the last one the board must lie in z = 0`;
  return `${many}; ${more}. Next: the board ${POSES[usable]}. It must not move while the pose is taken.`;
}

function showBoard(board) {
  if (!board || state.edited || board === state.board) return;
  state.board = board;
  const [, columns, rows, square] = /^\w+:(\d+)x(\d+):([\d.]+)$/.exec(board) || ["", "", "", ""];
  $("board-columns").value = columns;
  $("board-rows").value = rows;
  $("board-square").value = square;
  $("board-print").href = `api/head/board.pdf?board=${board}`;
}

const SCALES = { unchecked: "not checked", length: "checked by the length", baseline: "as before" };

function showResult(result) {
  show("geometry-result", result);
  if (!result) return;
  text("result-camera", `${result.camera_px.toFixed(3)} px`);
  text("result-projector", `${result.projector_px.toFixed(3)} px`);
  text("result-height", `${(1000 * result.height_sigma_mm).toFixed(1)} µm`);
  text("result-length", `${(1000 * result.length_sigma_mm).toFixed(1)} µm`);
  text("result-scale", SCALES[result.scale] || result.scale);
}

function showPoses(poses, busy) {
  const key = JSON.stringify([poses, busy]);
  if (key === state.key) return;
  state.key = key;
  const last = (some) => (some.length ? some[some.length - 1].number : 0);
  const taken = poses.filter((pose) => !state.poses.some((other) => other.number === pose.number && other.problem === pose.problem));
  state.poses = poses;
  // A pose that was just taken is shown; a chosen one stays unless it is forgotten.
  if (taken.length) {
    state.chosen = last(taken);
    $("board-pose").value = String(Math.min(GOOD, last(poses) + 1));
  } else if (!poses.some((pose) => pose.number === state.chosen)) state.chosen = last(poses);
  fill($("poses"), ...poses.map((pose) => row(pose, busy)));
  showPose();
}

export function showGeometry(geometry, busy) {
  showBoard(geometry.board);
  showPoses(geometry.poses, busy);
  const { poses, frame_covered: covered, tilt_degrees: tilts, result } = geometry;
  text("pose-next", advice(poses.filter((pose) => pose.usable).length, result));
  text("covered", `${(100 * covered).toFixed(0)} %`);
  text("tilts", tilts === null ? "after solving" : `${tilts.toFixed(0)}°`);
  $("covered-bar").value = covered;
  showResult(result);
}

export function start() {
  on($("board"), "input", () => {
    state.edited = true;
    $("board-print").href = `api/head/board.pdf?board=${boardAsTyped()}`;
  });
  on($("board"), "submit", () => {});
  on($("pose-take"), "click", take);
  fill($("board-pose"), ...POSES.map((words, at) => new Option(`pose ${at + 1}`, at + 1)));
  const putters = [
    ["board-place", () => ({ part: "board", pose: Number($("board-pose").value) }), "the board is in place"],
    ["plate-place", () => ({ part: "plane" }), "the plate is in place"],
    ["part-place", () => ({ part: "sheet_metal" }), "a good part is in place"],
    ["empty-place", () => ({ part: "empty" }), "the part is taken away"],
  ];
  for (const [id, wanted, words] of putters) {
    on(needs($(id), "PUT /api/simulation/part"), "click", () => place(wanted(), words));
  }
}
