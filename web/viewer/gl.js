// What WebGL2 needs to be asked for in many words: programs with their uniforms by
// name, buffers that grow, and textures with one integer for every triangle.

import { TEXTURE_WIDTH } from "./shaders.js";

export function context(canvas) {
  return canvas.getContext("webgl2", {
    alpha: false,
    antialias: true,
    depth: true,
    preserveDrawingBuffer: false,
    powerPreference: "high-performance",
  });
}

function compile(gl, type, source) {
  const shader = gl.createShader(type);
  gl.shaderSource(shader, source);
  gl.compileShader(shader);
  return shader;
}

/** Programs compile side by side where drivers can; asking for the result waits. */
export function program(gl, { vertex, fragment }) {
  const handle = gl.createProgram();
  const shaders = [compile(gl, gl.VERTEX_SHADER, vertex), compile(gl, gl.FRAGMENT_SHADER, fragment)];
  for (const shader of shaders) gl.attachShader(handle, shader);
  gl.linkProgram(handle);
  if (!gl.getProgramParameter(handle, gl.LINK_STATUS) && !gl.isContextLost()) {
    const log = shaders.map((s) => gl.getShaderInfoLog(s)).join("\n") + gl.getProgramInfoLog(handle);
    throw new Error(`The graphics driver refuses a shader: ${log.trim()}`);
  }
  for (const shader of shaders) gl.deleteShader(shader);
  const uniforms = {};
  const count = gl.getProgramParameter(handle, gl.ACTIVE_UNIFORMS) || 0;
  for (let i = 0; i < count; i++) {
    const { name } = gl.getActiveUniform(handle, i);
    uniforms[name] = gl.getUniformLocation(handle, name);
  }
  return { handle, at: uniforms };
}

/** A vertex buffer that is filled anew from time to time and grows by doubling. */
export class Growing {
  constructor(gl) {
    this.gl = gl;
    this.buffer = gl.createBuffer();
    this.capacity = 0;
  }

  /** Uploads the first `length` elements of `data`. */
  fill(data, length) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    const bytes = length * data.BYTES_PER_ELEMENT;
    if (bytes > this.capacity) {
      this.capacity = Math.max(bytes, 2 * this.capacity, 1024);
      gl.bufferData(gl.ARRAY_BUFFER, this.capacity, gl.DYNAMIC_DRAW);
    }
    if (length > 0) gl.bufferSubData(gl.ARRAY_BUFFER, 0, data, 0, length);
  }
}

/** An integer texture with a texel a triangle; `kind` is "bytes" or "words". */
export class PerTriangle {
  constructor(gl, count, kind) {
    this.gl = gl;
    this.count = count;
    this.rows = Math.max(1, Math.ceil(count / TEXTURE_WIDTH));
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (this.rows > most) {
      throw new Error(`The scene has ${count} triangles, but this graphics card takes ${most * TEXTURE_WIDTH} at most`);
    }
    this.type = kind === "bytes" ? gl.UNSIGNED_BYTE : gl.UNSIGNED_INT;
    this.texture = gl.createTexture();
    this.bind(0);
    for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, key, gl.NEAREST);
    for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, key, gl.CLAMP_TO_EDGE);
    gl.texStorage2D(gl.TEXTURE_2D, 1, kind === "bytes" ? gl.R8UI : gl.R32UI, TEXTURE_WIDTH, this.rows);
  }

  bind(unit) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, this.texture);
  }

  /** Full rows in one call and the rest in another: the data need no padding. */
  upload(data) {
    const { gl, count, type } = this;
    this.bind(0);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const full = Math.floor(count / TEXTURE_WIDTH);
    const rest = count - full * TEXTURE_WIDTH;
    const put = (y, width, height, from) =>
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y, width, height, gl.RED_INTEGER, type, data, from);
    if (full > 0) put(0, TEXTURE_WIDTH, full, 0);
    if (rest > 0) put(full, rest, 1, full * TEXTURE_WIDTH);
  }
}
