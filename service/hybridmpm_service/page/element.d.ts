// Types of element.js.

import type * as api from "./api.js";

export interface ViewEvents {
  /** The new state. */
  state: CustomEvent<HybridmpmView["state"]>;
  /** The newest description of the session, four times a second and with every change. */
  status: CustomEvent<api.SessionBody>;
  /** A frame that is shown. */
  frame: CustomEvent<{ number: number; time: number }>;
  /** What went wrong. */
  problem: CustomEvent<{ title: string; detail: string; status: number; type: string }>;
}

/**
 * A simulation of a service, with stage and tools: `<hybridmpm-view gallery="hourglass">`. Attributes: `service` (address; that of
 * this module if absent), what is shown as in the page's addresses (`scenario`, `seed`, `solver`, `coarse`, `gallery`, `demo`,
 * `session`, `watch`), `scene` (JSON), `link` (token of a link, with `watch`), `controls="off"`, `colour`, `theme`, `simulate="server"`.
 */
export class HybridmpmView extends HTMLElement {
  /** Token of a key, for a service with keys. */
  key: string | null;
  readonly service: URL;
  scene: Record<string, unknown> | null;
  readonly state: "connecting" | "live" | "reconnecting" | "lost" | "failed";
  readonly status: api.SessionBody | null;
  /** Send a command of the stream; false while the frame is not there. */
  send(command: { type: string } & Record<string, unknown>): boolean;
  play(): boolean;
  pause(): boolean;
  step(frames?: number): boolean;
  reset(): boolean;
  /** @param value simulated seconds per second, 0.01 to 1 */
  speed(value: number): boolean;
  push(hand: api.Hand): boolean;
  pull(grip: api.Grip): boolean;
  letGo(): boolean;
  addEventListener<K extends keyof ViewEvents>(type: K, listener: (event: ViewEvents[K]) => void, options?: AddEventListenerOptions | boolean): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject | null, options?: AddEventListenerOptions | boolean): void;
}

declare global {
  interface HTMLElementTagNameMap {
    "hybridmpm-view": HybridmpmView;
  }
}
