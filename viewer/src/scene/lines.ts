// Segments and curves: capsules in the picture, of their own width, shaded like round rods; thinner than a pixel they fade. Pieces of a
// curve end where they meet, along the line that halves their angle: nothing gapes, and no light adds up.

import * as THREE from "three";
import type { Frame } from "../frame";
import type { CurvesPart, SegmentsPart } from "../messages";
import type { Theme } from "../theme";
import { GLOW, OVER, SOLID } from "./blend";
import { COLOR, columns, columnUniforms, define } from "./columns";
import type { Drawable } from "./drawable";
import { LIGHT, light } from "./light";
import { PLACE, Places } from "./places";

const REACH = 2.2; // a glowing line ends at this many radii, as in the offline renderer (render/capsules.py)
const THINNEST = 1.2, THINNEST_GLOW = 2.6; // [pixels]

const VERTEX = /* glsl */ `
${PLACE}
${COLOR}
uniform float oneWidth;
uniform vec2 resolution;
in uint rowA, rowB;
#ifdef CHAINED
in uint rowBefore, rowAfter;
#endif
#ifdef COLORS
in vec4 colorA, colorB;
#endif
#ifdef WIDTHS
in float widthA, widthB;
#endif
out vec4 tone;
out vec3 spot, along;
out vec2 past; // both ends, where they are round [half widths]
out float across, pixels;

bool breaks(uint row) { return (row & 0x80000000u) != 0u; }
vec4 seen(uint row) { return projectionMatrix * viewMatrix * vec4(place(row & 0x7fffffffu), 1.0); }
vec2 way(vec4 from, vec4 to) {
  vec2 step = (to.xy / to.w - from.xy / from.w) * resolution;
  float size = length(step);
  return from.w > 0.0 && to.w > 0.0 && size > 1e-6 ? step / size : vec2(0.0);
}
/** Along the curve where two pieces meet; 0 where they do not, or turn back sharply. */
vec2 joint(vec2 before, vec2 after) {
  return dot(before, before) * dot(after, after) > 0.0 && dot(before, after) > -0.5 ? normalize(before + after) : vec2(0.0);
}

void main() {
  vec4 pa = seen(rowA), pb = seen(rowB);
  if (breaks(rowA) || pa.w <= 0.0 || pb.w <= 0.0) { gl_Position = vec4(0.0, 0.0, 2.0, 1.0); return; }
  float size = length((pb.xy / pb.w - pa.xy / pa.w) * resolution);
#ifdef CHAINED
  // A particle at rest leaves a trail without length: it would be as bright as all its pieces.
  if (size < 1e-4) { gl_Position = vec4(0.0, 0.0, 2.0, 1.0); return; }
#endif
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
  vec4 at = end ? pb : pa;
  vec2 straight = size > 1e-6 ? way(pa, pb) : vec2(1.0, 0.0);
  vec2 jointA = vec2(0.0), jointB = vec2(0.0);
#ifdef CHAINED
  if (!breaks(rowBefore)) jointA = joint(way(seen(rowBefore), pa), straight);
  if (!breaks(rowB)) jointB = joint(straight, way(pb, seen(rowAfter)));
#endif
  float full = width * 0.5 * resolution.y * projectionMatrix[1][1] / at.w;
#ifdef GLOWING
  full *= ${REACH};
  pixels = max(full, ${THINNEST_GLOW});
  float reach = pixels;
#else
  pixels = max(full, ${THINNEST});
  float reach = pixels + 1.0;
#endif
  tone.a *= min(1.0, full / pixels);
  across = position.y * reach / pixels;
  bool roundA = jointA == vec2(0.0), roundB = jointB == vec2(0.0);
  float over = end ? (roundB ? reach : 0.0) : (roundA ? -reach : 0.0);
  float passed = end ? size + over : over;
  past = vec2(roundA ? -passed : -1.0, roundB ? passed - size : -1.0) / pixels;
  vec2 bend = end ? (roundB ? straight : jointB) : (roundA ? straight : jointA);
  vec2 off = vec2(-bend.y, bend.x) * position.y * reach / dot(bend, straight) + straight * over;
  gl_Position = at + vec4(off / resolution * at.w, 0.0, 0.0);
}
`;

const FRAGMENT = /* glsl */ `
${LIGHT}
in vec4 tone;
in vec3 spot, along;
in vec2 past;
in float across, pixels;

void main() {
  float far = length(vec2(across, max(0.0, max(past.x, past.y))));
#ifdef GLOWING
  float rest = max(0.0, 1.0 - far * far), strength = tone.a * rest * rest * rest;
#ifdef DARKENS
  result = ink(tone.rgb, strength);
#else
  result = vec4(tone.rgb * strength, 0.0);
#endif
#else
  float edge = clamp((1.0 - far) * pixels * 0.5 + 0.5, 0.0, 1.0);
  if (edge <= 0.0) discard;
  if (shadowPass) { result = vec4(1.0); return; }
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

/** A column of each item's neighbours, too: they are in a curve what lies before and after a line. */
function neighbours(geometry: THREE.BufferGeometry, rows: Uint32Array): void {
  const padded = new Uint32Array(rows.length + 2); // who ends the column is its own neighbour
  padded.set(rows, 1);
  if (rows.length) [padded[0], padded[rows.length + 1]] = [rows[0], rows[rows.length - 1]];
  const buffer = new THREE.InstancedInterleavedBuffer(padded, 1);
  ["rowBefore", "rowA", "rowB", "rowAfter"].forEach((name, k) => geometry.setAttribute(name, new THREE.InterleavedBufferAttribute(buffer, 1, k)));
}

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
  chained: boolean,
  rowsOf: (part: P, frame: Frame) => Uint32Array,
): Drawable<P> {
  const own = part.places === null ? null : new Places();
  const uniforms = columnUniforms();
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { ...light, ...(own ?? shared).uniforms, ...uniforms },
    defines: { ...(chained && { CHAINED: 1 }), ...(part.glow && { GLOWING: 1 }), ...(part.glow && !theme.glows && { DARKENS: 1 }) },
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
      const rows = rowsOf(part, frame);
      const geometry = new THREE.InstancedBufferGeometry();
      geometry.setAttribute("position", QUAD);
      geometry.setIndex(QUAD_INDEX);
      if (chained) neighbours(geometry, rows);
      else ends(geometry, "row", rows, 1, 2, 1);
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
  return lines(part, shared, theme, false, (part, frame) => frame.view(part.pairs) as Uint32Array);
}

export function curves(part: CurvesPart, shared: Places, theme: Theme): Drawable<CurvesPart> {
  return lines(part, shared, theme, true, (part, frame) => frame.view(part.rows) as Uint32Array);
}
