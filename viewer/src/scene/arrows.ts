// Arrows of a field: flat, turned towards the eye, a shaft and a head.

import * as THREE from "three";
import type { Frame } from "../frame";
import type { ArrowsPart } from "../messages";
import { ITEM, columns, columnUniforms, define } from "./columns";
import type { Drawable } from "./drawable";
import { light } from "./light";
import { PLACE, Places } from "./places";

const HEAD = 2.6; // its width, in widths of the shaft

const VERTEX = /* glsl */ `
${PLACE}
${ITEM}
in vec3 vector;
out vec4 tone;

void main() {
  tone = itsTone();
  float wide = itsWidth();
  vec3 tail = place(uint(gl_InstanceID));
  float size = length(vector), head = min(2.0 * ${HEAD.toFixed(1)} * wide, 0.5 * size);
  vec3 way = size > 0.0 ? vector / size : vec3(0.0);
  vec3 at = tail + way * (position.x < 0.5 ? 0.0 : position.x < 1.5 ? size - head : size);
  vec3 side = cross(way, normalize(cameraPosition - at));
  at += side * position.y * 0.5 * min(wide, 0.3 * size);
  gl_Position = projectionMatrix * viewMatrix * vec4(at, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
in vec4 tone;
uniform bool shadowPass;
out highp vec4 result;
void main() { result = shadowPass ? vec4(1.0) : tone; }
`;

const SHAPE = new THREE.BufferAttribute(
  new Float32Array([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0, 1, -HEAD, 0, 2, 0, 0, 1, HEAD, 0]),
  3,
);
const SHAPE_INDEX = new THREE.BufferAttribute(new Uint16Array([0, 1, 2, 0, 2, 3, 4, 5, 6]), 1);

export function arrows(_part: ArrowsPart, _shared: Places): Drawable<ArrowsPart> {
  const own = new Places();
  const uniforms = columnUniforms();
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { ...light, ...own.uniforms, ...uniforms },
    side: THREE.DoubleSide,
  });
  const object = new THREE.Mesh(new THREE.InstancedBufferGeometry(), material);
  return {
    object,
    update(part: ArrowsPart, frame: Frame) {
      own.set(part.places, frame);
      const { color, width } = columns(part.color, part.width, frame, uniforms);
      const geometry = new THREE.InstancedBufferGeometry();
      geometry.setAttribute("position", SHAPE);
      geometry.setIndex(SHAPE_INDEX);
      const vectors = frame.view(part.vectors);
      geometry.setAttribute("vector", new THREE.InstancedBufferAttribute(vectors, 3));
      if (color) geometry.setAttribute("color4", new THREE.InstancedBufferAttribute(color, 4, true));
      if (width) geometry.setAttribute("width", new THREE.InstancedBufferAttribute(width, 1));
      geometry.instanceCount = vectors.length / 3;
      define(material, "COLORS", color !== null);
      define(material, "WIDTHS", width !== null);
      object.geometry.dispose();
      object.geometry = geometry;
    },
    dispose() {
      object.geometry.dispose();
      material.dispose();
    },
  };
}
