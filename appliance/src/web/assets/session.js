// Signing in and out, and what the one who is signed in may do. Which role a request needs is said by the device alone.
import { $, disable, on, show, text } from "./element.js";
import { ask } from "./api.js";

// Each may do what those before it may.
export const ROLES = ["viewer", "operator", "technician", "engineer"];
// Who signs in with the secret of the device.
const OWNER = "engineer";
let session = { signed_in: false, user: null, role: ROLES[0], looking: "anyone", needs: {} };
let after = null;
// Titles of elements while they may be used.
const titles = new WeakMap();

const rank = (role) => ROLES.indexOf(role);
const least = (key) => session.needs[key] || ROLES[0];
const one = (role) => `${/^[aeo]/.test(role) ? "an" : "a"} ${role}`;

export const isSignedIn = () => session.signed_in;
// Whether nothing is shown before somebody signs in.
export const isLocked = () => !session.signed_in && session.looking === "signed-in";
// "anna (operator)" where a user of the list is signed in, else nothing.
export const account = () => (session.signed_in && session.user !== OWNER ? `${session.user} (${session.role})` : "");

// Whether the role that is signed in is too low for a request, which the device names: "POST /api/trigger". While nobody is signed in,
// a click asks to sign in.
export const isBarred = (key) => session.signed_in && rank(session.role) < rank(least(key));
export const may = (key) => session.signed_in && !isBarred(key);
// "needs a technician or an engineer"
export const needed = (key) => `needs ${ROLES.slice(rank(least(key))).map(one).join(" or ")}`;

// Disables an element that the role may not use, and says which role may.
function judge(element) {
  const key = element.dataset.needs, barred = isBarred(key);
  if (!titles.has(element)) titles.set(element, element.title);
  element.title = barred ? needed(key) : titles.get(element);
  if (barred) element.dataset.role = `needs ${one(least(key))}`; else delete element.dataset.role;
  disable(element, Boolean(element.held));
}

// Lets only those use an element who may make its request.
export function needs(element, key) {
  element.dataset.needs = key;
  judge(element);
  return element;
}

function mark(now) {
  if (JSON.stringify(now) === JSON.stringify(session)) return;
  session = now;
  const { signed_in, user, role } = session;
  text("sign", signed_in ? `Sign out ${user === OWNER ? "" : user}`.trim() : "Sign in");
  $("sign").title = signed_in ? `${user} (${role})` : "";
  document.body.classList.toggle("signed-in", signed_in);
  document.querySelectorAll("[data-needs]").forEach(judge);
  window.dispatchEvent(new Event("session"));
}

export async function refresh() {
  try { mark(await ask("GET", "api/session")); } catch (gone) { /* What was known stays. */ }
}

export function notice(words, bad = false) {
  const element = $("notice");
  element.classList.toggle("bad", bad);
  text("notice", words);
  element.hidden = !words;
  clearTimeout(notice.timer);
  if (words && !bad) notice.timer = setTimeout(() => { element.hidden = true; }, 8000);
}

// Asks who it is, then does what comes `next`.
export function open(next) {
  after = next;
  show("sign-in", true);
  text("sign-words", isLocked() ? "this device shows nothing before you sign in" : next ? "sign in to do this" : "");
  $("secret").value = "";
  $("user").focus();
  window.scrollTo(0, 0);
}

// Does something that needs a session: asks to sign in first if there is none, and shows the outcome. Why it failed is said as a notice,
// or in the element `place`.
export async function change(act, done, place) {
  const say = (words) => (place ? text(place, words) : notice(words, true));
  const attempt = async () => {
    try {
      const answer = await act();
      if (done) notice(done);
      return answer;
    } catch (error) {
      if (error.status === 401) {
        mark({ ...session, signed_in: false, user: null, role: ROLES[0] });
        open(attempt);
      } else say(error.message);
      return undefined;
    }
  };
  return session.signed_in ? attempt() : (open(attempt), undefined);
}

function close() {
  show("sign-in", false);
  $("sign").focus();
}

async function signIn() {
  try {
    const user = $("user").value.trim() || undefined;
    // The device uses the time if its own clock is not synchronised.
    const { time } = await ask("POST", "api/session", { user, secret: $("secret").value, time_ms: Date.now() });
    if (time === "refused") notice("the clock of this computer is wrong: set it, then sign in again to date results", true);
    if (time === "taken") window.dispatchEvent(new Event("dated"));
  } catch (error) {
    text("sign-words", error.message);
    $("secret").select();
    return;
  }
  await refresh();
  close();
  const next = after;
  after = null;
  if (next) await next();
}

// Answers when it is known who is signed in.
export function start() {
  on(window, "refused", refresh);
  on($("sign"), "click", async () => {
    if (!session.signed_in) { open(null); return; }
    try { await ask("DELETE", "api/session"); } finally { await refresh(); }
  });
  on($("sign-cancel"), "click", close);
  on($("sign-in"), "submit", signIn);
  return refresh();
}
