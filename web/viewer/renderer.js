// Draws the scene into panes of one canvas with WebGL2: triangles by state, lost ones
// through walls, boxes of nodes, lines and marks. It knows no frames and no controls;
// what it is given it keeps, to build everything anew after the context was lost.

import { Boxes } from "./boxes.js";
import { LOST } from "./formats.js";
import { Growing, PerTriangle, program } from "./gl.js";
import { LINE, MESH, PLAIN } from "./shaders.js";

// Positions of so many triangles go into one buffer: 72 MB, which every driver takes.
const TRIANGLES_A_BUFFER = 2_000_000;
// More rings than this would only hide the picture; the triangles themselves all show.
const MOST_RINGS = 4000;
// Each is drawn three times more; beyond this the pass would stall the page.
const MOST_LOST = 200_000;
const ONE = new Float32Array(3);

export class Renderer {
  constructor(gl) {
    this.gl = gl;
    this.mesh = null;
    this.frame = null;
    // Kept on this side too: a new context starts empty.
    this.lineData = new Map();
    this.lost = { triangles: new Float32Array(0), edges: new Float32Array(0), centres: new Float32Array(0), count: 0 };
    this.boxes = new Boxes();
    this.build();
  }

  /** Everything that lives on the GPU; once more after a lost context. */
  build() {
    const { gl } = this;
    this.meshProgram = program(gl, MESH);
    this.plainProgram = program(gl, PLAIN);
    this.lineProgram = program(gl, LINE);
    this.lines = new Map();
    this.lostBuffers = { triangles: this.plainArray(), edges: this.plainArray(), centres: this.plainArray() };
    this.mark = this.plainArray();
    this.boxes.build(gl);
    if (this.mesh) this.setMesh(this.mesh);
    if (this.frame) this.setFrame(this.frame);
    for (const [name, { data, count }] of this.lineData) this.setLines(name, data, count);
  }

  plainArray() {
    const { gl } = this;
    const growing = new Growing(gl);
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, growing.buffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    return { growing, vao };
  }

  /** Corners are written out triangle by triangle: the vertex number then names the triangle. */
  setMesh(mesh) {
    const { gl } = this;
    const { positions, indices, triangles } = mesh;
    this.mesh = mesh;
    this.chunks = [];
    const corners = new Float32Array(9 * Math.min(triangles, TRIANGLES_A_BUFFER));
    for (let base = 0; base < triangles; base += TRIANGLES_A_BUFFER) {
      const count = Math.min(TRIANGLES_A_BUFFER, triangles - base);
      for (let i = 0, o = 0; i < 3 * count; i++) {
        const v = 3 * indices[3 * base + i];
        corners[o++] = positions[v];
        corners[o++] = positions[v + 1];
        corners[o++] = positions[v + 2];
      }
      const vao = gl.createVertexArray();
      gl.bindVertexArray(vao);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, corners.subarray(0, 9 * count), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      this.chunks.push({ vao, base, count });
    }
    // Asked once here: in every frame it would wait for the GPU.
    if (gl.getError() === gl.OUT_OF_MEMORY) throw new Error("The scene does not fit into the memory of the graphics card");
    this.states = new PerTriangle(gl, triangles, "bytes");
    this.colours = new PerTriangle(gl, triangles, "words");
    this.colours.upload(mesh.colours);
  }

  /** What a frame did to every triangle; null shows the bare scene. */
  setFrame(frame) {
    this.frame = frame;
    if (!frame || !this.states) return;
    this.states.upload(frame.states);
    this.gatherLost(frame);
  }

  /** The lost triangles apart from the others, for the passes that draw them over everything. */
  gatherLost(frame) {
    const { lost, mesh, lostBuffers } = this;
    const count = Math.min(frame.counts[LOST], MOST_LOST);
    lost.count = count;
    lost.rings = Math.min(count, MOST_RINGS);
    if (count === 0) return;
    // Twice what is needed, so that stepping through frames seldom asks for memory.
    if (lost.centres.length < 3 * count) {
      lost.triangles = new Float32Array(9 * count * 2);
      lost.edges = new Float32Array(18 * count * 2);
      lost.centres = new Float32Array(3 * count * 2);
    }
    const { positions, indices } = mesh;
    for (let t = frame.states.indexOf(LOST), k = 0; k < count; t = frame.states.indexOf(LOST, t + 1), k++) {
      for (let axis = 0; axis < 3; axis++) {
        const a = positions[3 * indices[3 * t] + axis];
        const b = positions[3 * indices[3 * t + 1] + axis];
        const c = positions[3 * indices[3 * t + 2] + axis];
        const edge = 18 * k + axis;
        lost.triangles[9 * k + axis] = lost.edges[edge] = lost.edges[edge + 15] = a;
        lost.triangles[9 * k + 3 + axis] = lost.edges[edge + 3] = lost.edges[edge + 6] = b;
        lost.triangles[9 * k + 6 + axis] = lost.edges[edge + 9] = lost.edges[edge + 12] = c;
        lost.centres[3 * k + axis] = (a + b + c) / 3;
      }
    }
    lostBuffers.triangles.growing.fill(lost.triangles, 9 * count);
    lostBuffers.edges.growing.fill(lost.edges, 18 * count);
    lostBuffers.centres.growing.fill(lost.centres, 3 * count);
  }

  /** `count` segments of two points each under a name that panes can ask for. */
  setLines(name, data, count) {
    const { gl } = this;
    this.lineData.set(name, { data, count });
    let line = this.lines.get(name);
    if (!line) {
      line = { growing: new Growing(gl), vao: gl.createVertexArray(), count: 0 };
      gl.bindVertexArray(line.vao);
      gl.bindBuffer(gl.ARRAY_BUFFER, line.growing.buffer);
      for (const at of [0, 1]) {
        gl.enableVertexAttribArray(at);
        gl.vertexAttribPointer(at, 3, gl.FLOAT, false, 24, 12 * at);
        gl.vertexAttribDivisor(at, 1);
      }
      this.lines.set(name, line);
    }
    line.count = count;
    line.growing.fill(data, 6 * count);
  }

  /** Draws all panes. `look` is what they share: colours and choices. */
  draw(panes, look) {
    const { gl } = this;
    if (gl.isContextLost()) return;
    // The bars beside a measured camera first: panes clear their own part only.
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(look.margin[0], look.margin[1], look.margin[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    for (let i = 0; i < panes.length; i++) this.drawPane(panes[i], look);
    gl.bindVertexArray(null);
  }

  drawPane(pane, look) {
    const { gl } = this;
    if (pane.width < 1 || pane.height < 1) return;
    gl.viewport(pane.x, pane.y, pane.width, pane.height);
    gl.scissor(pane.x, pane.y, pane.width, pane.height);
    gl.clearColor(look.ground[0], look.ground[1], look.ground[2], 1);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.chunks) this.drawMesh(pane, look, false);
    gl.enable(gl.BLEND);
    // Ghosts and boxes let through what lies behind, so they do not hide each other.
    gl.depthMask(false);
    if (this.chunks && this.frame && pane.unsubmitted === 1) this.drawMesh(pane, look, true);
    if (pane.boxes) this.boxes.draw(pane, look);
    for (let i = 0; i < pane.lines.length; i++) this.drawLine(pane, pane.lines[i]);
    if (pane.marked) this.drawMark(pane, look);
    if (this.frame && this.lost.count > 0 && (look.show >> LOST) & 1) this.drawLost(pane, look);
  }

  drawMesh(pane, look, ghosts) {
    const { gl, mesh } = this;
    const { handle, at } = this.meshProgram;
    gl.useProgram(handle);
    this.camera(at, pane);
    this.states.bind(0);
    this.colours.bind(1);
    gl.uniform1i(at.uStates, 0);
    gl.uniform1i(at.uColours, 1);
    gl.uniform1i(at.uStated, this.frame ? 1 : 0);
    // Without truth nobody looked: submitted triangles have one colour then.
    gl.uniform1i(at.uTruth, this.frame && this.frame.truth ? 1 : 0);
    gl.uniform1i(at.uGhosts, ghosts ? 1 : 0);
    gl.uniform1i(at.uUnsubmitted, pane.unsubmitted);
    gl.uniform1i(at.uShow, look.show);
    gl.uniform4fv(at.uSeen, look.seen);
    gl.uniform3fv(at.uUnseen, look.unseen);
    gl.uniform3fv(at.uLost, look.lost);
    gl.uniform4fv(at.uPale, look.pale);
    gl.uniform1f(at.uCut, pane.cut);
    gl.uniform1f(at.uAlpha, ghosts ? look.ghostAlpha : 1);
    // Discarding in the shader costs early depth tests: only where sides are mixed.
    const mixed = mesh.twoSided > 0 && mesh.twoSided < mesh.triangles;
    gl.uniform1i(at.uDiscardBacks, mixed && !pane.backs ? 1 : 0);
    // The cheap way where all triangles have one side.
    if (mesh.twoSided === 0 && !pane.backs) gl.enable(gl.CULL_FACE);
    for (let i = 0; i < this.chunks.length; i++) {
      const { vao, base, count } = this.chunks[i];
      gl.bindVertexArray(vao);
      gl.uniform1i(at.uBase, base);
      gl.drawArrays(gl.TRIANGLES, 0, 3 * count);
    }
    gl.disable(gl.CULL_FACE);
  }

  camera(at, pane) {
    const { gl } = this;
    gl.uniformMatrix4fv(at.uViewProjection, false, pane.matrix);
    ONE[0] = pane.pose.eye[0];
    ONE[1] = pane.pose.eye[1];
    ONE[2] = pane.pose.eye[2];
    gl.uniform3fv(at.uEye, ONE);
  }

  /** Twice: faint through everything, and full where nothing is in front. */
  drawLine(pane, { name, width, before, after, split }) {
    const { gl } = this;
    const line = this.lines.get(name);
    if (!line || line.count === 0) return;
    const { handle, at } = this.lineProgram;
    gl.useProgram(handle);
    this.camera(at, pane);
    gl.uniform2f(at.uHalfSize, pane.width / 2, pane.height / 2);
    gl.uniform1f(at.uWidth, width * pane.ratio);
    gl.uniform1i(at.uSplit, split);
    gl.uniform4fv(at.uBefore, before);
    gl.uniform4fv(at.uAfter, after);
    gl.bindVertexArray(line.vao);
    gl.disable(gl.DEPTH_TEST);
    // Through walls one sees where the path goes on.
    gl.uniform1f(at.uAlpha, 0.35);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, line.count);
    gl.enable(gl.DEPTH_TEST);
    gl.uniform1f(at.uAlpha, 1);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, line.count);
  }

  /** Where the camera is, as a disc of one size at any distance. */
  drawMark(pane, look) {
    const { gl, mark } = this;
    ONE[0] = pane.marked[0];
    ONE[1] = pane.marked[1];
    ONE[2] = pane.marked[2];
    mark.growing.fill(ONE, 3);
    const at = this.plain(pane, look.accent, look.rim);
    gl.uniform1i(at.uShape, 2);
    gl.uniform1f(at.uPointSize, 13 * pane.ratio);
    gl.bindVertexArray(mark.vao);
    gl.disable(gl.DEPTH_TEST);
    gl.drawArrays(gl.POINTS, 0, 1);
    gl.enable(gl.DEPTH_TEST);
  }

  /** Over everything: a lost triangle behind a wall of others is still an error to be found. */
  drawLost(pane, look) {
    const { gl, lost, lostBuffers } = this;
    const at = this.plain(pane, look.lostFill, look.rim);
    gl.disable(gl.DEPTH_TEST);
    gl.uniform1i(at.uShape, 0);
    gl.uniform1f(at.uPointSize, 1);
    gl.bindVertexArray(lostBuffers.triangles.vao);
    gl.drawArrays(gl.TRIANGLES, 0, 3 * lost.count);
    gl.uniform4fv(at.uColour, look.lostEdge);
    gl.bindVertexArray(lostBuffers.edges.vao);
    gl.drawArrays(gl.LINES, 0, 6 * lost.count);
    gl.uniform1i(at.uShape, 1);
    gl.uniform1f(at.uPointSize, 14 * pane.ratio);
    // Rings, since a lost triangle may be smaller than a pixel.
    gl.bindVertexArray(lostBuffers.centres.vao);
    gl.drawArrays(gl.POINTS, 0, lost.rings);
    gl.enable(gl.DEPTH_TEST);
  }

  plain(pane, colour, rim) {
    const { gl } = this;
    const { handle, at } = this.plainProgram;
    gl.useProgram(handle);
    this.camera(at, pane);
    gl.uniform4fv(at.uColour, colour);
    gl.uniform4fv(at.uRim, rim);
    return at;
  }
}
