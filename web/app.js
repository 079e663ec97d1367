// Starts the page: router, header, keyboard. A page is a module with
// `mount(root, {params, signal, navigate})`; it may return a function that ends it.

import { api } from "/api.js";
import { notice } from "/parts/dialog.js";
import { h, set } from "/parts/dom.js";
import { showHelp, startKeys } from "/parts/keys.js";
import { sessionControl, refreshSession, watchSession } from "/parts/session.js";
import { empty, fetchPart, loading, problem } from "/parts/states.js";
import { startTheme, themeControl } from "/parts/theme.js";

// Pages are fetched when they are first visited.
const ROUTES = [
  { path: /^\/$/, nav: "studies", load: () => import("/pages/studies.js") },
  { path: /^\/studies\/?$/, nav: "studies", load: () => import("/pages/studies.js") },
  { path: /^\/submit\/?$/, nav: "submit", load: () => import("/pages/submit.js") },
  { path: /^\/compare\/?$/, nav: "compare", load: () => import("/pages/compare.js") },
  { path: /^\/scenes\/?$/, nav: "scenes", load: () => import("/pages/scenes.js") },
  { path: /^\/scenes\/(?<upload>[^/]+)\/view\/?$/, nav: "scenes", load: () => import("/pages/view.js") },
  { path: /^\/machine\/?$/, nav: "machine", load: () => import("/pages/machine.js") },
  { path: /^\/studies\/(?<study>[^/]+)\/?$/, nav: "studies", load: () => import("/pages/study.js") },
  {
    path: /^\/studies\/(?<study>[^/]+)\/runs\/(?<run>[^/]+)\/?$/,
    nav: "studies",
    load: () => import("/pages/run.js"),
  },
  {
    path: /^\/studies\/(?<study>[^/]+)\/runs\/(?<run>[^/]+)\/view\/?$/,
    nav: "studies",
    load: () => import("/pages/view.js"),
  },
];

const main = document.getElementById("main");
let leave = null;
let shown = null;

/** Moves to an address of this page, as a link would. */
export function navigate(address, { replace = false } = {}) {
  if (replace) history.replaceState(null, "", address);
  else history.pushState(null, "", address);
  route();
}

/** The title of the tab, the page's own name first. */
export function setTitle(...parts) {
  document.title = [...parts, "cullmark"].filter(Boolean).join(" · ");
}

/**
 * Ends the page that is shown and mounts the one of the address. A page left while its
 * module was still on its way must not appear over its successor, hence the signal.
 */
async function route({ first = false } = {}) {
  const found = ROUTES.map((r) => ({ ...r, match: r.path.exec(location.pathname) })).find((r) => r.match);
  const key = location.pathname + location.search;
  shown = key;
  leave?.();
  leave = null;
  markNav(found?.nav);
  const root = h("div", { class: "page" }, loading());
  set(main, root);
  if (!found) {
    setTitle("Not found");
    return set(
      root,
      h("h1", null, "There is no such page"),
      empty("Nothing lives at this address.", h("p", null, h("a", { href: "/" }, "To the studies"))),
    );
  }
  const ending = new AbortController();
  let ended = null;
  leave = () => {
    ending.abort();
    ended?.();
  };
  try {
    const params = Object.fromEntries(
      Object.entries(found.match.groups || {}).map(([k, v]) => [k, decodeURIComponent(v)]),
    );
    const page = await fetchPart(found.load);
    if (ending.signal.aborted) return;
    set(root);
    ended = (await page.mount(root, { params, signal: ending.signal, navigate, setTitle })) || null;
    // The page may have been left while it was being built.
    if (ending.signal.aborted) return ended?.();
  } catch (error) {
    if (ending.signal.aborted) return;
    console.error(error);
    set(
      root,
      problem(error, () => route(), { heading: "h1" }),
    );
  }
  // After a move the focus starts at the new content, whose title the tab tells; on
  // loading, where the browser puts it.
  if (!first && shown === key && !root.contains(document.activeElement)) {
    main.focus({ preventScroll: true });
    scrollTo(0, 0);
  }
}

/** Marks the entry of the menu that the page belongs to. */
function markNav(name) {
  for (const link of document.querySelectorAll("[data-nav]")) {
    if (link.dataset.nav === name) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

/** Links inside the page move without loading it anew. */
function followLinks(event) {
  if (
    event.defaultPrevented ||
    event.button !== 0 ||
    event.metaKey ||
    event.ctrlKey ||
    event.shiftKey ||
    event.altKey
  )
    return;
  const link = event.target.closest?.("a[href]");
  if (!link || link.target || link.hasAttribute("download")) return;
  const to = new URL(link.href, location.href);
  if (to.origin !== location.origin || to.pathname.startsWith("/api/") || to.pathname === "/metrics") return;
  if (to.hash && to.pathname === location.pathname && to.search === location.search) {
    // Left to the browser, a step inside the page would count as a move and mount it anew.
    event.preventDefault();
    document.getElementById(to.hash.slice(1))?.focus();
    return;
  }
  event.preventDefault();
  navigate(to.pathname + to.search + to.hash);
}

/** Version and links below every page; known only once the server has answered. */
function startFoot() {
  const foot = document.getElementById("foot");
  watchSession((me) => {
    const version = me.version && `cullmark ${me.version}${me.commit ? ` (${me.commit.slice(0, 9)})` : ""}`;
    set(
      foot,
      h(
        "p",
        null,
        version,
        version && " · ",
        h("a", { href: "/api/v1/openapi.json", target: "_blank" }, "HTTP API"),
        " · ",
        h("a", { href: "/metrics", target: "_blank" }, "server metrics"),
      ),
    );
  });
}

startTheme();
themeControl(document.getElementById("theme"));
document.getElementById("help").addEventListener("click", showHelp);
document.getElementById("top-tools").prepend(sessionControl());
document.addEventListener("click", followLinks);
addEventListener("popstate", () => route());
addEventListener("offline", () =>
  notice("This browser is offline; what you see may be out of date.", { bad: true }),
);
startKeys(navigate);
startFoot();
// Buttons depend on the role, so it is known before the first page is drawn.
await refreshSession();
route({ first: true });

// For people at the console, and for nothing else.
window.cullmark = { api };
