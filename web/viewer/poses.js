// Paths as data: poses between key poses, steady sampling of an uneven flight, and the
// CSV that cullmark reads, in the units and axes of the scene's file. No browser needed.

import { add, axesOf, cross, length, lerp, normalize, quaternionOf, slerp, sub } from "./math.js";

export const HEADER = "frame,px,py,pz,fx,fy,fz,ux,uy,uz";

const STEEP = 0.9995;

export const clonePose = (p) => ({ eye: [...p.eye], forward: [...p.forward], up: [...p.up] });

/** Up again without roll, where looking up or down leaves that a meaning. */
function level(forward, up) {
  if (Math.abs(forward[2]) > STEEP) return up;
  return normalize(cross(normalize(cross(forward, [0, 0, 1])), forward));
}

const isLevel = (p) => Math.abs(cross(p.forward, p.up)[2]) < 1e-6;

/** Directions turn the shorter way; between two level poses all are level. */
function turnBetween(a, b, t) {
  const q = slerp(quaternionOf(a.forward, a.up), quaternionOf(b.forward, b.up), t);
  const [forward, up] = axesOf(q);
  return { forward, up: isLevel(a) && isLevel(b) ? level(forward, up) : up };
}

export function between(a, b, t) {
  return { eye: lerp(a.eye, b.eye, t), ...turnBetween(a, b, t) };
}

function catmullRom(p0, p1, p2, p3, t) {
  return p1.map((_, k) => {
    const [a, b, c, d] = [p0[k], p1[k], p2[k], p3[k]];
    return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
  });
}

/** Eyes on a Catmull-Rom curve through all keys, `count` frames from each key to the next. */
export function interpolate(keys, count) {
  if (keys.length < 2) return keys.map(clonePose);
  const poses = [];
  // Beyond the ends the curve goes on straight.
  const beyond = (a, b) => add(a.eye, sub(a.eye, b.eye));
  for (let i = 0; i + 1 < keys.length; i++) {
    const [a, b] = [keys[i], keys[i + 1]];
    const before = i > 0 ? keys[i - 1].eye : beyond(a, b);
    const after = i + 2 < keys.length ? keys[i + 2].eye : beyond(b, a);
    for (let f = 0; f < count; f++) {
      const t = f / count;
      poses.push(f === 0 ? clonePose(a) : { eye: catmullRom(before, a.eye, b.eye, after, t), ...turnBetween(a, b, t) });
    }
  }
  poses.push(clonePose(keys[keys.length - 1]));
  return poses;
}

/** Samples a flight whose pictures come unevenly at even times. */
export class Sampler {
  constructor(hertz) {
    this.step = 1000 / hertz;
    this.poses = [];
    this.last = null;
  }

  take(now, pose) {
    if (!this.last) {
      this.due = now;
      this.last = { now, pose: clonePose(pose) };
    }
    while (this.due <= now) {
      const span = now - this.last.now;
      this.poses.push(span > 0 ? between(this.last.pose, pose, (this.due - this.last.now) / span) : clonePose(pose));
      this.due += this.step;
    }
    this.last = { now, pose: clonePose(pose) };
  }
}

/** How the scene's file became the scene: docs/MANIFEST.md, "Placement". */
export function placementOf(view) {
  const told = view.up !== undefined && view.up !== null;
  const offset = view.offset_m ?? [0, 0, 0];
  return {
    told,
    up: view.up === "y" ? "y" : "z",
    scale: view.scale ?? 1,
    offset: Array.isArray(offset) ? offset : [offset.x ?? 0, offset.y ?? 0, offset.z ?? 0],
    origin: view.origin ?? [0, 0, 0],
  };
}

/** From our axes (z up) to the file's; the way that cullmark reads it is (x, -z, y). */
const turnBack = (up, v) => (up === "y" ? [v[0], v[2], -v[1]] : v);

/** A pose relative to `origin`, in metres, as the file has it. */
export function toFile(pose, { up, scale, offset, origin }) {
  const eye = pose.eye.map((x, k) => (origin[k] + x - offset[k]) / scale);
  return { eye: turnBack(up, eye), forward: turnBack(up, pose.forward), up: turnBack(up, pose.up) };
}

/** The way back, as cullmark places what it reads. */
export function fromFile(pose, { up, scale, offset, origin }) {
  const turn = (v) => (up === "y" ? [v[0], -v[2], v[1]] : v);
  const eye = turn(pose.eye).map((x, k) => x * scale + offset[k] - origin[k]);
  return { eye, forward: turn(pose.forward), up: turn(pose.up) };
}

/** The text of a path file. Directions are made unit here: the reader insists on it. */
export function csv(poses, placement) {
  const rows = poses.map((pose, n) => {
    const p = toFile(pose, placement);
    // Adding 0 turns -0 into 0.
    return [n, ...p.eye, ...normalize(p.forward), ...normalize(p.up)].map((x) => x + 0).join(",");
  });
  return `${HEADER}\n${rows.join("\n")}\n`;
}

/** Metres from the first eye to the last, along the path. */
export function pathLength(poses) {
  let sum = 0;
  for (let i = 1; i < poses.length; i++) sum += length(sub(poses[i].eye, poses[i - 1].eye));
  return sum;
}
