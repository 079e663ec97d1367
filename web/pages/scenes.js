// Uploaded scenes and camera paths: put files in, see what was read, take the text that
// a manifest names them by.

import { api, isAbort, segment } from "/api.js";
import { ask, copy, notice, noticeError } from "/parts/dialog.js";
import { button, h, pageHead, set } from "/parts/dom.js";
import { bytes, count, instant, missing, number } from "/parts/format.js";
import { watchSession, whyNot } from "/parts/session.js";
import { empty, guarded, loading } from "/parts/states.js";

// What the server can read.
const ENDINGS = { glb: "scene", gltf: "scene", obj: "scene", csv: "path" };
// The server wants to be told; endings are unambiguous.
const kindOf = (name) => ENDINGS[name.split(".").pop().toLowerCase()] || null;

/** Where to drop above, what is kept below. */
export function mount(root, { signal, setTitle }) {
  setTitle("Scenes and paths");
  const input = h("input", {
    type: "file",
    multiple: true,
    accept: ".glb,.gltf,.obj,.csv",
    "aria-label": "Files to upload",
  });
  const drop = h("div", { class: "drop" });
  const queue = h("ul", { class: "queue", "aria-label": "Uploads", "aria-live": "polite" });
  const list = h("div", null, loading("Loading scenes and paths"));
  set(
    root,
    pageHead(
      "Scenes and paths",
      "Files that manifests can name. Each is read and checked before it is kept.",
    ),
    drop,
    queue,
    list,
    generated(),
  );
  input.addEventListener("change", () => {
    sendAll([...input.files]);
    input.value = "";
  });
  watchSession(() => {
    const why = whyNot("submit");
    set(
      drop,
      h(
        "p",
        null,
        h("b", null, "Drop files here"),
        " or ",
        button("Choose files…", () => input.click(), { class: "primary", why }),
      ),
      h(
        "p",
        { class: "hint" },
        "Scenes: GLB, glTF with its data inside, OBJ. Paths: CSV with ",
        h("code", null, "frame,px,py,pz,fx,fy,fz,ux,uy,uz"),
        ".",
      ),
      input,
    );
  }, signal);

  // The whole page takes drops: missing a small box would open the file instead.
  const inside = (event) => [...(event.dataTransfer?.types || [])].includes("Files");
  addEventListener(
    "dragover",
    (event) => inside(event) && (event.preventDefault(), drop.classList.add("over")),
    { signal },
  );
  addEventListener("dragleave", (event) => event.relatedTarget === null && drop.classList.remove("over"), {
    signal,
  });
  addEventListener(
    "drop",
    (event) => {
      if (!inside(event)) return;
      event.preventDefault();
      drop.classList.remove("over");
      if (whyNot("submit")) notice(whyNot("submit"));
      else sendAll([...event.dataTransfer.files]);
    },
    { signal },
  );

  /** Sends files and shows the list anew once all are through. */
  async function sendAll(files) {
    // One after the other: the server reads each file whole.
    for (const file of files) await send(file);
    load();
  }

  /** One file with its progress. What fails stays in the queue until it is closed: the reason matters. */
  async function send(file) {
    const bar = h("progress", { max: 1, value: 0, "aria-label": `Sending ${file.name}` });
    const text = h("span", { class: "muted" }, `${bytes(file.size)}, waiting`);
    const stop = new AbortController();
    const item = h(
      "li",
      null,
      h("b", null, file.name),
      " ",
      bar,
      " ",
      text,
      " ",
      h(
        "button",
        { type: "button", class: "quiet small", onclick: () => (stop.abort(), item.remove()) },
        "✕ Stop",
      ),
    );
    queue.append(item);
    const kind = kindOf(file.name);
    if (!kind)
      return failed(item, file, {
        title: "Not a kind of file that can be read",
        help: "Scenes are .glb, .gltf or .obj, paths are .csv.",
      });
    try {
      const upload = await api.upload(
        "/uploads",
        file,
        (sent, total) => {
          bar.value = sent / total;
          set(text, sent < total ? `${bytes(sent)} of ${bytes(total)}` : "sent; the server reads it");
        },
        { query: { kind, name: file.name }, signal: AbortSignal.any([signal, stop.signal]) },
      );
      item.remove();
      notice(
        `${upload.name} is kept: ${upload.kind === "path" ? count(upload.frames, "frame") : count(upload.triangles, "triangle")}`,
      );
    } catch (error) {
      if (!isAbort(error)) failed(item, file, error);
    }
  }

  /** The reason in place of the progress. */
  function failed(item, file, error) {
    set(
      item,
      h("b", { class: "alarm" }, `✕ ${file.name}: `),
      [error.title, error.detail].filter(Boolean).join(". "),
      error.help && h("span", { class: "muted" }, ` ${error.help}`),
      error.errors?.length > 0 &&
        h(
          "ul",
          null,
          error.errors.map((e) => h("li", null, e.message)),
        ),
      " ",
      h("button", { type: "button", class: "quiet small", onclick: () => item.remove() }, "Close"),
    );
  }

  // Scenes and paths apart: they have different numbers and different uses.
  const load = () =>
    guarded(list, "Loading scenes and paths", async () => {
      const { items } = await api.json("/uploads", { signal });
      if (items.length === 0)
        return empty("Nothing uploaded yet", h("p", null, "Scenes can also be generated; see below."));
      const of = (kind) => items.filter((u) => u.kind === kind);
      return ["scene", "path"].map((kind) => of(kind).length > 0 && table(kind, of(kind)));
    });

  /** Uploads of one kind. */
  function table(kind, items) {
    const numbers = kind === "scene" ? "triangles" : "frames";
    return h(
      "section",
      null,
      h("h2", null, kind === "scene" ? "Scenes" : "Paths"),
      h(
        "div",
        { class: "wide-scroll" },
        h(
          "table",
          { class: "studies uploads" },
          h("caption", { class: "offscreen" }, kind === "scene" ? "Scenes" : "Paths"),
          h(
            "thead",
            null,
            h(
              "tr",
              null,
              ["name", "in a manifest"].map((t) => h("th", { scope: "col" }, t)),
              h("th", { scope: "col", class: "n" }, numbers),
              h("th", { scope: "col", class: "n" }, "size"),
              h("th", { scope: "col" }, "uploaded"),
              h("th", { scope: "col" }, h("span", { class: "offscreen" }, "Actions")),
            ),
          ),
          h(
            "tbody",
            null,
            items.map((u) => row(u, numbers)),
          ),
        ),
      ),
    );
  }

  /** One upload; the text that a manifest names it by is what people come for. */
  function row(u, numbers) {
    const line = `file = ${JSON.stringify(u.reference)}`;
    const notes = Array.isArray(u.notes) ? u.notes : u.notes ? [u.notes] : [];
    return h(
      "tr",
      null,
      h(
        "th",
        { scope: "row" },
        h("b", null, u.name),
        notes.length > 0 &&
          h(
            "ul",
            { class: "notes" },
            notes.map((n) => h("li", null, typeof n === "string" ? n : n.message)),
          ),
      ),
      h(
        "td",
        { dataset: { label: "In a manifest" } },
        h(
          "span",
          { class: "reference" },
          h("code", null, line),
          " ",
          h(
            "button",
            {
              type: "button",
              class: "small",
              "aria-label": `Copy the reference to ${u.name}`,
              onclick: () => copy(line, `Copied: ${line}`),
            },
            "Copy",
          ),
        ),
      ),
      h(
        "td",
        { class: "n", dataset: { label: numbers } },
        typeof u[numbers] === "number" ? number(u[numbers]) : missing(),
      ),
      h("td", { class: "n", dataset: { label: "size" } }, bytes(u.bytes)),
      h("td", { class: "nowrap", dataset: { label: "uploaded" } }, instant(u.uploaded)),
      h(
        "td",
        { class: "study-actions" },
        h(
          "span",
          { class: "actions" },
          u.kind === "scene" &&
            h("a", { class: "button", href: `/scenes/${segment(u.id)}/view` }, "Fly and record a path"),
          button("Delete…", () => remove(u), { why: whyNot("admin"), "aria-label": `Delete ${u.name}` }),
        ),
      ),
    );
  }

  /** Deletes after a question that says what is lost. */
  async function remove(u) {
    const sure = await ask({
      title: `Delete ${u.name}?`,
      body: h(
        "p",
        null,
        "Studies that name it keep their results, but cannot be measured again without the file.",
      ),
      confirm: "Delete",
      danger: true,
    });
    if (!sure) return;
    try {
      await api.del(`/uploads/${segment(u.id)}`);
      notice(`${u.name} is deleted`);
    } catch (error) {
      noticeError(`${u.name} could not be deleted`, error);
    }
    load();
  }

  load();
}

// Who has no files needs none.
const generated = () =>
  h(
    "details",
    { class: "box" },
    h("summary", null, "Scenes and paths without a file"),
    h(
      "p",
      null,
      "Manifests can generate them: ",
      h("code", null, 'generate = "arena:map=nucleus"'),
      " (game-like maps), ",
      h("code", null, '"rooms:world=2"'),
      ", ",
      h("code", null, '"blocks"'),
      " and scenes that strain arithmetic; paths with ",
      h("code", null, 'generate = "walk:frames=600,seed=7"'),
      ", ",
      h("code", null, '"orbit"'),
      " or ",
      h("code", null, '"random"'),
      ".",
    ),
  );
