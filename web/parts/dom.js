// Makes DOM nodes. Text is always a text node, so nothing that a server or a manifest
// says can become markup; that is also what the Content-Security-Policy relies on.

const SVG = "http://www.w3.org/2000/svg";

/** `h("a", {href, class, onclick, dataset: {...}, style: {...}}, "text", node, [more])`. */
export function h(tag, attrs, ...children) {
  return fill(document.createElement(tag), attrs, children);
}

/** The same for SVG. */
export function svg(tag, attrs, ...children) {
  return fill(document.createElementNS(SVG, tag), attrs, children);
}

function fill(node, attrs, children) {
  for (const [name, value] of Object.entries(attrs || {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "dataset") Object.assign(node.dataset, value);
    // One property at a time: a style attribute would be refused by the policy.
    else if (name === "style") for (const [k, v] of Object.entries(value)) node.style.setProperty(k, v);
    else if (name === "value" && "value" in node) node.value = value;
    else node.setAttribute(name, value === true ? "" : value);
  }
  add(node, children);
  return node;
}

/** Appends children: nodes, text, numbers, arrays of them; null and false are nothing. */
export function add(node, children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    node.append(child instanceof Node ? child : String(child));
  }
  return node;
}

/** Replaces what is in a node. */
export function set(node, ...children) {
  node.replaceChildren();
  return add(node, children);
}

/** Changes text only where it differs, so that live regions do not repeat themselves. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

let lastId = 0;
/** An id for label and input, or tab and panel. */
export const uid = (prefix) => `${prefix}-${++lastId}`;

/** Calls `f` once things have been quiet for `ms`. `.cancel()` forgets a call to come. */
export function debounce(f, ms) {
  let timer;
  const later = (...args) => {
    clearTimeout(timer);
    timer = setTimeout(() => f(...args), ms);
  };
  later.cancel = () => clearTimeout(timer);
  return later;
}

/** Calls `f` at once and then at most every `ms`, the last call never lost. */
export function throttle(f, ms) {
  let last = -Infinity;
  let timer = null;
  const soon = () => {
    if (timer) return;
    const wait = Math.max(0, last + ms - performance.now());
    timer = setTimeout(() => {
      timer = null;
      last = performance.now();
      f();
    }, wait);
  };
  soon.cancel = () => clearTimeout(timer);
  return soon;
}

/** Calls `f` once a frame, however often it is asked for. */
export function onceAFrame(f) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      f();
    });
  };
}

/** A label above its control. */
export function field(label, control, { hint, wide } = {}) {
  control.id ||= uid("field");
  const hintId = hint ? uid("hint") : null;
  if (hintId) control.setAttribute("aria-describedby", hintId);
  return h(
    "div",
    { class: wide ? "field wide" : "field" },
    h("label", { for: control.id }, label),
    control,
    hint && h("p", { class: "hint", id: hintId }, hint),
  );
}

/** A <select>; options are `value` or `[value, text]`. */
export function select(options, value, onchange, attrs = {}) {
  const node = h("select", { ...attrs, onchange: () => onchange(node.value) });
  for (const option of options) {
    const [v, text] = Array.isArray(option) ? option : [option, option];
    node.append(h("option", { value: v, selected: String(v) === String(value) }, text));
  }
  return node;
}

/** A button; `why` says why it cannot be used and disables it without hiding it. */
export function button(text, onclick, { why, ...attrs } = {}) {
  return h(
    "button",
    {
      type: "button",
      ...attrs,
      // aria-disabled keeps it reachable, so that the reason can be read.
      "aria-disabled": why ? "true" : null,
      title: why || attrs.title,
      onclick: (event) => {
        if (why) {
          event.preventDefault();
          document.dispatchEvent(new CustomEvent("notice", { detail: why }));
        } else onclick(event);
      },
    },
    text,
  );
}

/** A name that may go on in the next line after an underscore, and nowhere else. */
export const breakable = (name) => name.split(/(?<=_)/).map((part, i) => [i ? h("wbr") : null, part]);

/** The top of a page: its name, what it is for, and beside them what acts on all of it. */
export const pageHead = (title, about, ...tools) =>
  h(
    "div",
    { class: "head" },
    h("div", null, h("h1", null, title), about && h("p", { class: "muted" }, about)),
    tools.length > 0 && h("div", { class: "head-tools" }, tools),
  );
