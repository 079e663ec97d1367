// The frame viewer's place: fetches its module and hands it a container. The module is
// heavy (WebGL) and of nobody else's concern, so it comes only here.

import { api, segment } from "/api.js";
import { h, set } from "/parts/dom.js";
import { readQuery } from "/parts/query.js";
import { fetchPart, loading, problem } from "/parts/states.js";

/** A line to find back, and the rest of the page for the viewer. */
export function mount(root, { params, signal, setTitle }) {
  const isRun = params.run !== undefined;
  const frame = Number.parseInt(readQuery().frame ?? "0", 10) || 0;
  setTitle(isRun ? `Frames of run ${params.run}` : "Scene", params.study);
  const name = h("code", null, params.upload);
  if (!isRun) callByName();
  const container = h("div", { class: "viewer-place" }, loading("Loading the viewer"));
  set(
    root,
    h(
      "div",
      { class: "head compact" },
      h(
        "div",
        null,
        h(
          "p",
          { class: "kicker" },
          isRun
            ? [
                h("a", { href: `/studies/${segment(params.study)}` }, h("code", null, params.study)),
                " › ",
                h(
                  "a",
                  { href: `/studies/${segment(params.study)}/runs/${segment(params.run)}` },
                  `run ${params.run}`,
                ),
                " › frames",
              ]
            : [h("a", { href: "/scenes" }, "Scenes and paths"), " › ", name],
        ),
        h("h1", { class: "small" }, isRun ? "Frame viewer" : "Fly through the scene and record a path"),
      ),
    ),
    container,
  );
  let viewer = null;
  start();

  /** The address has the upload's id; people know it by its name. */
  async function callByName() {
    const { items } = await api.json("/uploads", { signal }).catch(() => ({ items: [] }));
    const upload = items.find((u) => u.id === params.upload);
    if (!upload) return;
    set(name, upload.name);
    setTitle(upload.name);
  }

  /** Fetches the viewer; the page may have been left before it comes. */
  async function start() {
    try {
      const { mount: mountViewer } = await fetchPart(() => import("/viewer/viewer.js"));
      if (signal.aborted) return;
      set(container);
      const what = isRun
        ? { kind: "run", study: params.study, run: params.run, frame }
        : { kind: "scene", upload: params.upload };
      viewer = await mountViewer(container, { ...what, api });
      if (signal.aborted) viewer?.destroy?.();
    } catch (error) {
      if (signal.aborted) return;
      console.error(error);
      const shown =
        error.problem || error.reload
          ? error
          : {
              title: "The viewer could not be started",
              detail: String(error.message || error),
              help: "It needs WebGL 2, which may be switched off in this browser.",
            };
      set(container, problem(shown, start));
    }
  }

  return () => viewer?.destroy?.();
}
