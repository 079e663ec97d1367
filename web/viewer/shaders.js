// The GLSL programs of the viewer. Positions come relative to the scene's origin; the
// eye is subtracted in the shader, before any rotation.

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
`;

/** Width of the textures that hold a value for every triangle. */
export const TEXTURE_WIDTH = 4096;

// State and colour of a triangle come from textures by its number, so that a new frame
// uploads one byte a triangle and no vertex. What is not shown becomes a point outside.
export const MESH = {
  vertex: `${HEAD}
layout(location = 0) in vec3 aPosition;
uniform mat4 uViewProjection;
uniform vec3 uEye;
uniform int uBase;
uniform usampler2D uStates;
uniform usampler2D uColours;
uniform bool uStated;
uniform bool uTruth;
uniform bool uGhosts;
uniform int uUnsubmitted;
uniform int uShow;
uniform vec4 uSeen;
uniform vec3 uUnseen;
uniform vec3 uLost;
uniform vec4 uPale;
out vec3 vRelative;
out float vHeight;
flat out vec3 vColour;
flat out uint vTwoSided;
void main() {
  int triangle = uBase + gl_VertexID / 3;
  ivec2 at = ivec2(triangle & ${TEXTURE_WIDTH - 1}, triangle / ${TEXTURE_WIDTH});
  uint word = texelFetch(uColours, at, 0).r;
  vec3 colour = vec3(uvec3(word >> 16u, word >> 8u, word) & 255u) / 255.0;
  bool shown = !uGhosts;
  if (uStated) {
    uint state = texelFetch(uStates, at, 0).r;
    if (state == 0u) {
      shown = uUnsubmitted == (uGhosts ? 1 : 2);
      colour = mix(colour, uPale.rgb, uPale.a);
    } else {
      // Without truth nobody knows which of the submitted are seen: they look alike.
      if (!uTruth && state != 3u) state = 2u;
      shown = !uGhosts && ((uShow >> int(state)) & 1) == 1;
      if (state == 1u) colour = mix(colour, uUnseen, 0.85);
      else if (state == 3u) colour = uLost;
      else colour = mix(colour, uSeen.rgb, uTruth ? uSeen.a : 0.0);
    }
  }
  vColour = colour;
  vTwoSided = (word >> 24u) & 1u;
  vRelative = aPosition - uEye;
  vHeight = aPosition.z;
  gl_Position = shown ? uViewProjection * vec4(vRelative, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}`,
  // The normal comes from the derivatives of the position: flat, without a normal buffer.
  fragment: `${HEAD}
in vec3 vRelative;
in float vHeight;
flat in vec3 vColour;
flat in uint vTwoSided;
uniform bool uDiscardBacks;
uniform float uCut;
uniform float uAlpha;
out vec4 oColour;
void main() {
  if (vHeight > uCut || (uDiscardBacks && !gl_FrontFacing && vTwoSided == 0u)) discard;
  vec3 normal = cross(dFdx(vRelative), dFdy(vRelative));
  float size = dot(normal, normal);
  normal = size > 0.0 ? normal * inversesqrt(size) : vec3(0.0, 0.0, 1.0);
  float light = 0.72 + 0.2 * dot(normal, vec3(0.26, 0.38, 0.888)) + 0.08 * dot(normal, vec3(-0.9, 0.43, 0.0));
  oColour = vec4(vColour * light, uAlpha);
}`,
};

// One colour for all; points become rings or discs of so many pixels.
export const PLAIN = {
  vertex: `${HEAD}
layout(location = 0) in vec3 aPosition;
uniform mat4 uViewProjection;
uniform vec3 uEye;
uniform float uPointSize;
void main() {
  gl_Position = uViewProjection * vec4(aPosition - uEye, 1.0);
  gl_PointSize = uPointSize;
}`,
  fragment: `${HEAD}
uniform vec4 uColour;
uniform vec4 uRim;
uniform int uShape;
out vec4 oColour;
void main() {
  oColour = uColour;
  if (uShape == 0) return;
  float r = length(gl_PointCoord * 2.0 - 1.0);
  if (r > 1.0 || (uShape == 1 && r < 0.5)) discard;
  // A rim in the opposite brightness keeps marks readable on any ground.
  if (r > 0.84 || (uShape == 1 && r < 0.62)) oColour = uRim;
}`,
};

// Boxes: one unit cube, an instance a node that is shown.
export const BOX = {
  vertex: `${HEAD}
layout(location = 0) in vec3 aCorner;
layout(location = 1) in vec3 aLow;
layout(location = 2) in vec3 aHigh;
layout(location = 3) in vec4 aColour;
uniform mat4 uViewProjection;
uniform vec3 uEye;
flat out vec4 vColour;
void main() {
  vColour = aColour;
  gl_Position = uViewProjection * vec4(mix(aLow, aHigh, aCorner) - uEye, 1.0);
}`,
  fragment: `${HEAD}
flat in vec4 vColour;
uniform float uAlpha;
out vec4 oColour;
void main() { oColour = vec4(vColour.rgb, vColour.a * uAlpha); }`,
};

// Lines of some width: WebGL draws lines of one pixel only, so every segment is a quad.
export const LINE = {
  vertex: `${HEAD}
layout(location = 0) in vec3 aFrom;
layout(location = 1) in vec3 aTo;
uniform mat4 uViewProjection;
uniform vec3 uEye;
uniform vec2 uHalfSize;
uniform float uWidth;
uniform int uSplit;
uniform vec4 uBefore;
uniform vec4 uAfter;
flat out vec4 vColour;
void main() {
  vec4 a = uViewProjection * vec4(aFrom - uEye, 1.0);
  vec4 b = uViewProjection * vec4(aTo - uEye, 1.0);
  float da = a.z + a.w;
  float db = b.z + b.w;
  vColour = gl_InstanceID < uSplit ? uBefore : uAfter;
  if (da <= 0.0 && db <= 0.0) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  // An end behind the eye would turn the quad inside out: cut at the near plane first.
  if (da < 0.0) a = mix(a, b, da / (da - db) + 1e-5);
  if (db < 0.0) b = mix(b, a, db / (db - da) + 1e-5);
  vec2 along = (b.xy / b.w - a.xy / a.w) * uHalfSize;
  float size = length(along);
  along = size > 0.0 ? along / size : vec2(1.0, 0.0);
  vec4 end = (gl_VertexID & 1) == 0 ? a : b;
  float side = (gl_VertexID & 2) == 0 ? -0.5 : 0.5;
  end.xy += vec2(-along.y, along.x) * side * uWidth / uHalfSize * end.w;
  gl_Position = end;
}`,
  fragment: `${HEAD}
flat in vec4 vColour;
uniform float uAlpha;
out vec4 oColour;
void main() { oColour = vec4(vColour.rgb, vColour.a * uAlpha); }`,
};
