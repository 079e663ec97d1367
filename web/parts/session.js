// Who we are to the server: version, role, token. Asks for a token when one is needed,
// and tells buttons why they cannot be used.

import { api, onUnauthorized, setToken, token } from "/api.js";
import { h, set, uid } from "/parts/dom.js";

const AGAIN_MS = 5000;
const ROLES = ["read", "submit", "admin"];

let me = { version: "", commit: "", role: null, tokens: false };
const listeners = new Set();

// As of the last answer; see watchSession for changes.
export const session = () => me;

/** Calls `f` now and whenever the role changes. */
export function watchSession(f, signal) {
  listeners.add(f);
  signal?.addEventListener("abort", () => listeners.delete(f));
  f(me);
}

/** Asks the server who we are. Never fails: pages show what does not work. */
export async function refreshSession() {
  try {
    me = await api.json("/me");
  } catch (error) {
    me = { ...me, role: null, problem: error };
    // Not reached: asked again until it is, since every button depends on the answer.
    if (error.status === 0 || error.status >= 500) setTimeout(refreshSession, AGAIN_MS);
  }
  for (const f of listeners) f(me);
  return me;
}

/** Null when the role suffices, else the reason, as shown beside a disabled button. */
export function whyNot(role) {
  const has = ROLES.indexOf(me.role);
  if (has >= ROLES.indexOf(role)) return null;
  if (me.problem && me.problem.status !== 401) return "The server does not answer.";
  const ours = me.role ? `yours has the role “${me.role}”` : "you gave none";
  return `Needs a token with the role “${role}”; ${ours}.`;
}

/** The dialog that asks for a token; true when one was given. */
export function askToken(problem) {
  const input = h("input", {
    type: "password",
    id: uid("token"),
    autocomplete: "off",
    spellcheck: "false",
    required: true,
    "aria-describedby": "token-hint",
  });
  const wrong = token() ? problem?.detail || "The server does not accept the token of this tab." : "";
  const dialog = h(
    "dialog",
    { class: "dialog", "aria-labelledby": "token-title" },
    h(
      "form",
      { method: "dialog" },
      h("h2", { id: "token-title" }, "Token needed"),
      h("p", null, "This server asks for a token. Whoever runs it can give you one."),
      wrong && h("p", { class: "alarm", role: "alert" }, wrong),
      h("div", { class: "field wide" }, h("label", { for: input.id }, "Token"), input),
      h(
        "p",
        { class: "hint", id: "token-hint" },
        "Kept in this browser tab only, and forgotten when you close it.",
      ),
      h(
        "div",
        { class: "dialog-buttons" },
        h("button", { type: "button", onclick: () => dialog.close("") }, "Cancel"),
        h("button", { class: "primary", value: "use" }, "Use token"),
      ),
    ),
  );
  document.body.append(dialog);
  dialog.showModal();
  input.focus();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      const given = dialog.returnValue === "use" && input.value.trim();
      dialog.remove();
      if (given) setToken(given);
      resolve(Boolean(given));
      // The role may have changed: whoever shows buttons wants to know.
      if (given) setTimeout(refreshSession, 0);
    });
  });
}

/** The part of the header that shows the role and changes the token. */
export function sessionControl() {
  const node = h("div", { class: "session" });
  watchSession((who) => {
    if (!who.tokens && !token()) return set(node);
    const text = token() ? `Token: ${who.role || "not accepted"}` : `Role: ${who.role || "none"}`;
    set(
      node,
      h("span", { class: "muted" }, text),
      token()
        ? h("button", { type: "button", class: "quiet", onclick: forget }, "Forget token")
        : h("button", { type: "button", class: "quiet", onclick: () => askToken() }, "Enter token"),
    );
  });
  return node;
}

/** Back to whoever we are without a token. */
function forget() {
  setToken("");
  refreshSession();
}

onUnauthorized(askToken);
