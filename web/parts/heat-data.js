// The numbers behind a heat map: which cell holds which run, what is coloured and how.
// No drawing here, so that a hundred thousand cells are gone through once, not per frame.

import { STATUSES } from "/parts/status.js";
import { extent, share } from "/parts/scales.js";

const NO_COLOUR = 255;

/**
 * Indexes the parallel lists of a matrix. `turned` swaps the axes: what is across and
 * what is down; `relative` divides each value by the least of its scene or, where `more` is
 * better, the greatest by the value: 1 is the best there either way.
 */
export function heatData(matrix, { turned, relative, more = false }) {
  const { rows, columns, cells } = matrix;
  const [across, down] = turned ? [rows, columns] : [columns, rows];
  const at = new Int32Array(across.length * down.length).fill(-1);
  const size = cells.ordinal.length;
  const best = relative ? bestOfRows(cells, rows.length, more) : null;
  const values = new Array(size);
  for (let k = 0; k < size; k += 1) {
    const [row, column] = [cells.row[k], cells.column[k]];
    at[turned ? column * across.length + row : row * across.length + column] = k;
    const v = cells.value[k];
    values[k] = v === null || v === undefined ? null : best ? (more ? best[row] / v : v / best[row]) : v;
    if (!Number.isFinite(values[k])) values[k] = null;
  }
  return {
    matrix,
    turned,
    relative,
    across,
    down,
    values,
    cellAt: (x, y) =>
      x < 0 || y < 0 || x >= across.length || y >= down.length ? -1 : at[y * across.length + x],
    describe: (k) => ({
      scene: rows[cells.row[k]],
      label: columns[cells.column[k]],
      ordinal: cells.ordinal[k],
      status: STATUSES[cells.status[k]],
      value: cells.value[k] ?? null,
      shown: values[k],
    }),
    statusOf: (k) => STATUSES[cells.status[k]],
    counts: countStatuses(cells.status),
  };
}

function bestOfRows(cells, rows, more) {
  const best = new Float64Array(rows).fill(more ? 0 : Infinity);
  for (let k = 0; k < cells.value.length; k += 1) {
    const v = cells.value[k];
    if (v > 0 && (more ? v > best[cells.row[k]] : v < best[cells.row[k]])) best[cells.row[k]] = v;
  }
  return best;
}

function countStatuses(list) {
  const counts = { pending: 0, done: 0, failed: 0, wrong: 0 };
  for (const s of list) counts[STATUSES[s]] += 1;
  return counts;
}

/** Domain of the colours, and the step of the ramp for every cell; 255 is none. */
export function colourSteps(values, log) {
  const domain = extent(values, log);
  const steps = new Uint8Array(values.length).fill(NO_COLOUR);
  if (domain) {
    for (let k = 0; k < values.length; k += 1) {
      const v = values[k];
      // A logarithm has no place for zero: it takes the colour of the least.
      if (v !== null) steps[k] = Math.min(NO_COLOUR - 1, Math.round(share(v, domain, log) * (NO_COLOUR - 1)));
    }
  }
  return { domain, steps, has: (k) => steps[k] !== NO_COLOUR };
}
