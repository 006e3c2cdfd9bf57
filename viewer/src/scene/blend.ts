// How materials meet what is behind them.

import * as THREE from "three";

/** Solid, with its edges smoothed by the samples of each pixel. */
export const SOLID = { transparent: false, depthWrite: true, alphaToCoverage: true } as const;

/** Light that adds up. */
export const GLOW = {
  transparent: true,
  depthWrite: false,
  blending: THREE.CustomBlending,
  blendSrc: THREE.OneFactor,
  blendDst: THREE.OneFactor,
} as const;

/** Laid over, with colours that are multiplied by their alpha already. */
export const OVER = {
  transparent: true,
  depthWrite: false,
  blending: THREE.CustomBlending,
  blendSrc: THREE.OneFactor,
  blendDst: THREE.OneMinusSrcAlphaFactor,
} as const;
