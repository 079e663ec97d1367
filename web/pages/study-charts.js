// The charts of the report, drawn by the server, each fetched when it comes into view.

import { api } from "/api.js";
import { noticeError } from "/parts/dialog.js";
import { h, set } from "/parts/dom.js";
import { empty, guarded, loading } from "/parts/states.js";

/** A list first; each chart is drawn by the server when somebody scrolls to it. */
export async function mount(panel, study) {
  const { signal } = study;
  const addresses = new Set();
  const watcher = new IntersectionObserver(
    (entries) => {
      for (const e of entries) {
        if (!e.isIntersecting) continue;
        watcher.unobserve(e.target);
        e.target.fetchChart();
      }
    },
    { rootMargin: "300px" },
  );
  // Blobs live until they are let go.
  const free = () => {
    for (const address of addresses) URL.revokeObjectURL(address);
    addresses.clear();
  };
  signal.addEventListener("abort", () => {
    watcher.disconnect();
    free();
  });

  /** A chart with its caption and its files. */
  function chart(item) {
    const place = h("div", { class: "paper" }, loading("Drawing"));
    const file = (format) => `${study.path}/charts/${encodeURIComponent(item.id)}.${format}`;
    place.fetchChart = async () => {
      try {
        // A blob and no plain address, because an <img> sends no token.
        const blob = await api.blob(file("svg"), { query: { where: study.where }, signal });
        study.filterError(null);
        const address = URL.createObjectURL(blob.type ? blob : new Blob([blob], { type: "image/svg+xml" }));
        addresses.add(address);
        set(place, h("img", { src: address, alt: `${item.title}. ${item.description || ""}` }));
      } catch (error) {
        study.failed(place, error, () => (set(place, loading("Drawing")), place.fetchChart()));
      }
    };
    watcher.observe(place);
    // Every value is in the description, for those who cannot see the chart; it begins with the title.
    const words = (item.description || "").replace(item.title, "").replace(/^[.\s]+/, "");
    const save = (format) =>
      h(
        "button",
        {
          type: "button",
          class: "quiet small",
          "aria-label": `Download ${item.title} as ${format.toUpperCase()}`,
          onclick: () =>
            api
              .download(file(format), `${study.ref}-${item.id}.${format}`, { query: { where: study.where } })
              .catch((e) => noticeError("The chart could not be downloaded", e)),
        },
        format.toUpperCase(),
      );
    return h(
      "figure",
      { class: "card chart" },
      place,
      h(
        "figcaption",
        null,
        h("span", { class: "between inline" }, h("b", null, item.title), h("span", null, save("svg"), save("png"))),
        words && h("details", { class: "in-words" }, h("summary", null, "In words"), h("p", null, words)),
      ),
    );
  }

  const load = () =>
    guarded(panel, "Loading the charts", async () => {
      free();
      const { items } = await api.json(`${study.path}/charts`, { query: { where: study.where }, signal });
      return items.length
        ? h("div", { class: "charts" }, items.map(chart))
        : empty("No charts yet", h("p", null, "They are drawn once runs are finished."));
    });
  load();
  // Not live: a chart that changes while one reads it helps nobody.
  return { refilter: load };
}
