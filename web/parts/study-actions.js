// What can be done with a study: pause, resume, cancel, retry, re-run, priority, delete.
// Used by the list and by the study's own page.

import { api, segment } from "/api.js";
import { ask, menu, notice, noticeError } from "/parts/dialog.js";
import { button, h, set } from "/parts/dom.js";
import { count } from "/parts/format.js";
import { whyNot } from "/parts/session.js";

/** `onChange(ref, summary | null)` after every action; null when the study is gone. */
export function studyActions(first, { onChange, navigate, compact = false }) {
  const ref = first.ref;
  const path = `/studies/${segment(ref)}`;
  const node = h("div", { class: "actions" });
  const more = menu(compact ? "⋯" : "More", [], { title: `More actions for ${ref}` });
  let summary = first;
  let drawn = "";

  /** An action that needs no question. */
  async function act(what, words) {
    try {
      const answer = await api.post(`${path}/${what}`);
      notice(words);
      onChange(ref, answer);
      return answer;
    } catch (error) {
      noticeError(`${ref} could not be changed`, error);
      return null;
    }
  }

  /** Cancelling throws away work under way. */
  async function cancel() {
    const sure = await ask({
      title: `Cancel ${ref}?`,
      body: h(
        "p",
        null,
        "What is running is stopped, and nothing more is measured. Results so far stay. “Resume” takes it up again.",
      ),
      confirm: "Cancel the study",
      danger: true,
    });
    if (sure) act("cancel", `${ref} is cancelled`);
  }

  /** Measuring anew may take as long as it did. */
  async function rerun() {
    const sure = await ask({
      title: `Measure ${ref} anew?`,
      body: h(
        "p",
        null,
        `All ${count(summary.runs.total, "run")} are measured again as the next series; the results of this one stay. Comparing the two shows how repeatable they are.`,
      ),
      confirm: "Measure anew",
    });
    const answer = sure && (await act("rerun", "Queued as the next series"));
    if (answer?.ref) navigate(`/studies/${segment(answer.ref)}`);
  }

  /** The limits are the server’s. */
  async function prioritise() {
    const input = h("input", {
      type: "number",
      name: "priority",
      min: -100,
      max: 100,
      step: 1,
      value: summary.priority,
      required: true,
    });
    const values = await ask({
      title: `Priority of ${ref}`,
      body: [
        h("p", null, "From −100 to 100. Studies with a higher number are measured first."),
        h("label", null, "Priority ", input),
      ],
      confirm: "Set",
    });
    if (!values) return;
    try {
      onChange(ref, await api.patch(path, { priority: Number(values.priority) }));
      notice(`Priority of ${ref} is ${values.priority}`);
    } catch (error) {
      noticeError("The priority could not be changed", error);
    }
  }

  /** The only action that cannot be taken back. */
  async function remove() {
    const values = await ask({
      title: `Delete ${ref}?`,
      body: [
        h(
          "p",
          null,
          `The study with its ${count(summary.runs.total, "run")} is taken out of the database. This cannot be undone.`,
        ),
        h(
          "label",
          { class: "check" },
          h("input", { type: "checkbox", name: "measurements" }),
          "Also delete measurements that no other study has",
        ),
        h("p", { class: "hint" }, "Measurements that stay are used again when an equal run is submitted."),
      ],
      confirm: "Delete",
      danger: true,
    });
    if (!values) return;
    try {
      await api.del(path, { query: { measurements: values.measurements ? "true" : "false" } });
      notice(`${ref} is deleted`);
      onChange(ref, null);
    } catch (error) {
      noticeError(`${ref} could not be deleted`, error);
    }
  }

  /** Draws the buttons that make sense in this state, each with the reason if it cannot be used. */
  function update(s) {
    summary = s;
    // Redrawing would take the focus from under the user's hands.
    const now = `${s.state} ${s.finished} ${s.runs.failed > 0} ${whyNot("submit")} ${whyNot("admin")}`;
    if (now === drawn) return;
    drawn = now;
    const why = whyNot("submit");
    const over = s.finished ? "Nothing is left to do in this study." : null;
    const main = [];
    if (s.state === "active" && !s.finished)
      main.push(button("Pause", () => act("pause", `${ref} is paused`), { why }));
    else if (s.state !== "active") main.push(button("Resume", () => act("resume", `${ref} goes on`), { why }));
    set(node, main, more.node);
    more.fill(
      button("Retry failed runs", () => act("retry", "Failed runs are queued again"), {
        why: why || (s.runs.failed ? null : "No run has failed."),
      }),
      button("Measure anew…", rerun, { why }),
      button("Change priority…", prioritise, { why }),
      button("Cancel…", cancel, {
        why: why || over || (s.state === "cancelled" ? "It is cancelled already." : null),
        class: "bad",
      }),
      button("Delete…", remove, { why: whyNot("admin"), class: "bad" }),
    );
  }

  update(first);
  return { node, update };
}
