// The manifest of a study: to read, to copy, to start another study from.

import { api } from "/api.js";
import { copy, noticeError } from "/parts/dialog.js";
import { h } from "/parts/dom.js";
import { guarded } from "/parts/states.js";
import { readOnly } from "/parts/toml.js";

export async function mount(panel, { path, ref, signal }) {
  guarded(panel, "Loading the manifest", async () => {
    const text = await api.text(`${path}/manifest`, { signal });
    return [
      h(
        "div",
        { class: "controls" },
        h("a", { class: "button", href: `/submit?from=${encodeURIComponent(ref)}` }, "Use for a new study"),
        h("button", { type: "button", onclick: () => copy(text, "The manifest is copied") }, "Copy"),
        h(
          "button",
          {
            type: "button",
            onclick: () =>
              api
                .download(`${path}/manifest`, `${ref.split("@")[0]}.toml`)
                .catch((e) => noticeError("The manifest could not be downloaded", e)),
          },
          "Download",
        ),
      ),
      readOnly(text),
    ];
  });
  return null;
}
