// Meshes: smooth or flat, seen from both sides, with a pattern on them.

import * as THREE from "three";
import type { Frame } from "../frame";
import type { Block, TrianglesPart } from "../messages";
import { OVER } from "./blend";
import { ITEM, columns, columnUniforms, define } from "./columns";
import type { Drawable } from "./drawable";
import { LIGHT, light } from "./light";
import { NORMAL, Normals, PLACE, Places } from "./places";

const VERTEX = /* glsl */ `
${PLACE}
${NORMAL}
${ITEM}
in uint corner;
#ifdef PATTERN
in vec2 uv2;
out vec2 at;
#endif
out vec4 tone;
out vec3 spot, normal3;

void main() {
  tone = itsTone();
#ifdef PATTERN
  at = uv2;
#endif
  spot = place(corner);
  normal3 = bent(corner);
  gl_Position = projectionMatrix * viewMatrix * vec4(spot, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
${LIGHT}
in vec4 tone;
in vec3 spot, normal3;
#ifdef PATTERN
in vec2 at;
uniform float fields;
uniform vec3 otherColor;
// Fields along one side, with edges a pixel wide: +1 and -1 in turns.
float turns(float x) {
  float y = x * fields, w = max(fwidth(y), 1e-4);
  float s = abs(mod(y, 2.0) - 1.0) - 0.5;
  return clamp(s / w, -1.0, 1.0) * clamp(1.5 - w, 0.0, 1.0);
}
#endif

void main() {
  if (shadowPass) { result = vec4(1.0); return; }
  vec3 toEye = normalize(cameraPosition - spot);
#ifdef SMOOTH
  vec3 normal = normalize(normal3);
#else
  vec3 normal = normalize(cross(dFdx(spot), dFdy(spot)));
#endif
  if (dot(normal, toEye) < 0.0) normal = -normal;
  vec3 albedo = tone.rgb;
#ifdef PATTERN
#if PATTERN == 1
  float first = 0.5 + 0.5 * turns(at.x) * turns(at.y);
#elif PATTERN == 2
  float first = 0.5 + 0.5 * turns(at.x);
#else
  float first = 0.5 + 0.5 * turns(at.y);
#endif
  albedo = mix(otherColor, albedo, first);
#endif
  result = vec4(lit(albedo, normal, spot, 0.06) * tone.a, tone.a);
}
`;

export function triangles(part: TrianglesPart, shared: Places): Drawable<TrianglesPart> {
  const own = part.places === null ? null : new Places();
  const normals = new Normals();
  const uniforms = { ...columnUniforms(), fields: { value: 1 }, otherColor: { value: new THREE.Vector3() } };
  const clear = Array.isArray(part.color) && part.color[3] < 1;
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { ...light, ...(own ?? shared).uniforms, ...normals.uniforms, ...uniforms },
    defines: { ...(part.smooth && { SMOOTH: 1 }), ...(part.uv && part.pattern > 0 && { PATTERN: part.pattern }) },
    side: THREE.DoubleSide,
    ...(clear && OVER),
  });
  const object = new THREE.Mesh(new THREE.BufferGeometry(), material);
  if (!clear) object.layers.enable(1);

  return {
    object,
    update(part: TrianglesPart, frame: Frame) {
      if (own && part.places) own.set(part.places, frame);
      if (part.normals) normals.set(part.normals, frame);
      const { color } = columns(part.color, 0, frame, uniforms);
      const faces = frame.view(part.faces) as Uint32Array;
      const geometry = new THREE.BufferGeometry();
      // The corners of a face have their own places on a pattern, so none is shared between faces.
      geometry.setAttribute("corner", new THREE.BufferAttribute(faces, 1));
      if (part.uv) geometry.setAttribute("uv2", new THREE.BufferAttribute(frame.view(part.uv), 2));
      if (color) geometry.setAttribute("color4", new THREE.BufferAttribute(spread(color, faces), 4, true));
      define(material, "COLORS", color !== null);
      geometry.setDrawRange(0, faces.length);
      uniforms.fields.value = part.pattern_count;
      uniforms.otherColor.value.set(...part.pattern_color);
      object.geometry.dispose();
      object.geometry = geometry;
    },
    bend(block: Block, frame: Frame) {
      normals.set(block, frame);
    },
    dispose() {
      object.geometry.dispose();
      material.dispose();
    },
  };
}

/** A colour for each corner of each face. */
function spread(colors: THREE.TypedArray, faces: Uint32Array): Uint8Array {
  const words = new Uint32Array(colors.buffer, colors.byteOffset, colors.length / 4);
  return new Uint8Array(faces.map((row) => words[row]).buffer);
}
