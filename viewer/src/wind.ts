// The wind's direction: an arrow in the picture, turned by its tip.

import * as THREE from "three";
import type { Camera } from "./camera";
import type { Connection } from "./connection";
import type { Vector, Welcome } from "./messages";
import type { Theme } from "./theme";

const UP = new THREE.Vector3(0, 1, 0);
const AT = new THREE.Vector2(-0.72, 0.4); // where it stands in the picture, from -1 to 1
const LENGTH = 60, HEAD = 20, WIDTH = 16, SHAFT = 3; // [pixels]
const ROOM = 72; // at its left, at least [pixels]
const REACH = 22; // from the tip [pixels]
const TURN = Math.PI / 12; // of a key [rad]

export class Wind {
  readonly mark = new THREE.Group();
  private readonly paint = new THREE.MeshBasicMaterial({ depthTest: false });
  private readonly tip = new THREE.Vector3();
  private readonly direction = new THREE.Vector3(1, 0, 0);
  private readonly pointer = new THREE.Vector2();
  private held: number | null = null; // the pointer that holds the tip
  private turned = false;

  constructor(
    private readonly label: HTMLElement,
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: Camera,
    private readonly connection: Connection,
  ) {
    const neck = LENGTH - HEAD; // along y, as these shapes are made
    const shaft = new THREE.CylinderGeometry(SHAFT / 2, SHAFT / 2, neck).translate(0, neck / 2, 0);
    const head = new THREE.ConeGeometry(WIDTH / 2, HEAD, 24).translate(0, neck + HEAD / 2, 0);
    for (const shape of [shaft, head]) {
      const part = new THREE.Mesh(shape, this.paint);
      part.renderOrder = 11;
      part.frustumCulled = false;
      this.mark.add(part);
    }
    this.mark.visible = false;
    canvas.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    for (const name of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(name, (event) => event.pointerId === this.held && (this.held = null), { capture: true });
    }
  }

  get blows(): boolean {
    return this.mark.visible;
  }

  show({ wind }: Welcome): void {
    this.mark.visible = wind !== null;
    this.label.hidden = wind === null;
    if (wind && this.held === null) this.direction.set(...wind).normalize();
  }

  dress(theme: Theme): void {
    this.paint.color.set(theme.name === "dark" ? 0x8fd3c8 : 0x17695d);
  }

  /** By a key: about what is up in the picture's world. */
  turn(): void {
    this.direction.applyAxisAngle(this.camera.eye.up, TURN);
    this.turned = true;
  }

  /** Once for each picture. */
  update(): void {
    if (!this.mark.visible) return;
    if (this.turned) this.connection.send({ kind: "wind", direction: this.direction.toArray() as Vector });
    this.turned = false;
    const size = this.pixel;
    this.mark.position.copy(this.base());
    this.mark.quaternion.setFromUnitVectors(UP, this.direction);
    this.mark.scale.setScalar(size);
    this.tip.copy(this.mark.position).addScaledVector(this.direction, LENGTH * size);
  }

  private press(event: PointerEvent): void {
    if (!this.mark.visible || event.button !== 0) return;
    this.camera.toPicture(event, this.pointer);
    const at = this.tip.clone().project(this.camera.eye);
    const near = Math.hypot((at.x - this.pointer.x) * this.canvas.clientWidth, (at.y - this.pointer.y) * this.canvas.clientHeight) / 2;
    if (near > REACH) return;
    event.stopImmediatePropagation();
    this.canvas.setPointerCapture(event.pointerId);
    this.held = event.pointerId;
  }

  private move(event: PointerEvent): void {
    if (event.pointerId !== this.held) return;
    event.stopImmediatePropagation();
    this.camera.toPicture(event, this.pointer);
    const ray = this.camera.sight(this.pointer), base = this.base(), length = LENGTH * this.pixel;
    // On the sphere around the base: on the half of it where the tip is, or on its edge.
    const nearest = ray.closestPointToPoint(base, new THREE.Vector3());
    const aside = nearest.distanceTo(base);
    if (aside < length) {
      const behind = this.direction.dot(ray.direction) > 0 ? 1 : -1;
      nearest.addScaledVector(ray.direction, behind * Math.sqrt(length * length - aside * aside));
    }
    this.direction.copy(nearest.sub(base).normalize());
    this.turned = true;
  }

  /** At the arrow's distance [m]. */
  private get pixel(): number {
    return this.camera.pixels(1) * this.camera.distance;
  }

  private base(): THREE.Vector3 {
    const at = AT.clone().setX(Math.max(AT.x, (2 * ROOM) / this.canvas.clientWidth - 1));
    return this.camera.sight(at).at(this.camera.distance, new THREE.Vector3());
  }
}
