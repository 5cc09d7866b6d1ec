// A question before something is replaced or deleted. It keeps the keyboard focus until it is answered; Escape is Cancel.
import { $, button, fill, show, text } from "./element.js";

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
  const choices = Array.from($("question-choices").children);
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
    show("question", true);
    cancel.focus();
  });
}

export function start() { $("question").addEventListener("keydown", keys); }
