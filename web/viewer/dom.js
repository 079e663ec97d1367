// Building elements without strings of HTML: nothing that a server or a file says can
// become markup, and a strict content security policy has nothing to object to.

/** `el("button", {class: "x", text: "Go", onclick: f, "aria-label": "Go"}, child, ...)` */
export function el(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(props)) {
    if (value === undefined || value === null || value === false) continue;
    if (key === "class") node.className = value;
    else if (key === "text") node.textContent = value;
    else if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key === "value" || key === "checked" || key === "disabled") node[key] = value;
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.filter((c) => c !== null && c !== undefined));
  return node;
}

let ids = 0;
export const freshId = () => `cmv-${(ids += 1)}`;

export const button = (text, onclick, props = {}) => el("button", { type: "button", text, onclick, ...props });

export function checkbox(label, checked, onchange, title) {
  const input = el("input", { type: "checkbox", checked, onchange: () => onchange(input.checked) });
  return { input, node: el("label", { class: "cmv-check", title }, input, el("span", { text: label })) };
}

export function select(label, options, value, onchange, props = {}) {
  const input = el("select", { "aria-label": label, ...props });
  for (const [key, text] of options) input.append(el("option", { value: key, text }));
  input.value = value;
  input.addEventListener("change", () => onchange(input.value));
  return input;
}

/** A slider with its label and its value in words. */
export function slider(label, { min, max, step, value, say }, oninput) {
  const id = freshId();
  const output = el("output", { for: id, text: say(value) });
  const input = el("input", { type: "range", id, min, max, step });
  input.value = value;
  input.addEventListener("input", () => {
    output.textContent = say(Number(input.value));
    oninput(Number(input.value));
  });
  const set = (v) => {
    input.value = v;
    output.textContent = say(Number(input.value));
  };
  return { input, set, node: el("div", { class: "cmv-slider" }, el("label", { for: id, text: label }), output, input) };
}

// As on the other pages: thin spaces between groups of three, four digits together.
const THIN = "\u202f";
export const number = (n) => (Math.abs(n) < 1e4 ? String(n) : String(n).replace(/\B(?=(\d{3})+$)/g, THIN));

export function percent(part, of) {
  if (!(of > 0)) return "";
  const share = (100 * part) / of;
  // A few of a million must not read as none.
  if (part > 0 && share < 0.01) return "< 0.01 %";
  return `${share.toFixed(part > 0 && share < 1 ? 2 : 1)} %`;
}

/** Saves text or a blob as a file of the reader's. */
export function save(blob, name) {
  const link = el("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

/** What a failure says: the server's detail and help where there are any. */
export const explain = (error) => {
  const text = error?.detail || error?.message || String(error);
  return error?.help ? `${text} (${error.help})` : text;
};
