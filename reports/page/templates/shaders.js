"use strict";
// The programs of the graphics card: faces under a texture, and lines. `levels`: steps of a scale.
window.shaders = (levels) => {
  const FACES = [
    `#version 300 es
    in vec3 position; in vec3 normal; in vec2 uv; in vec3 heat; in vec2 sky;
    uniform mat3 axes; uniform vec3 centre; uniform vec2 scale; uniform vec2 shift; uniform float depth;
    uniform bool plane;
    out vec3 seen; out vec3 own; out vec2 at; out vec2 open; flat out vec3 about; flat out int face;
    void main() {
      face = gl_VertexID / 3; at = uv; about = heat; open = sky; own = axes * normal;
      // In the plane, faces that span a seam lie below the others and flipped ones above.
      float height = heat.z == 1.0 ? -0.5 : heat.z >= 2.0 ? 0.5 : 0.0;
      seen = plane ? vec3(uv, height) : axes * (position - centre);
      gl_Position = vec4((seen.xy - shift) * scale, -seen.z * depth, 1.0);
    }`,
    `#version 300 es
    precision highp float; precision highp int;
    in vec3 seen; in vec3 own; in vec2 at; in vec2 open; flat in vec3 about; flat in int face;
    uniform int mode; uniform bool plane; uniform bool picking; uniform int chosen; uniform float fields;
    uniform sampler2D scales;
    out vec4 colour;
    const vec3 LIGHT = vec3(0.85, 0.83, 0.77), DARK = vec3(0.022, 0.119, 0.367);
    const vec3 CLAY = vec3(0.60, 0.58, 0.55), GREEN = vec3(0.0, 0.48, 0.04), ORANGE = vec3(0.67, 0.11, 0.0);
    const vec3 PALE = vec3(0.78, 0.80, 0.78);
    vec3 linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
    vec3 srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
    vec2 integral(vec2 x) { return 1.0 - abs(mod(x, 2.0) - 1.0); }
    float board(vec2 x) { // the mean of the checkerboard over a pixel
      vec2 width = max(fwidth(x), 1e-3);
      vec2 sides = clamp((integral(x + width / 2.0) - integral(x - width / 2.0)) / width, -1.0, 1.0);
      return 0.5 + 0.5 * sides.x * sides.y;
    }
    vec3 heat(float value, float row) {
      if (value > ${levels}.5) return vec3(0.60);
      return linear(texture(scales, vec2((value + 0.5) / ${levels}.0 * 0.98 + 0.01, row)).rgb);
    }
    void main() {
      if (picking) { int f = face + 1; colour = vec4(f & 255, (f >> 8) & 255, (f >> 16) & 255, 255) / 255.0; return; }
      float tone = board(at * fields);
      bool spans = about.z == 1.0, left = about.z > 4.0, flips = about.z >= 2.0 && !left;
      vec3 normals = linear((0.5 + 0.42 * normalize(own)) * (0.30 + 0.70 * open.x));
      vec3 c = mode == 2 ? heat(about.x, 0.25) : mode == 3 ? heat(about.y, 0.75)
        : mode == 4 ? (plane ? PALE : CLAY) : mode == 1 ? normals
        : plane ? normals * (0.72 + 0.38 * tone) : mix(DARK, LIGHT, tone);
      if (mode == 0 || mode == 4) {
        if (flips) c = mix(c, ORANGE, 0.75);
        if (spans) c = plane ? PALE : mix(c, GREEN, 0.8);
        if (left) c = vec3(0.60);
      } else if (spans && plane) c = PALE;
      if (!plane) {
        vec3 n = normalize(own);
        bool front = gl_FrontFacing;
        if (!front) n = -n;
        float key = max(dot(n, normalize(vec3(-0.42, 0.56, 0.71))), 0.0), fill = max(dot(n, vec3(0.80, 0.10, 0.59)), 0.0);
        float sky = front ? open.x : open.y;
        float light = 0.50 * sky * (0.75 + 0.25 * n.y) + 0.62 * key * (0.25 + 0.75 * sky) + 0.12 * fill * sky;
        float gloss = 0.05 * pow(max(dot(n, normalize(vec3(-0.42, 0.56, 1.71))), 0.0), 40.0) * sky;
        if (mode != 1) c = c * (front ? light : 0.72 * light) + gloss;
      }
      if (face == chosen) c = vec3(1.0, 0.85, 0.0);
      colour = vec4(srgb(clamp(c, 0.0, 1.0)), 1.0);
    }`,
  ];

  // A line is a quad along its segment, as wide as said on the screen, a little towards the eye.
  const LINES = [
    `#version 300 es
    in vec3 from; in vec3 to; in vec2 side;
    uniform mat3 axes; uniform vec3 centre; uniform vec2 scale; uniform vec2 shift; uniform float depth;
    uniform bool plane; uniform vec2 pixel; uniform float width;
    void main() {
      vec3 a = plane ? vec3(from.xy, 0.6) : axes * (from - centre), b = plane ? vec3(to.xy, 0.6) : axes * (to - centre);
      vec2 p = (a.xy - shift) * scale, q = (b.xy - shift) * scale;
      vec2 along = (q - p) / pixel;
      along = length(along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
      vec2 across = vec2(-along.y, along.x);
      vec3 end = side.x < 0.5 ? a : b;
      gl_Position = vec4((end.xy - shift) * scale + (across * side.y + along * (side.x - 0.5)) * width * pixel, -end.z * depth - 0.004, 1.0);
    }`,
    `#version 300 es
    precision highp float;
    uniform vec4 tone; out vec4 colour;
    void main() { colour = tone; }`,
  ];

  return { FACES, LINES };
};
