// Positions on the graphics card: a texture of four u16 for each place, from which all vertex shaders read by row.

import * as THREE from "three";
import type { Frame, Numbers } from "../frame";
import type { Block, Places as Message } from "../messages";

const WIDTH = 2048; // places in a row of the texture

/** For vertex shaders: `place(row)` in metres. */
export const PLACE = /* glsl */ `
uniform highp usampler2D places;
uniform vec3 low, extent;
ivec2 cell(uint row) { return ivec2(int(row % ${WIDTH}u), int(row / ${WIDTH}u)); }
vec3 place(uint row) { return low + extent * vec3(texelFetch(places, cell(row), 0).xyz) / 65535.0; }
`;

/** For vertex shaders, after PLACE: `normal(row)`. */
export const NORMAL = /* glsl */ `
uniform highp isampler2D normals;
vec3 bent(uint row) { return vec3(texelFetch(normals, cell(row), 0).xyz) / 127.0; }
`;

class Table {
  readonly uniform: { value: THREE.DataTexture };
  private rows = 0;

  constructor(private readonly signed: boolean) {
    this.uniform = { value: this.made(1) };
  }

  set(data: Numbers): void {
    const rows = Math.max(1, Math.ceil(data.length / 4 / WIDTH));
    if (rows > this.rows) {
      this.uniform.value.dispose();
      this.uniform.value = this.made(rows + (rows >> 2));
    }
    (this.uniform.value.image.data as unknown as Uint16Array).set(data);
    this.uniform.value.needsUpdate = true;
  }

  private made(rows: number): THREE.DataTexture {
    this.rows = rows;
    const array = this.signed ? new Int8Array(4 * WIDTH * rows) : new Uint16Array(4 * WIDTH * rows);
    const type = this.signed ? THREE.ByteType : THREE.UnsignedShortType;
    const texture = new THREE.DataTexture(array, WIDTH, rows, THREE.RGBAIntegerFormat, type);
    texture.internalFormat = this.signed ? "RGBA8I" : "RGBA16UI";
    texture.unpackAlignment = 1;
    texture.needsUpdate = true;
    return texture;
  }
}

export class Places {
  private readonly table = new Table(false);
  readonly uniforms = { places: this.table.uniform, low: { value: new THREE.Vector3() }, extent: { value: new THREE.Vector3() } };
  data: Numbers = new Uint16Array(0);

  set(message: Message, frame: Frame): void {
    this.data = frame.view(message.data);
    this.table.set(this.data);
    this.uniforms.low.value.set(...message.low);
    this.uniforms.extent.value.set(...message.size);
  }

  get count(): number {
    return this.data.length / 4;
  }

  /** A place in metres. */
  at(row: number, out: THREE.Vector3): THREE.Vector3 {
    const { low, extent } = this.uniforms;
    out.set(this.data[4 * row], this.data[4 * row + 1], this.data[4 * row + 2]).multiplyScalar(1 / 65535);
    return out.multiply(extent.value).add(low.value);
  }
}

export class Normals {
  private readonly table = new Table(true);
  readonly uniforms = { normals: this.table.uniform };

  set(block: Block, frame: Frame): void {
    this.table.set(frame.view(block));
  }
}
