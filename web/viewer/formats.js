// The binary forms of the API (docs/API.md, "Frames to look at"): CMSH, CMND and CMFR
// from an ArrayBuffer to typed arrays. Nothing is copied, and a buffer that is not what
// it says it is ends in an error that names what is wrong.

const VERSION = 1;
const MESH_HEADER = 16;
const NODES_HEADER = 16;
const FRAME_HEADER = 32;
const BYTES_A_NODE = 28;
const FLAG_TRUTH = 1;

export const NOT_SUBMITTED = 0;
export const UNSEEN = 1;
export const SEEN = 2;
export const LOST = 3;

export const NOT_REACHED = 0;
export const DRAWN = 1;
export const WENT_ON = 2;
export const HIDDEN = 3;
export const FIRST_CULLED = 16;

export const TWO_SIDED = 1 << 24;

// The forms are little-endian and read in place; no browser in use runs on anything else.
const LITTLE_ENDIAN = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;

function header(buffer, magic, bytes, what) {
  if (!LITTLE_ENDIAN) throw new Error("This browser is big-endian, which the viewer does not support");
  if (!(buffer instanceof ArrayBuffer)) throw new Error(`The ${what} did not arrive as binary data`);
  if (buffer.byteLength < bytes) {
    throw new Error(`The ${what} is cut short: ${buffer.byteLength} bytes, but its header alone has ${bytes}`);
  }
  const found = String.fromCharCode(...new Uint8Array(buffer, 0, 4));
  if (found !== magic) {
    throw new Error(`The ${what} begins with "${found.replace(/[^\x20-\x7e]/g, "?")}", not with "${magic}"`);
  }
  const words = new Uint32Array(buffer, 0, bytes / 4);
  if (words[1] !== VERSION) {
    throw new Error(`The ${what} has version ${words[1]}, but this viewer reads version ${VERSION}: reload the page`);
  }
  return words;
}

function length(buffer, expected, what) {
  if (buffer.byteLength !== expected) {
    throw new Error(`The ${what} has ${buffer.byteLength} bytes, but its header promises ${expected}`);
  }
}

/** CMSH: `{vertices, triangles, positions, indices, colours, twoSided}`; `twoSided` counts. */
export function parseMesh(buffer) {
  const words = header(buffer, "CMSH", MESH_HEADER, "mesh");
  const [vertices, triangles] = [words[2], words[3]];
  length(buffer, MESH_HEADER + 12 * vertices + 16 * triangles, "mesh");
  const positions = new Float32Array(buffer, MESH_HEADER, 3 * vertices);
  const indices = new Uint32Array(buffer, MESH_HEADER + 12 * vertices, 3 * triangles);
  const colours = new Uint32Array(buffer, MESH_HEADER + 12 * vertices + 12 * triangles, triangles);
  for (let i = 0; i < indices.length; i++) {
    if (indices[i] >= vertices) {
      throw new Error(`Triangle ${Math.floor(i / 3)} of the mesh names vertex ${indices[i]}, but there are ${vertices}`);
    }
  }
  let twoSided = 0;
  for (let i = 0; i < triangles; i++) if (colours[i] & TWO_SIDED) twoSided += 1;
  return { vertices, triangles, positions, indices, colours, twoSided };
}

/** CMND: boxes as 7 words a node (lo, hi as floats, depth as an integer), both views of one buffer. */
export function parseNodes(buffer) {
  const words = header(buffer, "CMND", NODES_HEADER, "list of nodes");
  const count = words[2];
  length(buffer, NODES_HEADER + BYTES_A_NODE * count, "list of nodes");
  const floats = new Float32Array(buffer, NODES_HEADER, 7 * count);
  const integers = new Uint32Array(buffer, NODES_HEADER, 7 * count);
  let deepest = 0;
  for (let i = 0; i < count; i++) deepest = Math.max(deepest, integers[7 * i + 6]);
  return { count, floats, integers, deepest };
}

/**
 * CMFR: `{truth, states, nodes, counts, decisions, header}`. `counts` are triangles by
 * state and `decisions` nodes by byte, counted here, so that legend and picture agree.
 */
export function parseFrame(buffer, triangles, nodes) {
  const words = header(buffer, "CMFR", FRAME_HEADER, "frame");
  if (words[2] !== triangles || words[3] !== nodes) {
    throw new Error(
      `The frame is of ${words[2]} triangles and ${words[3]} nodes, but the scene has ${triangles} and ${nodes}: reload the page`,
    );
  }
  const padded = Math.ceil(triangles / 4) * 4;
  length(buffer, FRAME_HEADER + padded + nodes, "frame");
  const states = new Uint8Array(buffer, FRAME_HEADER, triangles);
  const decided = new Uint8Array(buffer, FRAME_HEADER + padded, nodes);
  const counts = new Uint32Array(256);
  for (let i = 0; i < triangles; i++) counts[states[i]] += 1;
  const decisions = new Uint32Array(256);
  for (let i = 0; i < nodes; i++) decisions[decided[i]] += 1;
  const truth = (words[7] & FLAG_TRUTH) !== 0;
  return {
    truth,
    states,
    nodes: decided,
    counts: counts.slice(0, 4),
    decisions,
    header: { submitted: words[4], visible: words[5], lost: words[6] },
    bytes: buffer.byteLength,
  };
}
