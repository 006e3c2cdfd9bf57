// From the scene to the screen, as the offline renderer does it (render/kernels_post.py): light of any strength is drawn, what is
// brighter than white spills around, and a tone map keeps its hue.

import * as THREE from "three";
import { light, Shadow } from "./light";

const LEVELS = 6; // of the spill, each twice as wide as the last
const SAMPLES = 4;
const SHARPEST = 2; // pixels of the screen for one of the page, at most

const VERTEX = /* glsl */ `void main() { gl_Position = vec4(position.xy, 1.0, 1.0); }`;

const BACKDROP = /* glsl */ `
uniform vec3 bottom, top;
uniform vec2 resolution;
out highp vec4 result;
void main() { result = vec4(mix(bottom, top, gl_FragCoord.y / resolution.y), 1.0); }
`;

const SPILL = /* glsl */ `
uniform sampler2D source;
uniform vec2 halved;
out highp vec4 result;
void main() { result = vec4(min(max(texture(source, gl_FragCoord.xy / halved).rgb - 1.0, 0.0), 24.0), 1.0); }
`;

const DEVELOP = /* glsl */ `
uniform sampler2D source, spill;
uniform vec2 resolution;
uniform float strength;
out highp vec4 result;
float roll(float x) { return x <= 0.6 ? x : 1.0 - 0.4 * exp((0.6 - x) / 0.4); }
// Smooth between the cells of a coarse level: weights 1 2 1 along both axes.
vec3 blurred(vec2 at, float level) {
  vec2 cell = exp2(level) * 2.0 / resolution;
  vec3 sum = vec3(0.0);
  for (int j = -1; j <= 1; j++)
    for (int i = -1; i <= 1; i++)
      sum += float((2 - abs(i)) * (2 - abs(j))) * textureLod(spill, at + 0.9 * vec2(float(i), float(j)) * cell, level).rgb;
  return sum / 16.0;
}
void main() {
  vec2 at = gl_FragCoord.xy / resolution;
  vec3 color = texture(source, at).rgb;
  float weight = 0.3;
  for (int level = 0; level < ${LEVELS}; level++) {
    color += strength * weight * blurred(at, float(level));
    weight *= 0.7;
  }
  float brightest = max(color.r, max(color.g, color.b));
  if (brightest > 0.6) color = 0.5 * roll(brightest) / brightest * color + 0.5 * vec3(roll(color.r), roll(color.g), roll(color.b));
  vec3 low = 12.92 * color, high = 1.055 * pow(max(color, 0.0), vec3(1.0 / 2.4)) - 0.055;
  color = mix(low, high, step(0.0031308, color));
  float grain = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  result = vec4(color + (grain - 0.5) / 255.0, 1.0);
}
`;

export class Picture {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  private readonly shadow: Shadow;
  private readonly sharp: THREE.WebGLRenderTarget;
  private readonly spill: THREE.WebGLRenderTarget;
  private readonly passes = new THREE.Scene();
  private readonly sheet: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  private readonly flat = new THREE.Camera();
  private readonly spilling: THREE.ShaderMaterial;
  private readonly developing: THREE.ShaderMaterial;

  constructor(canvas: HTMLCanvasElement) {
    const plain = new URLSearchParams(location.search).has("noaa"); // for graphics without hardware
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.renderer.autoClear = false;
    this.renderer.setPixelRatio(plain ? 1 : Math.min(devicePixelRatio, SHARPEST));
    this.shadow = new Shadow(plain ? 512 : 2048);
    if (plain) light.softness.value = 0;
    const half = { type: THREE.HalfFloatType, colorSpace: THREE.NoColorSpace };
    this.sharp = new THREE.WebGLRenderTarget(1, 1, { ...half, samples: plain ? 0 : SAMPLES });
    this.spill = new THREE.WebGLRenderTarget(1, 1, {
      ...half,
      depthBuffer: false,
      generateMipmaps: true,
      minFilter: THREE.LinearMipmapLinearFilter,
    });
    const pass = (fragmentShader: string, uniforms: Record<string, THREE.IUniform>) =>
      new THREE.ShaderMaterial({
        glslVersion: THREE.GLSL3,
        vertexShader: VERTEX,
        fragmentShader,
        uniforms,
        depthTest: false,
        depthWrite: false,
      });
    this.spilling = pass(SPILL, { source: { value: this.sharp.texture }, halved: { value: new THREE.Vector2() } });
    this.developing = pass(DEVELOP, {
      source: { value: this.sharp.texture },
      spill: { value: this.spill.texture },
      resolution: light.resolution,
      strength: { value: 0.6 },
    });
    const triangle = new THREE.BufferGeometry();
    triangle.setAttribute("position", new THREE.BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    this.sheet = new THREE.Mesh(triangle, this.spilling);
    this.sheet.frustumCulled = false;
    this.passes.add(this.sheet);
    const backdrop = new THREE.Mesh(triangle, pass(BACKDROP, light));
    backdrop.frustumCulled = false;
    backdrop.renderOrder = -1;
    this.scene.add(backdrop);
  }

  resize(): void {
    const { clientWidth, clientHeight } = this.renderer.domElement;
    this.renderer.setSize(clientWidth, clientHeight, false);
    const size = this.renderer.getDrawingBufferSize(light.resolution.value);
    this.sharp.setSize(size.x, size.y);
    this.spill.setSize(Math.ceil(size.x / 2), Math.ceil(size.y / 2));
    this.spilling.uniforms.halved.value.set(this.spill.width, this.spill.height);
  }

  draw(camera: THREE.PerspectiveCamera, middle: THREE.Vector3): void {
    const renderer = this.renderer;
    this.shadow.draw(renderer, this.scene, camera, middle);
    renderer.setRenderTarget(this.sharp);
    renderer.clear();
    renderer.render(this.scene, camera);
    this.pass(this.spilling, this.spill);
    this.pass(this.developing, null);
  }

  private pass(material: THREE.ShaderMaterial, target: THREE.WebGLRenderTarget | null): void {
    this.sheet.material = material;
    this.renderer.setRenderTarget(target);
    this.renderer.render(this.passes, this.flat);
  }
}
