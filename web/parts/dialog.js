// Dialogs (confirm, help) and the short notices at the foot of the page.

import { h, set, uid } from "/parts/dom.js";

/**
 * Shows a dialog and waits: null when it was left, else the values of its named controls.
 * `body` are nodes; `danger` colours the button; the focus starts on the harmless one.
 */
export function ask({ title, body, confirm, danger = false }) {
  const id = uid("dialog");
  const cancel = h("button", { type: "button", onclick: () => dialog.close("") }, "Cancel");
  const yes = h("button", { class: danger ? "danger" : "primary", value: "yes" }, confirm);
  const form = h(
    "form",
    { method: "dialog" },
    h("h2", { id }, title),
    body,
    h("div", { class: "dialog-buttons" }, cancel, yes),
  );
  const dialog = h("dialog", { class: "dialog", "aria-labelledby": id }, form);
  document.body.append(dialog);
  const before = document.activeElement;
  dialog.showModal();
  (danger ? cancel : form.querySelector("input, select, textarea") || yes).focus();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      const values = Object.fromEntries(new FormData(form));
      dialog.remove();
      before?.focus?.();
      resolve(dialog.returnValue === "yes" ? values : null);
    });
  });
}

/** A dialog to read. */
export function show(title, ...body) {
  const id = uid("dialog");
  const dialog = h(
    "dialog",
    { class: "dialog", "aria-labelledby": id },
    h(
      "form",
      { method: "dialog" },
      h("h2", { id }, title),
      body,
      h("div", { class: "dialog-buttons" }, h("button", { class: "primary" }, "Close")),
    ),
  );
  document.body.append(dialog);
  dialog.addEventListener("close", () => dialog.remove());
  dialog.showModal();
}

const NOTICE_MS = 6000;
let area = null;

/** A short message that goes away by itself; errors stay until they are closed. */
export function notice(text, { bad = false } = {}) {
  area ??= document.getElementById("notices");
  const node = h(
    "div",
    { class: bad ? "notice bad" : "notice", role: bad ? "alert" : "status" },
    h("span", null, text),
    h(
      "button",
      { type: "button", class: "quiet", "aria-label": "Close the message", onclick: () => node.remove() },
      "✕",
    ),
  );
  // Never a pile: the same message again replaces itself.
  for (const old of [...area.children]) if (old.firstChild.textContent === text) old.remove();
  area.append(node);
  if (!bad) setTimeout(() => node.remove(), NOTICE_MS);
}

/** Says what went wrong with an action of the user. */
export function noticeError(what, error) {
  const help = error.help ? ` ${error.help}` : "";
  notice(`${what}: ${error.detail || error.title || error.message}${help}`, { bad: true });
}

// Disabled buttons tell their reason through this event, which keeps dom.js free of dialogs.
document.addEventListener("notice", (event) => notice(event.detail));

/** A button with a menu: entries are buttons; Escape, a choice or a click elsewhere close it. */
export function menu(label, entries, { title } = {}) {
  const list = h("div", { class: "menu-list" }, entries);
  const node = h("details", { class: "menu" }, h("summary", { title, "aria-label": title }, label), list);
  const close = (event) => {
    if (!node.isConnected) return document.removeEventListener("click", close);
    if (!node.querySelector("summary").contains(event.target)) node.open = false;
  };
  node.addEventListener("toggle", () => {
    if (node.open) document.addEventListener("click", close);
    else document.removeEventListener("click", close);
  });
  node.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && node.open) {
      node.open = false;
      node.querySelector("summary").focus();
      event.stopPropagation();
    }
  });
  return { node, fill: (...children) => set(list, ...children) };
}

/** Copies text and says so; without a secure context the clipboard is shut, so the text is selected. */
export async function copy(text, what = "Copied") {
  try {
    await navigator.clipboard.writeText(text);
    notice(what);
  } catch {
    const area = h("textarea", { class: "offscreen", value: text });
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    notice(done ? what : `Copying is not allowed here. The text: ${text}`);
  }
}
