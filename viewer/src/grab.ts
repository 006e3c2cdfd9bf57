// Grab: what lies under the cursor is drawn to it by a spring, on the plane through the particle that is parallel to the picture.

import * as THREE from "three";
import type { Camera } from "./camera";
import type { Connection } from "./connection";
import type { Frame } from "./frame";
import { ring } from "./ring";
import type { Places } from "./scene/places";

const NEAR = 12; // from the cursor [pixels]; for a finger
const FINGER = 28;
const MOST_HOVERED = 300_000; // particles, beyond which only a press looks for the nearest

export class Grab {
  enabled = false;
  readonly mark = new THREE.Group(); // a ring around who would be, or is, held, and a thread to where it is drawn
  private readonly ring: THREE.Sprite;
  private readonly thread: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  private readonly pointer = new THREE.Vector2();
  private readonly plane = new THREE.Plane();
  private readonly target = new THREE.Vector3();
  private held: number | null = null; // the pointer that holds
  private hovering = false;
  private moved = false;
  private frame: Frame | null = null;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: Camera,
    private readonly places: Places,
    private readonly connection: Connection,
  ) {
    this.ring = ring(0xffb454, 10);
    this.thread = new THREE.Line(
      new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3)),
      new THREE.LineBasicMaterial({ color: 0xffb454, depthTest: false, transparent: true }),
    );
    this.thread.frustumCulled = false;
    this.thread.renderOrder = 10;
    this.mark.add(this.ring, this.thread);
    this.thread.visible = false;
    // Before the orbit controls hear of it, which else would turn the camera, too.
    canvas.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    for (const name of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(name, (event) => this.release(event), { capture: true });
    }
    canvas.addEventListener("pointerleave", () => (this.hovering = false));
  }

  /** Once for each picture, with the newest frame. */
  update(frame: Frame | null): void {
    this.frame = frame;
    if (this.held !== null && this.moved) {
      this.moved = false;
      if (this.follow()) this.connection.send({ kind: "drag", target: this.target.toArray() });
    }
    const row = frame?.head.held ?? -1;
    if (row >= 0 && row < this.places.count) {
      this.places.at(row, this.ring.position);
      const ends = this.thread.geometry.getAttribute("position") as THREE.BufferAttribute;
      ends.setXYZ(0, ...this.ring.position.toArray());
      ends.setXYZ(1, ...frame!.head.target);
      ends.needsUpdate = true;
      this.ring.visible = this.thread.visible = true;
    } else {
      this.thread.visible = false;
      const near = this.held === null && this.hovering && this.enabled && this.places.count <= MOST_HOVERED ? this.nearest(NEAR) : -1;
      this.ring.visible = near >= 0;
      if (near >= 0) this.places.at(near, this.ring.position);
    }
    this.canvas.style.cursor = this.held !== null ? "grabbing" : this.ring.visible ? "grab" : "";
    this.ring.scale.setScalar(this.camera.pixels(26));
  }

  /** Row of the particle under the cursor, or -1. */
  hovered(): number {
    return this.enabled && this.places.count ? this.nearest(NEAR) : -1;
  }

  /** Row of the particle under a pointer, -1 if there is none. */
  under(event: PointerEvent): number {
    this.camera.toPicture(event, this.pointer);
    return this.nearest(event.pointerType === "mouse" ? NEAR : FINGER);
  }

  /** From the eye through the cursor. */
  sight(): THREE.Ray {
    return this.camera.sight(this.pointer);
  }

  private press(event: PointerEvent): void {
    if (!this.enabled || this.held !== null || event.button !== 0 || event.shiftKey || !this.frame) return;
    const row = this.under(event);
    if (row < 0) return;
    event.stopImmediatePropagation();
    this.canvas.setPointerCapture(event.pointerId);
    this.held = event.pointerId;
    const normal = this.camera.eye.getWorldDirection(new THREE.Vector3());
    this.plane.setFromNormalAndCoplanarPoint(normal, this.places.at(row, new THREE.Vector3()));
    this.follow();
    this.connection.send({ kind: "grab", sequence: this.frame.sequence, row, target: this.target.toArray() });
  }

  private move(event: PointerEvent): void {
    this.camera.toPicture(event, this.pointer);
    this.hovering = event.pointerType === "mouse" && event.buttons === 0;
    if (event.pointerId !== this.held) return;
    event.stopImmediatePropagation();
    this.moved = true;
  }

  private release(event: PointerEvent): void {
    if (event.pointerId !== this.held) return;
    event.stopImmediatePropagation();
    this.held = null;
    this.connection.send({ kind: "release" });
  }

  /** Where the cursor is on the plane; false if it points away from it. */
  private follow(): boolean {
    return this.sight().intersectPlane(this.plane, this.target) !== null;
  }

  /** Row of the particle under the cursor, -1 if there is none within so many pixels: of several the one in front. */
  private nearest(reach: number): number {
    const { data, count, uniforms } = this.places;
    const low = uniforms.low.value, size = uniforms.extent.value;
    const toPicture = new THREE.Matrix4().multiplyMatrices(this.camera.eye.projectionMatrix, this.camera.eye.matrixWorldInverse);
    toPicture.multiply(new THREE.Matrix4().makeTranslation(low)).multiply(new THREE.Matrix4().makeScale(size.x / 65535, size.y / 65535, size.z / 65535));
    const m = toPicture.elements;
    const wide = this.canvas.clientWidth / 2, high = this.canvas.clientHeight / 2;
    let best = -1, least = Infinity;
    for (let k = 0, i = 0; k < count; k++, i += 4) {
      const x = data[i], y = data[i + 1], z = data[i + 2];
      const w = m[3] * x + m[7] * y + m[11] * z + m[15];
      if (w <= 0) continue;
      const dx = ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w - this.pointer.x) * wide;
      const dy = ((m[1] * x + m[5] * y + m[9] * z + m[13]) / w - this.pointer.y) * high;
      const far = Math.hypot(dx, dy);
      if (far > reach) continue;
      const score = w * (1 + (0.2 * far) / reach);
      if (score < least) {
        least = score;
        best = k;
      }
    }
    return best;
  }
}
