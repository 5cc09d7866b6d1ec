// Requests to this device. Errors carry words for people.

// The error that an answer reports.
async function failure(response) {
  const content = await response.json().catch(() => null);
  const error = new Error(content && content.error ? content.error : `the device answers ${response.status}`);
  error.status = response.status;
  error.taken = content && content.taken;
  error.why = content && content.why;
  error.role = content && content.role;
  // The session has ended, or its user has another role now.
  if (error.status === 401 || error.role) window.dispatchEvent(new Event("refused"));
  return error;
}

export async function ask(method, path, body) {
  const options = { method, credentials: "same-origin", headers: {} };
  if (body instanceof Blob) options.body = body;
  else if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers["Content-Type"] = "application/json";
  }
  let response;
  try { response = await fetch(path, options); } catch (gone) { throw new Error("the device does not answer; check the network"); }
  if (!response.ok) throw await failure(response);
  return response.json().catch(() => null);
}

// The table of what gauges can measure; the kind of a gauge; and its unit with the limits that it can have, which a word may decide.
export function loadKinds() { return ask("GET", "api/kinds"); }
export function kindOf({ kinds }, gauge) { return kinds.find((one) => one.kind === gauge.kind); }
// The corners of a feature in the picture; of a section its ends.
export function cornersOf({ region, from, to }) { return region || [from, to]; }
export function unitOf(table, gauge) {
  const { parameters, unit } = kindOf(table, gauge);
  const chosen = parameters.flatMap(({ name, choices = [] }) => choices.filter(({ word }) => word === gauge[name]));
  const own = chosen.length ? chosen[0].unit : unit;
  return table.units.find((one) => one.unit === own);
}

// Hands each line of JSON of an answer to `take` as it comes, until that answers false.
export async function lines(path, take) {
  const response = await fetch(path, { credentials: "same-origin" }).catch(() => { throw new Error("the device does not answer; check the network"); });
  if (!response.ok) throw await failure(response);
  const reader = response.body.getReader(), decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read().catch(() => { throw new Error("the answer broke off: try again"); });
    if (done) return;
    const all = (rest + decoder.decode(value, { stream: true })).split("\n");
    rest = all.pop();
    if (!all.every((line) => take(JSON.parse(line)) !== false)) { reader.cancel(); return; }
  }
}

// A picture, to be drawn on a canvas.
export async function picture(path) {
  const response = await fetch(path, { credentials: "same-origin", cache: "no-store" });
  if (!response.ok) throw await failure(response);
  return createImageBitmap(await response.blob());
}

// The words of a map, and their description. Where there is no map, the error says why.
export async function words(path) {
  const response = await fetch(path, { credentials: "same-origin" });
  if (!response.ok) throw await failure(response);
  if (response.status === 204) throw new Error(response.headers.get("x-none"));
  return { about: JSON.parse(response.headers.get("x-map")), buffer: await response.arrayBuffer() };
}

// A map: its description and its values, NaN where there is none.
export async function map(path) {
  const { about, buffer } = await words(path);
  const view = new DataView(buffer);
  const values = new Float32Array(view.byteLength / 2);
  for (let at = 0; at < values.length; at += 1) {
    const word = view.getUint16(2 * at, true);
    values[at] = word === 65535 ? NaN : about.low + about.step * word;
  }
  return { about, values };
}
