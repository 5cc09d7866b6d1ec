"use strict";
// Follows /events and shows each snapshot. The page never trusts what it shows: when no event comes for STALE_MS, or the
// measuring task's heartbeat stands still for as long, the verdict is covered.
const STALE_MS = 2000;
const $ = (id) => document.getElementById(id);
const text = (id, words) => { const element = $(id); if (element.textContent !== words) element.textContent = words; };
const show = (id, visible) => { $(id).hidden = !visible; };

let source = null;
let lastEvent = performance.now();
let lastBeat = { value: null, at: performance.now() };
let boot = null;
let shownSeq = null;

const STATES = {
  boot: ["starting", "wait"], ready: ["ready", "ready"], acquiring: ["exposing", "busy"], processing: ["computing", "busy"],
  loading: ["loading a recipe", "busy"], teaching: ["teaching", "busy"], offline: ["offline: the PLC does not ask for it", "wait"],
  fault: ["fault", "fault"], stopping: ["stopping", "wait"],
};
const SENTENCES = {
  PASS: "every gauge is within its limits",
  FAIL: "at least one gauge is outside its limits",
  INVALID: "not everything could be measured",
};

function milliseconds(us) {
  const ms = us / 1000;
  return ms >= 1000 ? `${(ms / 1000).toFixed(2)} s` : ms >= 10 ? `${ms.toFixed(0)} ms` : `${ms.toFixed(1)} ms`;
}

// Digits as the sensor resolves them; a σ gets one more.
function quantity(value, gauge, more = 0, bare = false) {
  const share = gauge.kind === "share";
  const places = (share || gauge.kind === "volume" ? 2 : 3) + more;
  const digits = (share ? 100 * value : value).toFixed(places).replace("-", "\u2212");
  if (bare) return digits;
  return `${digits}${share ? " %" : gauge.unit === "°" ? "°" : gauge.unit ? ` ${gauge.unit}` : ""}`;
}

function element(name, className, words) {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (words !== undefined) made.textContent = words;
  return made;
}

function limits(gauge) {
  const cell = element("td", "limits");
  const { lowest, highest, value } = gauge;
  if (lowest === null && highest === null) { cell.append(element("small", "", "none")); return cell; }
  const low = lowest ?? Math.min(0, highest);
  const high = highest ?? Math.max(lowest * 1.2, (gauge.kind === "share" ? 1 : lowest + Math.abs(lowest)));
  const span = high - low || 1;
  const from = lowest === null ? low : low - span / 4;
  const to = highest === null ? high : high + span / 4;
  const place = (x) => `${Math.min(100, Math.max(0, 100 * (x - from) / (to - from)))}%`;
  const track = element("div", "track");
  const band = element("span", "band");
  band.style.left = place(low);
  band.style.right = `calc(100% - ${place(high)})`;
  track.append(band);
  if (value !== null) { const mark = element("span", "mark"); mark.style.left = place(value); track.append(mark); }
  const words = lowest === null ? `≤ ${quantity(highest, gauge)}` : highest === null ? `≥ ${quantity(lowest, gauge)}`
    : `${quantity(lowest, gauge, 0, true)} … ${quantity(highest, gauge)}`;
  cell.append(track, element("small", "", words));
  return cell;
}

function gaugeRow(gauge) {
  const row = document.createElement("tr");
  const value = document.createElement("td");
  value.append(element("span", "value", gauge.value === null ? "not measured" : quantity(gauge.value, gauge)));
  if (gauge.value !== null && gauge.sigma !== null) value.append(element("small", "", `± ${quantity(gauge.sigma, gauge, 1)}`));
  const verdict = document.createElement("td");
  const [kind, words] = !gauge.valid ? ["invalid", "? invalid"] : gauge.pass ? ["pass", "✓ pass"] : ["fail", gauge.low ? "✗ low" : gauge.high ? "✗ high" : "✗ fail"];
  verdict.append(element("span", `tag ${kind}`, words));
  if (gauge.doubtful) verdict.append(element("small", "", "close to a limit"));
  row.append(element("td", "", gauge.name), value, limits(gauge), verdict);
  return row;
}

function showStages(result) {
  text("total", milliseconds(result.total_us));
  const processing = [{ name: "processing", us: Math.max(0, result.total_us - result.exposure_us) }];
  const stages = [{ name: "exposure", us: result.exposure_us }, ...(result.stages.length ? result.stages : processing)];
  const sum = stages.reduce((total, stage) => total + stage.us, 0) || 1;
  $("stages-bar").replaceChildren(...stages.map((stage, k) => {
    const part = element("span", `s${k % 8}`);
    part.style.width = `${100 * stage.us / sum}%`;
    return part;
  }));
  $("stages").replaceChildren(...stages.map((stage, k) => {
    const line = document.createElement("li");
    line.append(element("span", `swatch s${k % 8}`), element("span", "", stage.name), element("b", "", milliseconds(stage.us)));
    return line;
  }));
}

function showResult(result) {
  show("no-gauges", !result || result.gauges.length === 0);
  if (!result) { $("gauge-rows").replaceChildren(); return; }
  text("no-gauges", "this result has no gauges");
  $("gauge-rows").replaceChildren(...result.gauges.map(gaugeRow));
  showStages(result);
  const points = result.valid_points.toLocaleString("en").replaceAll(",", " ");
  const { outside, unexpected, dark } = result.skipped;
  const skipped = [[outside, "outside of the regions"], [unexpected, "not expected"], [dark, "dark"]]
    .filter(([count]) => count > 0).map(([count, words]) => `${count.toLocaleString("en").replaceAll(",", " ")} ${words}`);
  text("height-words", result.valid_points ? [`${points} points`, `${(result.coverage_permille / 10).toFixed(1)} % of the regions`, ...skipped].join(" · ") : "");
  // Without a single point the picture would be that of an older part.
  if (!result.valid_points) {
    show("picture", false);
    show("no-picture", true);
    text("no-picture", "no height was measured");
    return;
  }
  const picture = new Image();
  picture.onload = () => { $("picture").src = picture.src; show("picture", true); show("no-picture", false); };
  picture.onerror = () => { show("picture", false); show("no-picture", true); text("no-picture", "no picture of this result"); };
  picture.src = `/height.png?seq=${result.seq}&boot=${boot}`;
}

function partWords(result) {
  const words = [`no. ${result.seq}`, `part ${result.part_id}`];
  if (result.press_stroke) words.push(`stroke ${result.press_stroke}`);
  if (result.token) words.push(`token ${result.token}`);
  if (result.time_utc_us) words.push(new Date(result.time_utc_us / 1000).toLocaleTimeString([], { hour12: false }));
  if (result.simulated) words.push("simulated head");
  return words.join(" · ");
}

function showVerdict(now) {
  const panel = $("verdict");
  const result = now.result;
  const measuring = now.state === "acquiring" || now.state === "processing";
  // An old verdict keeps its words but loses its colour: it says nothing about what lies under the head now.
  const past = Boolean(result) && !measuring && now.state !== "ready";
  panel.classList.toggle("past", past);
  document.body.classList.toggle("past", past || measuring);
  panel.dataset.verdict = measuring ? "MEASURING" : result ? result.verdict : "NONE";
  if (measuring) {
    text("word", "MEASURING");
    text("sentence", now.state === "acquiring" ? "the part must lie still" : "the part may move");
    text("part", result ? `before: ${result.verdict}, no. ${result.seq}` : "");
  } else if (result) {
    text("word", past ? `last: ${result.verdict}` : result.verdict);
    text("sentence", result.reason ?? SENTENCES[result.verdict] ?? "");
    text("part", partWords(result));
  } else {
    text("word", "NO RESULT");
    text("sentence", now.ready ? "waiting for the first trigger" : "nothing was measured since the start");
    text("part", "");
  }
}

function showSnapshot(now) {
  const [words, kind] = STATES[now.state] ?? [now.state, "wait"];
  $("state").dataset.state = now.state === "ready" && !now.ready ? "wait" : kind;
  text("state-words", now.state === "ready" && !now.ready ? "no recipe is active" : words);
  text("recipe-name", now.recipe ? `Recipe ${now.recipe.number} · ${now.recipe.name}` : "no recipe");
  text("fingerprint", now.recipe ? now.recipe.fingerprint : "");
  show("fault", Boolean(now.fault));
  if (now.fault) {
    text("fault-code", `${now.fault.code} · ${now.fault.family}`);
    text("fault-cause", now.fault.cause);
    text("fault-remedy", now.fault.remedy);
  }
  show("teach", Boolean(now.teach));
  if (now.teach) {
    text("teach-number", String(now.teach.number));
    $("teach-bar").value = now.teach.fraction;
    text("teach-percent", `${Math.round(100 * now.teach.fraction)} %`);
    text("teach-words", now.teach.words);
  }
  showVerdict(now);
  const seq = now.result ? `${now.boot_id}/${now.result.seq}` : `${now.boot_id}/none`;
  boot = now.boot_id;
  if (seq !== shownSeq) { shownSeq = seq; showResult(now.result); }
  for (const name of ["triggers", "results", "missed", "sequence", "buffered"]) text(name, String(now.counters[name]));
  $("missed-cell").classList.toggle("latched", now.missed_trigger);
  const notes = now.warnings.map((warning) => `warning: ${warning}`);
  if (now.buffer_overflow) notes.push("a result was not queued: the PLC does not acknowledge");
  if (now.warming_up) notes.push("warming up");
  if (now.error && !now.fault) notes.push(`error ${now.error.code}: ${now.error.words}`);
  text("notes", notes.join(" · "));
  text("identity", `${now.identity.product} · ${now.identity.serial} · ${now.identity.version}`);
  const hours = Math.floor(now.uptime_s / 3600), minutes = Math.floor(now.uptime_s / 60) % 60;
  text("uptime", `up ${hours} h ${String(minutes).padStart(2, "0")} min · heartbeat ${now.heartbeat}`);
  document.title = `${now.result && now.state === "ready" ? now.result.verdict : words} · fringed`;
}

function checkStale() {
  const now = performance.now();
  const silent = now - lastEvent > STALE_MS;
  const still = now - lastBeat.at > STALE_MS;
  const stale = silent || still;
  document.body.classList.toggle("stale", stale);
  show("stale", stale);
  if (!stale) return;
  document.title = "STALE · fringed";
  $("state").dataset.state = "wait";
  text("state-words", "not live");
  const seconds = Math.floor((now - (silent ? lastEvent : lastBeat.at)) / 1000);
  text("stale-words", silent ? `no word from the sensor for ${seconds} s` : `the measuring task's heartbeat stands still for ${seconds} s`);
}

function follow() {
  source = new EventSource("/events");
  source.addEventListener("snapshot", (event) => {
    const snapshot = JSON.parse(event.data);
    const now = performance.now();
    lastEvent = now;
    if (snapshot.heartbeat !== lastBeat.value) lastBeat = { value: snapshot.heartbeat, at: now };
    showSnapshot(snapshot);
    checkStale();
  });
}

follow();
setInterval(() => {
  checkStale();
  // The browser reconnects by itself unless the server refused it.
  if (source.readyState === EventSource.CLOSED) follow();
}, 500);
document.addEventListener("visibilitychange", checkStale);
