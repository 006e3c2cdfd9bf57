// Rings around particles, of one size in the picture from near and far.

import * as THREE from "three";

export function ring(color: number, order: number): THREE.Sprite {
  const material = new THREE.SpriteMaterial({ map: ringTexture(), color, depthTest: false, sizeAttenuation: false, transparent: true });
  const made = new THREE.Sprite(material);
  made.renderOrder = order;
  made.visible = false;
  return made;
}

/** A ring, with a dot in it or without. */
export function ringTexture(dotted = false): THREE.Texture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const pen = canvas.getContext("2d")!;
  pen.strokeStyle = "white";
  pen.lineWidth = 5;
  pen.beginPath();
  pen.arc(32, 32, 26, 0, 2 * Math.PI);
  pen.stroke();
  if (dotted) {
    pen.fillStyle = "white";
    pen.beginPath();
    pen.arc(32, 32, 9, 0, 2 * Math.PI);
    pen.fill();
  }
  return new THREE.CanvasTexture(canvas);
}
