// The web socket: messages both ways, and of the frames that have come the newest one alone.

import { Frame } from "./frame";
import type { Inbound, Outbound } from "./messages";

const AGAIN = 1000; // after a lost connection [ms]

export class Connection {
  onMessage: (message: Outbound) => void = () => {};
  onState: (open: boolean) => void = () => {};
  received = 0; // frames
  private socket: WebSocket | null = null;
  private waiting: Frame[] = [];

  open(): void {
    const token = new URLSearchParams(location.search).get("token") ?? "";
    const address = new URL(`frames?token=${encodeURIComponent(token)}`, location.href); // a proxy may hand on a path
    address.protocol = address.protocol.replace("http", "ws");
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.onState(true);
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.onMessage(JSON.parse(data));
      else this.waiting.push(new Frame(data));
    };
    socket.onclose = () => {
      this.waiting = [];
      this.onState(false);
      setTimeout(() => this.open(), AGAIN);
    };
    this.socket = socket;
  }

  send(message: Inbound): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** The frames that came since the last call, oldest first; whoever takes them acknowledges each. */
  take(): Frame[] {
    const frames = this.waiting;
    this.waiting = [];
    this.received += frames.length;
    return frames;
  }

  acknowledge(frames: Frame[]): void {
    for (const frame of frames) this.send({ kind: "ack", sequence: frame.sequence });
  }
}
