// Signing in and out. Looking needs neither.
import { $, on, show, text } from "./element.js";
import { ask } from "./api.js";

let signedIn = false;
let after = null;

export const isSignedIn = () => signedIn;

function mark(yes) {
  const changed = yes !== signedIn;
  signedIn = yes;
  text("sign", yes ? "Sign out" : "Sign in");
  document.body.classList.toggle("signed-in", yes);
  if (changed) window.dispatchEvent(new Event("session"));
}

export async function refresh() {
  try { mark((await ask("GET", "api/session")).signed_in); } catch (gone) { mark(false); }
}

export function notice(words, bad = false) {
  const element = $("notice");
  element.classList.toggle("bad", bad);
  text("notice", words);
  element.hidden = !words;
  clearTimeout(notice.timer);
  if (words && !bad) notice.timer = setTimeout(() => { element.hidden = true; }, 8000);
}

// Asks for the secret, then does what comes `next`.
export function open(next) {
  after = next;
  show("sign-in", true);
  text("sign-words", next ? "a change needs the secret of this device" : "");
  $("secret").value = "";
  $("secret").focus();
  window.scrollTo(0, 0);
}

// Does something that needs a session: asks for the secret first if there is none, and shows the outcome.
export async function change(act, done) {
  const attempt = async () => {
    try {
      const answer = await act();
      if (done) notice(done);
      return answer;
    } catch (error) {
      if (error.status === 401) { mark(false); open(attempt); return undefined; }
      notice(error.message, true);
      return undefined;
    }
  };
  return signedIn ? attempt() : (open(attempt), undefined);
}

export function start() {
  refresh();
  on($("sign"), "click", async () => {
    if (!signedIn) { open(null); return; }
    try { await ask("DELETE", "api/session"); } finally { await refresh(); }
  });
  on($("sign-cancel"), "click", () => show("sign-in", false));
  on($("sign-in"), "submit", async () => {
    try {
      // The device uses the time if its own clock is not synchronised.
      const { time } = await ask("POST", "api/session", { secret: $("secret").value, time_ms: Date.now() });
      if (time === "refused") notice("the clock of this computer is wrong: set it, then sign in again to date results", true);
      if (time === "taken") window.dispatchEvent(new Event("dated"));
      mark(true);
      show("sign-in", false);
      const next = after;
      after = null;
      if (next) await next();
    } catch (error) {
      text("sign-words", error.message);
      $("secret").select();
    }
  });
}
