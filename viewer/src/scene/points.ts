// Particles: shaded balls, flat flakes, glows that add up, soft puffs.

import * as THREE from "three";
import type { Frame } from "../frame";
import type { PointsPart } from "../messages";
import type { Theme } from "../theme";
import { GLOW, OVER, SOLID } from "./blend";
import { ITEM, columns, columnUniforms, define } from "./columns";
import type { Drawable } from "./drawable";
import { LIGHT, light } from "./light";
import { PLACE, Places } from "./places";

const LARGEST = 512; // [pixels]
const SMOKE = 0.45; // of their light is what puffs have on a bright backdrop, from which they could not be told else

const VERTEX = /* glsl */ `
${PLACE}
${ITEM}
uniform float spread, smallest;
uniform vec2 resolution;
#ifdef ROWS
in uint row;
#endif
out vec4 tone;
out vec3 middle3;
out float radius, pixels;

void main() {
#ifdef ROWS
  vec3 at = place(row);
#else
  vec3 at = place(uint(gl_VertexID));
#endif
  tone = itsTone();
  radius = itsWidth();
  middle3 = at;
  gl_Position = projectionMatrix * viewMatrix * vec4(at, 1.0);
  float full = spread * radius * resolution.y * projectionMatrix[1][1] / gl_Position.w;
  pixels = clamp(full, smallest, ${LARGEST}.0);
  float fade = min(1.0, full / smallest);
  tone.a *= fade * fade;
  gl_PointSize = pixels + 1.0;
}
`;

const FRAGMENT = /* glsl */ `
${LIGHT}
uniform mat4 projectionMatrix;
uniform float daylight;
in vec4 tone;
in vec3 middle3;
in float radius, pixels;

void main() {
  vec2 c = (2.0 * gl_PointCoord - 1.0) * (pixels + 1.0) / pixels * vec2(1.0, -1.0);
  float square = dot(c, c);
#if defined(GLOWING)
  if (square > 1.0) discard;
  float rest = 1.0 - square, cube = rest * rest * rest;
  float strength = tone.a * cube * (cube * cube + 0.15);
#ifdef DARKENS
  result = ink(tone.rgb, strength);
#else
  result = vec4(tone.rgb * strength, 0.0);
#endif
#elif defined(SOFT)
  if (square > 1.0) discard;
  float rest = 1.0 - square;
  float alpha = tone.a * rest * rest;
  vec3 normal = normalize(transpose(mat3(viewMatrix)) * vec3(c, 1.2 - square));
  result = vec4(lit(daylight * tone.rgb, normal, middle3, 0.0), 1.0) * alpha;
#else
  float edge = clamp((1.0 - sqrt(square)) * pixels * 0.5 + 0.5, 0.0, 1.0);
  if (edge <= 0.0) discard;
#ifdef FLAT
  gl_FragDepth = gl_FragCoord.z;
#else
  // A ball hides what its surface hides, not what a disc in its middle would.
  vec3 outward = transpose(mat3(viewMatrix)) * vec3(c, sqrt(max(0.0, 1.0 - square)));
  vec4 surface = projectionMatrix * viewMatrix * vec4(middle3 + radius * outward, 1.0);
  gl_FragDepth = clamp(0.5 * surface.z / surface.w + 0.5, 0.0, 1.0);
#endif
  if (shadowPass) { result = vec4(1.0); return; }
#ifdef FLAT
  vec3 normal = normalize(transpose(mat3(viewMatrix)) * vec3(0.0, 0.5, 1.0));
  result = vec4(lit(daylight * tone.rgb, normal, middle3, 0.0), edge * tone.a);
#else
  result = vec4(lit(tone.rgb, outward, middle3 + radius * outward, 0.4), edge * tone.a);
#endif
#endif
}
`;

export function points(part: PointsPart, shared: Places, theme: Theme): Drawable<PointsPart> {
  const own = part.places === null ? null : new Places();
  const uniforms = columnUniforms();
  const geometry = new THREE.BufferGeometry();
  const halo = part.glow ? 2.6 : part.soft ? 1.6 : 1.0;
  const daylight = part.soft && !theme.glows ? SMOKE * part.daylight : part.daylight;
  const blend = part.glow ? (theme.glows ? GLOW : OVER) : part.soft ? OVER : SOLID;
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { ...light, ...(own ?? shared).uniforms, ...uniforms, daylight: { value: daylight }, spread: { value: halo }, smallest: { value: part.glow ? 2.5 : 1.5 } },
    defines: {
      ...(part.glow && { GLOWING: 1 }),
      ...(part.glow && !theme.glows && { DARKENS: 1 }),
      ...(part.soft && { SOFT: 1 }),
      ...(part.flat && { FLAT: 1 }),
    },
    ...blend,
  });
  const object = new THREE.Points(geometry, material);
  if (!part.glow && !part.soft) object.layers.enable(1); // throws shadows

  return {
    object,
    update(part: PointsPart, frame: Frame) {
      if (own && part.places) own.set(part.places, frame);
      const { color, width } = columns(part.color, part.radius, frame, uniforms);
      define(material, "ROWS", part.rows !== null);
      define(material, "COLORS", color !== null);
      define(material, "WIDTHS", width !== null);
      put(geometry, "row", part.rows && (frame.view(part.rows) as Uint32Array), 1);
      put(geometry, "color4", color, 4, true);
      put(geometry, "width", width, 1);
      geometry.setDrawRange(0, part.count);
    },
    dispose() {
      geometry.dispose();
      material.dispose();
    },
  };
}

/** Sets an attribute, in the buffer that is there if it is long enough. */
function put(geometry: THREE.BufferGeometry, name: string, array: THREE.TypedArray | null, size: number, normalised = false): void {
  if (array === null) {
    geometry.deleteAttribute(name);
    return;
  }
  const old = geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
  if (old && old.array.length >= array.length) {
    old.array.set(array);
    old.clearUpdateRanges();
    old.addUpdateRange(0, array.length);
    old.needsUpdate = true;
    return;
  }
  const longer = array.slice(0, 0).constructor as new (n: number) => THREE.TypedArray;
  const buffer = new longer(Math.ceil((array.length * 1.25) / size) * size);
  buffer.set(array);
  const attribute = new THREE.BufferAttribute(buffer, size, normalised);
  attribute.setUsage(THREE.DynamicDrawUsage);
  if (old) geometry.dispose(); // the old buffer goes from the graphics card
  geometry.setAttribute(name, attribute);
}
