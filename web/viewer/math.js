// Vectors, quaternions and camera matrices: right-handed, z up, f64 until a matrix is
// handed to the GPU. Vectors are plain arrays of three; functions that run every frame
// write into an `out`, so that the drawing loop allocates nothing.

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const lerp = (a, b, t) => [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t];
export const clamp = (x, lo, hi) => Math.min(Math.max(x, lo), hi);

export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export function normalize(a) {
  const l = length(a);
  return l > 0 ? [a[0] / l, a[1] / l, a[2] / l] : [0, 0, 0];
}

/** Adds `s` times `b` to `a` in place. */
export function addScaled(a, b, s) {
  a[0] += b[0] * s;
  a[1] += b[1] * s;
  a[2] += b[2] * s;
}

export function copy(out, a) {
  out[0] = a[0];
  out[1] = a[1];
  out[2] = a[2];
}

/** Forward and up of a level camera. Closed forms: there is no gap at straight down. */
export function fromYawPitch(forward, up, yaw, pitch) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  forward[0] = cp * cy;
  forward[1] = cp * sy;
  forward[2] = sp;
  up[0] = -sp * cy;
  up[1] = -sp * sy;
  up[2] = cp;
}

export function toYawPitch(forward, up) {
  const pitch = Math.asin(clamp(forward[2] / (length(forward) || 1), -1, 1));
  // Looking straight down, only `up` says where north is.
  const level = Math.hypot(forward[0], forward[1]) > 1e-6 ? forward : scale(up, pitch < 0 ? 1 : -1);
  return [Math.atan2(level[1], level[0]), pitch];
}

const right = [0, 0, 0];
const above = [0, 0, 0];
const ahead = [0, 0, 0];

/**
 * Projection times rotation of a camera whose eye is at 0, column-major. The eye stays
 * out of it: shaders subtract it first, which keeps digits far from the origin.
 * `lens`: `{fovY}` in radians or `{height}` in metres, `near`, `far` (null: infinite).
 */
export function viewProjection(out, pose, lens, aspect) {
  const f = pose.forward;
  const fl = length(f) || 1;
  ahead[0] = f[0] / fl;
  ahead[1] = f[1] / fl;
  ahead[2] = f[2] / fl;
  const u = pose.up;
  right[0] = ahead[1] * u[2] - ahead[2] * u[1];
  right[1] = ahead[2] * u[0] - ahead[0] * u[2];
  right[2] = ahead[0] * u[1] - ahead[1] * u[0];
  const rl = length(right) || 1;
  right[0] /= rl;
  right[1] /= rl;
  right[2] /= rl;
  above[0] = right[1] * ahead[2] - right[2] * ahead[1];
  above[1] = right[2] * ahead[0] - right[0] * ahead[2];
  above[2] = right[0] * ahead[1] - right[1] * ahead[0];
  const perspective = lens.height == null;
  const y = perspective ? 1 / Math.tan(lens.fovY / 2) : 2 / lens.height;
  const x = y / aspect;
  const { near, far } = lens;
  let z = 1;
  let shift = -2 * near;
  if (!perspective) {
    z = 2 / (far - near);
    shift = -(far + near) / (far - near);
  } else if (far != null) {
    z = (far + near) / (far - near);
    shift = (-2 * far * near) / (far - near);
  }
  for (let k = 0; k < 3; k++) {
    out[4 * k] = right[k] * x;
    out[4 * k + 1] = above[k] * y;
    out[4 * k + 2] = ahead[k] * z;
    out[4 * k + 3] = perspective ? ahead[k] : 0;
  }
  out[12] = 0;
  out[13] = 0;
  out[14] = shift;
  out[15] = perspective ? 0 : 1;
  return out;
}

/** Quaternion (x, y, z, w) that turns x onto `forward` and z onto `up`. */
export function quaternionOf(forward, up) {
  const f = normalize(forward);
  const left = normalize(cross(up, f));
  const u = cross(f, left);
  // Columns of the rotation are f, left, u; Shepperd's choice of the largest divisor.
  const [m00, m10, m20] = f;
  const [m01, m11, m21] = left;
  const [m02, m12, m22] = u;
  const trace = m00 + m11 + m22;
  if (trace > 0) {
    const s = 2 * Math.sqrt(trace + 1);
    return [(m21 - m12) / s, (m02 - m20) / s, (m10 - m01) / s, s / 4];
  }
  if (m00 > m11 && m00 > m22) {
    const s = 2 * Math.sqrt(1 + m00 - m11 - m22);
    return [s / 4, (m01 + m10) / s, (m02 + m20) / s, (m21 - m12) / s];
  }
  if (m11 > m22) {
    const s = 2 * Math.sqrt(1 + m11 - m00 - m22);
    return [(m01 + m10) / s, s / 4, (m12 + m21) / s, (m02 - m20) / s];
  }
  const s = 2 * Math.sqrt(1 + m22 - m00 - m11);
  return [(m02 + m20) / s, (m12 + m21) / s, s / 4, (m10 - m01) / s];
}

/** The way back: `[forward, up]`, both unit. */
export function axesOf([x, y, z, w]) {
  const forward = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)];
  const up = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
  return [normalize(forward), normalize(up)];
}

export function slerp(a, b, t) {
  let cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  // q and -q are the same rotation: take the shorter way round.
  const sign = cosine < 0 ? -1 : 1;
  cosine *= sign;
  let [s, e] = [1 - t, t * sign];
  if (cosine < 0.9995) {
    const angle = Math.acos(cosine);
    s = Math.sin((1 - t) * angle) / Math.sin(angle);
    e = (Math.sin(t * angle) / Math.sin(angle)) * sign;
  }
  const q = [0, 1, 2, 3].map((k) => a[k] * s + b[k] * e);
  const l = Math.hypot(...q);
  return q.map((c) => c / l);
}
