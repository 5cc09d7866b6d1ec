// The users of this device and their roles, for an engineer; and the password of the one who is signed in.
import { $, button, cells, fill, heading, label, make, on, show, text } from "./element.js";
import { ask } from "./api.js";
import { date } from "./number.js";
import { choose } from "./question.js";
import { ROLES, account, change, may, needed, refresh } from "./session.js";

const LIST = "GET /api/users";
let visible = false;
let users = [];

const path = (name) => `api/users/${encodeURIComponent(name)}`;

// Somebody who is there keeps the password unless another is typed.
function follow() {
  const known = users.some(({ name, fixed }) => name === $("user-name").value && !fixed);
  text("user-put", known ? "Change" : "Add");
  $("user-secret").required = !known;
  $("user-secret").placeholder = known ? "unchanged" : "";
}

function row({ name, role, fixed, pin, since_utc_us: since, by }) {
  const alter = button("Change", "", () => {
    $("user-name").value = name;
    $("user-role").value = role;
    follow();
    $("user-role").focus();
  });
  const drop = button("Remove", "", () => remove(name));
  const own = fixed ? ["", "the secret of this device"] : [since ? date(since) : "not known", by || "not known"];
  return make("tr", "", heading("row", name), ...cells(role + (pin ? ", PIN" : ""), ...own), make("td", "actions", ...(fixed ? [] : [label(alter, `Change ${name}`), label(drop, `Remove ${name}`)])));
}

async function list() {
  const mine = visible && may(LIST);
  show("users-open", mine);
  show("users-locked", !mine);
  text("users-locked", `The list of users ${needed(LIST)}.`);
  show("own", Boolean(account()));
  text("own-words", `Signed in as ${account()}.`);
  if (!mine) return;
  try {
    ({ users } = await ask("GET", "api/users"));
    fill($("user-rows"), ...users.map(row));
    follow();
  } catch (error) { text("user-words", error.message); }
}

// The user who is signed in may be the one that was changed.
async function changed(words) {
  await Promise.all([list(), refresh()]);
  text("user-words", words);
}

function put() {
  const name = $("user-name").value.trim(), role = $("user-role").value;
  change(async () => {
    await ask("PUT", path(name), { role, secret: $("user-secret").value || undefined });
    $("users-form").reset();
    await changed(`${name} is ${role}`);
  }, "", "user-words");
}

function remove(name) {
  return change(async () => {
    const words = `${name} is signed out and cannot sign in again. The record of changes keeps the name.`;
    if (!await choose(`Remove ${name}?`, words, [["Remove", true]])) return;
    await ask("DELETE", path(name));
    await changed(`${name} is removed`);
  }, "", "user-words");
}

export function openUsers(open) {
  visible = open;
  text("user-words", "");
  list();
}

export function start() {
  fill($("user-role"), ...ROLES.map((role) => new Option(role, role)));
  on(window, "session", list);
  on($("user-name"), "input", follow);
  on($("users-form"), "submit", put);
  on($("own"), "submit", () => {
    change(async () => {
      await ask("PUT", "api/session", { secret: $("own-old").value, new: $("own-new").value });
      $("own").reset();
      text("own-words", "The password is changed.");
    }, "", "own-words");
  });
}
