// Light as in the offline renderer (render/lamp.py, kernels_shade.py): a soft key light with a shadow, sky and ground, a pool of light
// around what the camera looks at. One set of uniforms, shared by all materials.

import * as THREE from "three";
import type { Theme } from "../theme";

const REACH = 1.15; // of the shadow, in radii of the pool's bright part
const POOL = 1.8; // radius of the pool of light, in halves of the picture's height

export const light = {
  bottom: { value: new THREE.Color() },
  top: { value: new THREE.Color() },
  ambient: { value: 0.34 },
  toKey: { value: new THREE.Vector3(-0.45, 1.0, 0.55).normalize() },
  middle: { value: new THREE.Vector3() },
  pool: { value: 1 },
  wider: { value: 1 }, // the pool, by the theme
  resolution: { value: new THREE.Vector2(1, 1) },
  shadowPass: { value: false },
  shadowMap: { value: null as THREE.Texture | null },
  toShadow: { value: new THREE.Matrix4() },
  texel: { value: 1 },
  softness: { value: 2 }, // of the shadow's edge [texels]
};

/** For fragment shaders: `lit(albedo, normal, place, gloss)`, `ink(glow, strength)` and `backdrop()`. */
export const LIGHT = /* glsl */ `
uniform vec3 bottom, top, toKey, middle;
uniform float ambient, pool, texel;
uniform vec2 resolution;
uniform bool shadowPass;
uniform int softness;
uniform highp sampler2D shadowMap;
uniform mat4 toShadow;
out highp vec4 result;

vec3 backdrop() { return mix(bottom, top, gl_FragCoord.y / resolution.y); }

/** A glow on a bright backdrop, which light cannot be seen on: laid over it, dark enough to be told from it; faint light is a thin layer. */
vec4 ink(vec3 glow, float strength) {
  float peak = max(max(glow.r, glow.g), max(glow.b, 1e-6));
  vec3 color = glow / peak;
  color *= min(1.0, 0.4 / dot(color, vec3(0.2126, 0.7152, 0.0722)));
  return vec4(color, 1.0) * min(1.0, 1.5 * strength * min(1.0, peak));
}

float unshadowed(vec3 place, vec3 normal) {
  vec4 at = toShadow * vec4(place + normal * texel * 3.0, 1.0);
  vec3 q = at.xyz * 0.5 + 0.5;
  if (any(lessThan(q, vec3(0.0))) || any(greaterThan(q, vec3(1.0)))) return 1.0;
  float step = 1.0 / float(textureSize(shadowMap, 0).x);
  float seen = 0.0;
  for (int j = -softness; j <= softness; j++)
    for (int i = -softness; i <= softness; i++)
      seen += q.z - 0.001 <= texture(shadowMap, q.xy + vec2(float(i), float(j)) * step).r ? 1.0 : 0.0;
  return seen / float((2 * softness + 1) * (2 * softness + 1));
}

vec3 lit(vec3 albedo, vec3 normal, vec3 place, float gloss) {
  vec3 toEye = normalize(cameraPosition - place);
  float facing = clamp(dot(normal, toEye), 0.0, 1.0);
  float open = unshadowed(place, normal);
  float key = open * max(0.0, (dot(normal, toKey) + 0.12) / 1.12);
  float shine = pow(max(0.0, dot(normal, normalize(toEye + toKey))), 32.0) * gloss * open;
  float high = 0.5 + 0.5 * normal.y;
  float rim = pow(1.0 - facing, 4.0) * 0.3 * high;
  vec3 sky = ambient * vec3(0.62, 0.78, 1.0), ground = ambient * vec3(0.34, 0.28, 0.26), sun = vec3(0.86, 0.8, 0.72);
  vec3 far3 = (place - middle) * pool;
  float far = dot(far3, far3);
  float bright = 1.0 / (1.0 + far * far);
  vec3 color = albedo * (key * sun + (0.55 + 0.45 * facing) * mix(ground, sky, high)) + shine * sun + rim * sky;
  return mix(backdrop(), color, bright);
}
`;

/** Draws the depth that the key light sees into a texture, and follows what the camera looks at. */
export class Shadow {
  private readonly camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0, 1);
  private readonly target: THREE.WebGLRenderTarget;

  constructor(size: number) {
    this.target = new THREE.WebGLRenderTarget(size, size, { depthTexture: new THREE.DepthTexture(size, size, THREE.FloatType) });
    light.shadowMap.value = this.target.depthTexture;
    this.camera.layers.set(1);
  }

  draw(renderer: THREE.WebGLRenderer, scene: THREE.Scene, eye: THREE.PerspectiveCamera, middle: THREE.Vector3): void {
    const distance = eye.position.distanceTo(middle);
    const radius = POOL * distance * Math.tan(THREE.MathUtils.degToRad(eye.fov) / 2);
    light.middle.value.copy(middle);
    light.pool.value = 1 / (light.wider.value * radius);
    const reach = REACH * radius;
    const camera = this.camera;
    camera.left = camera.bottom = -reach;
    camera.right = camera.top = reach;
    camera.far = 4 * reach;
    camera.position.copy(middle).addScaledVector(light.toKey.value, 2 * reach);
    camera.up.set(0, 0, -1);
    camera.lookAt(middle);
    camera.updateMatrixWorld();
    camera.updateProjectionMatrix();
    light.toShadow.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    light.texel.value = (2 * reach) / this.target.width;
    const screen = light.resolution.value.clone();
    light.resolution.value.set(this.target.width, this.target.height);
    light.shadowPass.value = true;
    const map = light.shadowMap.value;
    light.shadowMap.value = null; // nothing may read what is being written
    renderer.setRenderTarget(this.target);
    renderer.clear();
    renderer.render(scene, camera);
    light.shadowMap.value = map;
    light.shadowPass.value = false;
    light.resolution.value.copy(screen);
  }
}

/** Colours of the backdrop. */
export function setBackdrop(theme: Theme): void {
  light.bottom.value.setRGB(...theme.bottom);
  light.top.value.setRGB(...theme.top);
  light.ambient.value = theme.ambient;
  light.wider.value = theme.pool;
}
