// How surfaces are lit: a key light from the upper left of the viewer, light from all over above, a little gloss,
// and fading with depth. All in the camera's frame, so the light turns with the viewer.
import {DoubleSide, ShaderMaterial, Vector2, Vector3, Vector4} from "three";

const vertex = /* glsl */ `
attribute vec4 tint, tint_next, tint_last;  // of the vertex, and of the two corners that follow in its face
uniform float edges, crisp;
flat varying vec3 vFirst, vSecond, vThird;  // a face has those of its third corner
varying vec3 vTint, vNormal, vView, vPlace, vCorner;
vec3 linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
void main() {
  vTint = linear(tint.rgb);
  if (crisp > 0.0) {
    vFirst = linear(tint_next.rgb);
    vSecond = linear(tint_last.rgb);
    vThird = vTint;
  } else vFirst = vSecond = vThird = vec3(0.0);
#ifdef FACETS
  vNormal = vec3(0.0);
#else
  vNormal = normalMatrix * normal;
#endif
  vPlace = position;
  int corner = gl_VertexID % 3;  // of meshes without an index only
  vCorner = edges > 0.0 || crisp > 0.0 ? vec3(corner == 0, corner == 1, corner == 2) : vec3(1.0);
  vec4 view = modelViewMatrix * vec4(position, 1.0);
  vView = view.xyz;
  gl_Position = projectionMatrix * view;
}`;

const fragment = /* glsl */ `
uniform vec4 plane;      // what lies beyond dot(p, xyz) = w is cut off
uniform vec3 inside, paper, ink;
uniform vec2 depths;     // distances where fading begins and ends
uniform float edges;
uniform float crisp;     // 1: a face has the colours of its corners side by side (classes), not blended
flat varying vec3 vFirst, vSecond, vThird;
varying vec3 vTint, vNormal, vView, vPlace, vCorner;
vec3 srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(max(c, 0.0), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
void main() {
  if (dot(vPlace, plane.xyz) > plane.w) discard;
#ifdef FACETS
  vec3 n = normalize(cross(dFdx(vView), dFdy(vView)));
  vec3 base = vTint;
#else
  vec3 n = normalize(vNormal) * (gl_FrontFacing ? 1.0 : -1.0);
  vec3 tint = vTint;
  if (crisp > 0.0) {
    vec3 part = vCorner;  // corners of one class stand together: borders run from middle to middle of edges
    if (vFirst == vSecond) part = vec3(part.x + part.y, 0.0, part.z);
    else if (vFirst == vThird) part = vec3(part.x + part.z, part.y, 0.0);
    else if (vSecond == vThird) part = vec3(part.x, part.y + part.z, 0.0);
    tint = part.x >= max(part.y, part.z) ? vFirst : part.y >= part.z ? vSecond : vThird;
  }
  vec3 base = gl_FrontFacing ? tint : inside;
#endif
  vec3 key = vec3(-0.42, 0.53, 0.74);
  float sky = 0.5 + 0.5 * n.y;
  float light = 0.62 * max(dot(n, key), 0.0) + 0.30 * max(n.z, 0.0) + mix(0.10, 0.22, sky);
  float gloss = 0.10 * pow(max(dot(n, normalize(key + vec3(0.0, 0.0, 1.0))), 0.0), 28.0);
  vec3 colour = base * light + gloss;
#ifndef FACETS
  // A hollow without shadows looks like a bump: the inside grows darker with the distance from the cut.
  if (!gl_FrontFacing) colour *= mix(1.0, 0.38, smoothstep(0.0, 0.5, (plane.w - dot(vPlace, plane.xyz)) / (depths.y - depths.x)));
#endif
  if (edges > 0.0) {
    vec3 size = fwidth(vCorner);
    vec3 near = smoothstep(vec3(0.0), size * 1.2, vCorner);
    float line = 1.0 - min(min(near.x, near.y), near.z);
    float pixels = 1.0 / max(max(size.x, size.y), size.z);  // lines of faces of a few pixels fade
    colour = mix(colour, ink, line * edges * smoothstep(1.5, 7.0, pixels));
  }
  float far = clamp((-vView.z - depths.x) / (depths.y - depths.x), 0.0, 1.0);
  gl_FragColor = vec4(mix(srgb(colour), paper, 0.28 * far), 1.0);
}`;

/** Material with the uniforms that all share; `facets`: flat faces without normals or an inside. */
export function make_material(uniforms, facets) {
  return new ShaderMaterial({
    uniforms, vertexShader: vertex, fragmentShader: fragment, side: DoubleSide, defines: facets ? {FACETS: 1} : {},
  });
}

export function make_uniforms(inside) {
  const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return {
    plane: {value: new Vector4(0, 0, 0, 1)},
    inside: {value: new Vector3(...inside.map((c) => linear(c / 255)))},
    paper: {value: new Vector3(1, 1, 1)},
    ink: {value: new Vector3(0.01, 0.01, 0.015)},
    depths: {value: new Vector2(0, 1)},
    edges: {value: 0},
    crisp: {value: 0},
  };
}
