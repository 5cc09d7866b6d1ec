// A question before something is replaced or deleted. It keeps the keyboard focus until it is answered; Escape is Cancel.
import { $, button, fill, on, show, text } from "./element.js";

let answer = null;

function close(value) {
  if (!answer) return;
  const { resolve, opener } = answer;
  answer = null;
  show("question", false);
  resolve(value);
  // The button that asked may be disabled until its action has ended.
  setTimeout(() => { if (opener && opener.focus) opener.focus(); }, 0);
}

function keys(event) {
  if (event.key === "Escape") { event.preventDefault(); close(null); }
  if (event.key !== "Tab") return;
  const choices = Array.from($("question").querySelectorAll("input, button")).filter((one) => one.offsetParent);
  const at = choices.indexOf(document.activeElement), by = event.shiftKey ? -1 : 1;
  event.preventDefault();
  choices[(at + by + choices.length) % choices.length].focus();
}

// Asks; `choices` are pairs of a label and a value. Answers with the chosen value, null for Cancel.
export function choose(title, words, choices) {
  close(null);
  return new Promise((resolve) => {
    answer = { resolve, opener: document.activeElement };
    text("question-title", title);
    text("question-words", words);
    const offered = choices.map(([label, value]) => button(label, "strong", () => close(value)));
    const cancel = button("Cancel", "", () => close(null));
    fill($("question-choices"), ...offered, cancel);
    show("question-field", false);
    show("question", true);
    cancel.focus();
  });
}

// Asks for a text, which has a label; answers with it, null for Cancel.
export async function enter(title, words, label, value, action) {
  const field = $("question-text");
  const answered = choose(title, words, [[action, action]]);
  text("question-label", label);
  field.value = value;
  show("question-field", true);
  field.select();
  return (await answered) === null ? null : field.value.trim();
}

export function start() {
  on($("question-text"), "keydown", (event) => { if (event.key === "Enter") $("question-choices").firstChild.click(); });
  on($("question"), "keydown", keys);
}
