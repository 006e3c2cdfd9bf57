// Segments and curves: capsules in the picture, of their own width, shaded like round rods; thinner than a pixel they fade.

import * as THREE from "three";
import type { Frame } from "../frame";
import type { CurvesPart, SegmentsPart } from "../messages";
import type { Theme } from "../theme";
import { GLOW, OVER, SOLID } from "./blend";
import { COLOR, columns, columnUniforms, define } from "./columns";
import type { Drawable } from "./drawable";
import { LIGHT, light } from "./light";
import { PLACE, Places } from "./places";

const VERTEX = /* glsl */ `
${PLACE}
${COLOR}
uniform float oneWidth;
uniform vec2 resolution;
in uint rowA, rowB;
#ifdef COLORS
in vec4 colorA, colorB;
#endif
#ifdef WIDTHS
in float widthA, widthB;
#endif
out vec4 tone;
out vec3 spot, along;
out float across, pixels;

void main() {
  if ((rowA & 0x80000000u) != 0u) { gl_Position = vec4(0.0, 0.0, 2.0, 1.0); return; }
  vec3 a = place(rowA), b = place(rowB & 0x7fffffffu);
  bool end = position.x > 0.5;
  spot = end ? b : a;
  along = b - a;
#ifdef COLORS
  tone = light(end ? colorB : colorA);
#else
  tone = oneColor;
#endif
#ifdef WIDTHS
  float width = end ? widthB : widthA;
#else
  float width = oneWidth;
#endif
  mat4 seen = projectionMatrix * viewMatrix;
  vec4 pa = seen * vec4(a, 1.0), pb = seen * vec4(b, 1.0);
  vec4 at = end ? pb : pa;
  vec2 way = pb.xy / pb.w * resolution - pa.xy / pa.w * resolution;
  float length2 = length(way);
  way = length2 > 1e-6 ? way / length2 : vec2(1.0, 0.0);
  float full = width * 0.5 * resolution.y * projectionMatrix[1][1] / at.w;
  pixels = max(full, 1.2);
  tone.a *= min(1.0, full / pixels);
  across = position.y * (pixels + 1.0) / pixels;
#ifdef GLOWING
  float over = 0.0; // light would add up where two lines meet
#else
  float over = end ? 0.3 : -0.3;
#endif
  vec2 off = (vec2(-way.y, way.x) * position.y + way * over) * (pixels + 1.0);
  gl_Position = pa.w > 0.0 && pb.w > 0.0 ? at + vec4(off / resolution * at.w, 0.0, 0.0) : vec4(0.0, 0.0, 2.0, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
${LIGHT}
in vec4 tone;
in vec3 spot, along;
in float across, pixels;

void main() {
  float far = abs(across);
  float edge = clamp((1.0 - far) * pixels * 0.5 + 0.5, 0.0, 1.0);
  if (edge <= 0.0) discard;
  if (shadowPass) { result = vec4(1.0); return; }
#if defined(GLOWING) && !defined(DARKENS)
  result = vec4(tone.rgb * tone.a * edge, 0.0);
#elif defined(DARKENS)
  result = vec4(min(tone.rgb, vec3(1.0)), 1.0) * tone.a * edge;
#else
  vec3 toEye = normalize(cameraPosition - spot), t = normalize(along);
  vec3 side = normalize(cross(t, toEye)), front = cross(side, t);
  float c = clamp(across, -1.0, 1.0);
  vec3 normal = normalize(side * -c + front * sqrt(1.0 - 0.9 * c * c));
  float tk = dot(t, toKey), te = dot(t, toEye);
  float sheen = pow(max(0.0, sqrt(1.0 - tk * tk) * sqrt(1.0 - te * te) - tk * te), 24.0); // Kajiya and Kay
  result = vec4(lit(tone.rgb, normal, spot, 0.12) + tone.rgb * sheen * 0.5, tone.a * edge);
#endif
}
`;

const QUAD = new THREE.BufferAttribute(new Float32Array([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0]), 3);
const QUAD_INDEX = new THREE.BufferAttribute(new Uint16Array([0, 1, 2, 0, 2, 3]), 1);

/** Attributes NAMEA and NAMEB of each line: its own two entries of a column, or that of this and the next item. */
function ends(geometry: THREE.BufferGeometry, name: string, array: THREE.TypedArray, size: number, step: number, next: number, normalised = false) {
  const buffer = new THREE.InstancedInterleavedBuffer(array, step * size);
  geometry.setAttribute(`${name}A`, new THREE.InterleavedBufferAttribute(buffer, size, 0, normalised));
  geometry.setAttribute(`${name}B`, new THREE.InterleavedBufferAttribute(buffer, size, next * size, normalised));
}

function lines<P extends SegmentsPart | CurvesPart>(
  part: P,
  shared: Places,
  theme: Theme,
  shape: (part: P, frame: Frame) => { rows: Uint32Array; chained: boolean },
): Drawable<P> {
  const own = part.places === null ? null : new Places();
  const uniforms = columnUniforms();
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { ...light, ...(own ?? shared).uniforms, ...uniforms },
    defines: { ...(part.glow && { GLOWING: 1 }), ...(part.glow && !theme.glows && { DARKENS: 1 }) },
    side: THREE.DoubleSide,
    ...(part.glow ? (theme.glows ? GLOW : OVER) : SOLID),
  });
  const object = new THREE.Mesh(new THREE.InstancedBufferGeometry(), material);
  if (!part.glow) object.layers.enable(1);

  return {
    object,
    update(part: P, frame: Frame) {
      if (own && part.places) own.set(part.places, frame);
      const { color, width } = columns(part.color, part.width, frame, uniforms);
      const { rows, chained } = shape(part, frame);
      const geometry = new THREE.InstancedBufferGeometry();
      geometry.setAttribute("position", QUAD);
      geometry.setIndex(QUAD_INDEX);
      ends(geometry, "row", rows, 1, chained ? 1 : 2, 1);
      if (color) ends(geometry, "color", color, 4, 1, chained ? 1 : 0, true);
      if (width) ends(geometry, "width", width, 1, 1, chained ? 1 : 0);
      geometry.instanceCount = chained ? Math.max(0, rows.length - 1) : rows.length / 2;
      define(material, "COLORS", color !== null);
      define(material, "WIDTHS", width !== null);
      object.geometry.dispose();
      object.geometry = geometry;
      object.visible = geometry.instanceCount > 0;
    },
    dispose() {
      object.geometry.dispose();
      material.dispose();
    },
  };
}

export function segments(part: SegmentsPart, shared: Places, theme: Theme): Drawable<SegmentsPart> {
  return lines(part, shared, theme, (part, frame) => ({ rows: frame.view(part.pairs) as Uint32Array, chained: false }));
}

export function curves(part: CurvesPart, shared: Places, theme: Theme): Drawable<CurvesPart> {
  return lines(part, shared, theme, (part, frame) => ({ rows: frame.view(part.rows) as Uint32Array, chained: true }));
}
