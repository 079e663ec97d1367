// The two cameras that people steer: free flight and bird's eye (orbit or plan). Both
// keep a level horizon and hand out `pose` ({eye, forward, up}) and `lens`, which they
// change in place.

import { addScaled, clamp, copy, cross, fromYawPitch, toYawPitch } from "./math.js";

const STEEPEST = Math.PI / 2 - 0.001;
const TURN_A_SECOND = 1.4;
const FAST = 5;

const held = (keys, plus, minus) => (keys.has(plus) ? 1 : 0) - (keys.has(minus) ? 1 : 0);

/** Free flight: WASD and QE move, IJKL and dragging look. */
export class FlyCamera {
  constructor(lens, speed) {
    this.pose = { eye: [0, 0, 0], forward: [1, 0, 0], up: [0, 0, 1] };
    this.lens = lens;
    this.speed = speed;
    this.yaw = 0;
    this.pitch = 0;
  }

  /** Roll is left behind: flight is level. */
  setPose(pose) {
    copy(this.pose.eye, pose.eye);
    [this.yaw, this.pitch] = toYawPitch(pose.forward, pose.up);
    this.pitch = clamp(this.pitch, -STEEPEST, STEEPEST);
    this.turned();
  }

  turned() {
    fromYawPitch(this.pose.forward, this.pose.up, this.yaw, this.pitch);
  }

  look(dx, dy, heightPx) {
    const angle = this.lens.fovY / heightPx;
    this.turn(-dx * angle, -dy * angle);
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = clamp(this.pitch + pitch, -STEEPEST, STEEPEST);
    this.turned();
  }

  move(ahead, aside, up) {
    const { eye, forward } = this.pose;
    addScaled(eye, forward, ahead);
    eye[0] += Math.sin(this.yaw) * aside;
    eye[1] -= Math.cos(this.yaw) * aside;
    eye[2] += up;
  }

  /** Moves as long as keys are held; says whether anything changed. */
  step(keys, seconds) {
    const ahead = held(keys, "KeyW", "KeyS");
    const aside = held(keys, "KeyD", "KeyA");
    const up = held(keys, "KeyE", "KeyQ");
    const yaw = held(keys, "KeyJ", "KeyL");
    const pitch = held(keys, "KeyI", "KeyK");
    if (!(ahead || aside || up || yaw || pitch)) return false;
    const metres = this.speed * (keys.has("Shift") ? FAST : 1) * seconds;
    const turn = TURN_A_SECOND * Math.min(1, this.lens.fovY) * seconds;
    this.turn(yaw * turn, pitch * turn);
    this.move(ahead * metres, aside * metres, up * metres);
    return true;
  }
}

/** Bird's eye: around a target in perspective, or straight down without it. */
export class OrbitCamera {
  constructor(lo, hi) {
    this.pose = { eye: [0, 0, 0], forward: [0, 0, -1], up: [0, 1, 0] };
    this.lens = { fovY: (40 * Math.PI) / 180, height: null, near: 0.1, far: null };
    this.target = [0, 0, 0];
    this.plan = false;
    this.lo = lo;
    this.hi = hi;
    this.size = Math.max(Math.hypot(hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]), 1e-3);
    this.fit();
  }

  /** Everything in the picture, from the south-east and above. */
  fit(aspect = 1) {
    for (let k = 0; k < 3; k++) this.target[k] = (this.lo[k] + this.hi[k]) / 2;
    this.yaw = this.plan ? Math.PI / 2 : (3 * Math.PI) / 4;
    this.pitch = -0.75;
    const wide = Math.max(this.hi[0] - this.lo[0], 1e-3) / aspect;
    const tall = Math.max(this.hi[1] - this.lo[1], 1e-3);
    const slope = Math.tan(this.lens.fovY / 2);
    this.distance = (0.55 * Math.max(wide, tall)) / slope;
    this.turned();
    if (this.plan) return;
    this.distance = 1.03 * this.distanceToSee(slope * aspect, slope);
    this.turned();
  }

  /** So far away that every corner of the scene lies within both slopes of the picture. */
  distanceToSee(across, upwards) {
    const { forward, up } = this.pose;
    const right = cross(forward, up);
    let distance = this.size * 0.1;
    for (let corner = 0; corner < 8; corner++) {
      let [x, y, z] = [0, 0, 0];
      for (let k = 0; k < 3; k++) {
        const d = ((corner >> k) & 1 ? this.hi[k] : this.lo[k]) - this.target[k];
        x += d * right[k];
        y += d * up[k];
        z += d * forward[k];
      }
      distance = Math.max(distance, Math.abs(x) / across - z, Math.abs(y) / upwards - z);
    }
    return distance;
  }

  setPlan(plan) {
    this.plan = plan;
    this.turned();
  }

  /** Half of the height, in metres, that is seen at the target. */
  get reach() {
    return this.distance * Math.tan(this.lens.fovY / 2);
  }

  turned() {
    const { pose, lens, target } = this;
    fromYawPitch(pose.forward, pose.up, this.yaw, this.plan ? -Math.PI / 2 : this.pitch);
    copy(pose.eye, target);
    if (this.plan) {
      // High above everything, wherever the target went.
      const above = Math.max(this.hi[2] - target[2], 0) + this.size;
      pose.eye[2] += above;
      lens.height = 2 * this.reach;
      lens.near = 0;
      lens.far = above + 2 * this.size + Math.max(target[2] - this.lo[2], 0);
    } else {
      addScaled(pose.eye, pose.forward, -this.distance);
      lens.height = null;
      lens.near = Math.max(this.distance * 0.004, this.size * 1e-6);
      lens.far = null;
    }
  }

  orbit(dx, dy) {
    this.yaw -= dx * 0.006;
    this.pitch = clamp(this.pitch - dy * 0.006, -STEEPEST, 0.6);
    this.turned();
  }

  pan(dx, dy, heightPx) {
    const metres = (2 * this.reach) / heightPx;
    const { forward, up } = this.pose;
    addScaled(this.target, cross(forward, up), -dx * metres);
    addScaled(this.target, up, dy * metres);
    this.turned();
  }

  /** `x`, `y` from -1 to 1: the point that keeps its place; `aspect` of the pane. */
  zoom(factor, x = 0, y = 0, aspect = 1) {
    const before = this.reach;
    this.distance = clamp(this.distance * factor, this.size * 1e-5, this.size * 20);
    const shift = before - this.reach;
    const { forward, up } = this.pose;
    addScaled(this.target, cross(forward, up), x * aspect * shift);
    addScaled(this.target, up, y * shift);
    this.turned();
  }

  follow(eye) {
    copy(this.target, eye);
    this.turned();
  }

  step(keys, seconds) {
    const x = held(keys, "KeyD", "KeyA");
    const y = held(keys, "KeyW", "KeyS");
    const turn = held(keys, "KeyL", "KeyJ");
    const tilt = held(keys, "KeyI", "KeyK");
    const zoom = held(keys, "KeyQ", "KeyE");
    if (!(x || y || turn || tilt || zoom)) return false;
    const pace = seconds * (keys.has("Shift") ? FAST : 1);
    if (x || y) this.pan(-x * pace * 600, y * pace * 600, 1000);
    if (turn || tilt) this.orbit(turn * pace * 230, tilt * pace * 230);
    if (zoom) this.zoom(Math.exp(zoom * pace * 1.2));
    return true;
  }
}
