// The structure's nodes as wireframe boxes with optional faces. Only nodes that are
// shown become instances: of 100,000 nodes a frame reaches some hundreds, and writing
// out the list costs less than drawing what is not wanted.

import { Growing, program } from "./gl.js";
import { decisionColour, rgb } from "./palette.js";
import { BOX } from "./shaders.js";

const WORDS = 7; // lo, hi, colour

function cube() {
  const corner = (i) => [i & 1, (i >> 1) & 1, (i >> 2) & 1];
  const edges = [];
  for (let i = 0; i < 8; i++) for (const bit of [1, 2, 4]) if (!(i & bit)) edges.push(corner(i), corner(i | bit));
  const faces = [];
  for (let axis = 0; axis < 3; axis++) {
    const [b, c] = [1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3)];
    for (const a of [0, 1 << axis]) for (const at of [0, b, b | c, 0, b | c, c]) faces.push(corner(a | at));
  }
  return { edges: new Float32Array(edges.flat()), faces: new Float32Array(faces.flat()) };
}

export class Boxes {
  constructor() {
    this.nodes = null;
    this.count = 0;
    this.floats = new Float32Array(0);
    this.words = new Uint32Array(0);
    // Little-endian RGBA for every value a node's byte can have.
    this.packed = new Uint32Array(256);
    for (let byte = 0; byte < 256; byte++) {
      const [r, g, b] = rgb(decisionColour(byte)).map((x) => Math.round(x * 255));
      this.packed[byte] = (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;
    }
  }

  build(gl) {
    this.gl = gl;
    this.program = program(gl, BOX);
    this.instances = new Growing(gl);
    const shape = cube();
    this.edges = this.array(shape.edges);
    this.faces = this.array(shape.faces);
    if (this.count > 0) this.instances.fill(this.words, WORDS * this.count);
  }

  array(corners) {
    const { gl } = this;
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.instances.buffer);
    const put = (at, size, type, normalized, offset) => {
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, type, normalized, 4 * WORDS, offset);
      gl.vertexAttribDivisor(at, 1);
    };
    put(1, 3, gl.FLOAT, false, 0);
    put(2, 3, gl.FLOAT, false, 12);
    put(3, 4, gl.UNSIGNED_BYTE, true, 24);
    return { vao, vertices: corners.length / 3 };
  }

  setNodes(nodes) {
    this.nodes = nodes;
    this.words = new Uint32Array(WORDS * nodes.count);
    this.floats = new Float32Array(this.words.buffer);
  }

  /** Chooses the nodes to draw: `shown[byte]` and depths from `least` to `most`. */
  choose(decided, shown, least, most) {
    const { nodes, floats, words, packed } = this;
    this.count = 0;
    if (!nodes || !decided) return;
    let o = 0;
    for (let i = 0; i < nodes.count; i++) {
      const byte = decided[i];
      if (!shown[byte]) continue;
      const depth = nodes.integers[7 * i + 6];
      if (depth < least || depth > most) continue;
      for (let k = 0; k < 6; k++) floats[o + k] = nodes.floats[7 * i + k];
      words[o + 6] = packed[byte];
      o += WORDS;
    }
    this.count = o / WORDS;
    this.instances.fill(words, o);
  }

  draw(pane, look) {
    const { gl, count } = this;
    if (count === 0) return;
    const { handle, at } = this.program;
    gl.useProgram(handle);
    gl.uniformMatrix4fv(at.uViewProjection, false, pane.matrix);
    gl.uniform3f(at.uEye, pane.pose.eye[0], pane.pose.eye[1], pane.pose.eye[2]);
    if (look.faces) {
      gl.uniform1f(at.uAlpha, 0.1);
      gl.bindVertexArray(this.faces.vao);
      gl.drawArraysInstanced(gl.TRIANGLES, 0, this.faces.vertices, count);
    }
    gl.bindVertexArray(this.edges.vao);
    // Edges lie on the walls that they bound: seen through them faintly, they still read.
    if (look.through) {
      gl.disable(gl.DEPTH_TEST);
      gl.uniform1f(at.uAlpha, 0.3);
      gl.drawArraysInstanced(gl.LINES, 0, this.edges.vertices, count);
      gl.enable(gl.DEPTH_TEST);
    }
    gl.uniform1f(at.uAlpha, 1);
    gl.drawArraysInstanced(gl.LINES, 0, this.edges.vertices, count);
  }
}
