// What the bird's eye shows beside the scene: the path as a line and cameras as
// wireframes. Segments are six floats, two points each, as Renderer.setLines takes them.

import { cross, normalize } from "./math.js";

/** The line through the eyes of `poses`, `[[ex, ey, ez, ...]]`. */
export function pathSegments(poses) {
  const count = Math.max(poses.length - 1, 0);
  const data = new Float32Array(6 * count);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) {
      data[6 * i + k] = poses[i][k];
      data[6 * i + 3 + k] = poses[i + 1][k];
    }
  }
  return { data, count };
}

const RING = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
const FRUSTUM_SEGMENTS = 14;
export const frustumData = () => new Float32Array(6 * FRUSTUM_SEGMENTS);

/**
 * The view volume of `pose` cut at `reach` metres, with a small roof on its upper edge
 * that tells up from down. Writes into `data`, answers the number of segments.
 */
export function frustumSegments(data, pose, lens, aspect, reach) {
  const forward = normalize(pose.forward);
  const right = normalize(cross(forward, pose.up));
  const up = cross(right, forward);
  const far = Math.min(lens.far ?? Infinity, reach);
  const near = Math.min(lens.near, far);
  const half = lens.height == null ? Math.tan(lens.fovY / 2) : lens.height / 2;
  let o = 0;
  const point = (depth, x, y) => {
    const size = lens.height == null ? half * depth : half;
    for (let k = 0; k < 3; k++) {
      data[o++] = pose.eye[k] + forward[k] * depth + right[k] * x * size * aspect + up[k] * y * size;
    }
  };
  for (let i = 0; i < 4; i++) {
    const [x, y] = RING[i];
    const [nextX, nextY] = RING[(i + 1) % 4];
    point(near, x, y);
    point(far, x, y);
    point(near, x, y);
    point(near, nextX, nextY);
    point(far, x, y);
    point(far, nextX, nextY);
  }
  for (const x of [-0.25, 0.25]) {
    point(far, x, 1);
    point(far, 0, 1.3);
  }
  return FRUSTUM_SEGMENTS;
}
