// A frame as it came over the wire: its head, and views of the arrays in its body.

import { FRAME, type Block, type FrameHead } from "./messages";

export type Numbers = Int8Array | Uint8Array | Uint16Array | Uint32Array | Float32Array;

const KINDS = { i8: Int8Array, u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array };

export class Frame {
  readonly sequence: number;
  readonly head: FrameHead;
  private readonly body: number;

  constructor(private readonly data: ArrayBuffer) {
    const [kind, sequence, length] = new Uint32Array(data, 0, 3);
    if (kind !== FRAME) throw new Error(`a binary message of kind ${kind}`);
    this.sequence = sequence;
    this.head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 12, length)));
    this.body = 12 + length;
  }

  /** An array of the body, without a copy. */
  view(block: Block): Numbers {
    return new KINDS[block.type](this.data, this.body + block.offset, block.count);
  }
}
