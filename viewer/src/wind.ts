// The wind's direction: an arrow in the picture, turned by its tip.

import * as THREE from "three";
import type { Camera } from "./camera";
import type { Connection } from "./connection";
import type { Vector, Welcome } from "./messages";

const AT = new THREE.Vector2(-0.72, 0.4); // where it stands in the picture, from -1 to 1
const LENGTH = 0.07, TIP = 0.012; // by the distance of the camera
const REACH = 18; // from the tip [pixels]
const TURN = Math.PI / 12; // of a key [rad]
const COLOR = 0x8fd3c8;

export class Wind {
  readonly mark = new THREE.Group();
  private readonly arrow = new THREE.ArrowHelper(new THREE.Vector3(1, 0, 0), new THREE.Vector3(), 1, COLOR);
  private readonly tip = new THREE.Mesh(new THREE.SphereGeometry(1, 16, 12), new THREE.MeshBasicMaterial({ color: COLOR, depthTest: false }));
  private readonly direction = new THREE.Vector3(1, 0, 0);
  private readonly pointer = new THREE.Vector2();
  private held: number | null = null; // the pointer that holds the tip
  private turned = false;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: Camera,
    private readonly connection: Connection,
  ) {
    for (const line of [this.arrow.line, this.arrow.cone]) {
      (line.material as THREE.Material).depthTest = false;
      line.renderOrder = 11;
      line.frustumCulled = false;
    }
    this.tip.renderOrder = 12;
    this.mark.add(this.arrow, this.tip);
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
    if (wind && this.held === null) this.direction.set(...wind).normalize();
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
    const far = this.camera.distance, base = this.base();
    this.arrow.position.copy(base);
    this.arrow.setDirection(this.direction);
    this.arrow.setLength(LENGTH * far, 0.35 * LENGTH * far, 0.2 * LENGTH * far);
    this.tip.position.copy(base).addScaledVector(this.direction, LENGTH * far);
    this.tip.scale.setScalar(TIP * far);
  }

  private press(event: PointerEvent): void {
    if (!this.mark.visible || event.button !== 0) return;
    this.camera.toPicture(event, this.pointer);
    const at = this.tip.position.clone().project(this.camera.eye);
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
    const ray = this.camera.sight(this.pointer), base = this.base(), length = LENGTH * this.camera.distance;
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

  private base(): THREE.Vector3 {
    return this.camera.sight(AT).at(this.camera.distance, new THREE.Vector3());
  }
}
