// Colours and widths of items: one for all, as a uniform, or one for each, as an attribute.

import * as THREE from "three";
import type { Frame } from "../frame";
import type { Block, Color, Colors } from "../messages";

/** For vertex shaders: linear RGBA from bytes that hold the square root of light. */
export const COLOR = /* glsl */ `
uniform vec4 oneColor;
uniform float colorScale;
vec4 light(vec4 bytes) { return vec4(bytes.rgb * bytes.rgb * colorScale, bytes.a); }
`;

/** For vertex shaders of items with one row each: their colour and width, each an attribute or a uniform. */
export const ITEM = /* glsl */ `
${COLOR}
uniform float oneWidth;
#ifdef COLORS
in vec4 color4;
vec4 itsTone() { return light(color4); }
#else
vec4 itsTone() { return oneColor; }
#endif
#ifdef WIDTHS
in float width;
float itsWidth() { return width; }
#else
float itsWidth() { return oneWidth; }
#endif
`;

export interface Columns {
  color: THREE.TypedArray | null; // four for each item
  width: THREE.TypedArray | null;
}

export function columnUniforms() {
  return { oneColor: { value: new THREE.Vector4(1, 1, 1, 1) }, colorScale: { value: 1 }, oneWidth: { value: 0.01 } };
}

type Uniforms = ReturnType<typeof columnUniforms>;

/** Sets the uniforms, and gives the columns that are attributes. */
export function columns(color: Color | Colors, width: number | Block, frame: Frame, uniforms: Uniforms): Columns {
  const result: Columns = { color: null, width: null };
  if (Array.isArray(color)) uniforms.oneColor.value.set(...color);
  else {
    uniforms.colorScale.value = color.scale;
    result.color = frame.view(color.data);
  }
  if (typeof width === "number") uniforms.oneWidth.value = width;
  else result.width = frame.view(width);
  return result;
}

/** Compiles a shader with or without a name that is defined, if that has changed. */
export function define(material: THREE.ShaderMaterial, name: string, on: boolean): void {
  if (name in material.defines === on) return;
  if (on) material.defines[name] = 1;
  else delete material.defines[name];
  material.needsUpdate = true;
}
