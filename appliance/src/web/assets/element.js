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

// A button that does something; it is disabled until that has ended.
export function button(words, kind, act) {
  const made = make("button", kind, words);
  made.type = "button";
  made.addEventListener("click", async () => {
    made.disabled = true;
    try { await act(); } finally { made.disabled = false; }
  });
  return made;
}
