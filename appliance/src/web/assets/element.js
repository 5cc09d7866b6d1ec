// Finds, makes and fills elements of the page. Text is inserted as text, never as HTML.
export const $ = (id) => document.getElementById(id);

export function text(id, words) {
  const element = $(id);
  if (element.textContent !== words) element.textContent = words;
}

export function show(id, visible) { $(id).hidden = !visible; }

// An element of HTML: make("td", "class", child or words, …).
export function make(name, kind, ...children) {
  const made = document.createElement(name);
  if (kind) made.className = kind;
  made.append(...children);
  return made;
}

// An element with a name for those who hear the page.
export function label(element, words) {
  element.setAttribute("aria-label", words);
  return element;
}

// A cell at the head of a "row" or a "col".
export function heading(scope, ...children) {
  const made = make("th", "", ...children);
  made.scope = scope;
  return made;
}

export const cells = (...all) => all.map((one) => make("td", "", one));

// A table that scrolls where it is wider than the screen, also by keys.
export function scrolling(name, ...children) {
  const made = label(make("div", "scroll", make("table", "list", ...children)), name);
  made.tabIndex = 0;
  made.setAttribute("role", "region");
  return made;
}

// An element of SVG with attributes.
export function draw(name, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const key of Object.keys(attributes)) made.setAttribute(key, attributes[key]);
  made.append(...children);
  return made;
}

// Replaces everything inside an element.
export function fill(element, ...children) {
  while (element.firstChild) element.removeChild(element.firstChild);
  element.append(...children);
}

// Does something on an event of an element. No form is sent.
export function on(element, kind, act, options) {
  element.addEventListener(kind, (event) => {
    if (kind === "submit") event.preventDefault();
    return act(event);
  }, options);
}

// Disables an element for a reason of its own; one that the role may not use (`data-role`) stays disabled.
export function disable(element, yes) {
  element.held = yes;
  element.disabled = yes || Boolean(element.dataset.role);
}

// A button that does something; it is disabled until that has ended.
export function button(words, kind, act) {
  const made = make("button", kind, words);
  made.type = "button";
  on(made, "click", async () => {
    disable(made, true);
    try { await act(); } finally { disable(made, false); }
  });
  return made;
}
