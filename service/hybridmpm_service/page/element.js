// <hybridmpm-view>: a simulation of a service in a page of one's own, with its stage, tools and events.
//
// It is a frame with the service's /embed, so that renderer, sketches and the solver in the tab are those of the service's page.
// The service has to name the origin of the page in cors_origins.

import { packed } from "./share/log-link.js";

/** Attributes that say what is shown; they have the names of the page's addresses. */
const PLACES = ["scenario", "seed", "solver", "coarse", "gallery", "demo", "session", "watch"];
const LOOKS = ["controls", "colour", "theme", "simulate"];
const look = new CSSStyleSheet();
look.replaceSync(":host { display: block; height: 34rem; } :host([hidden]) { display: none; } iframe { width: 100%; height: 100%; border: 0; }");

export class HybridmpmView extends HTMLElement {
  static observedAttributes = ["service", "scene", "link", ...PLACES, ...LOOKS];

  /** Token of a key, for a service with keys. It is given to the service's page alone, and never part of an address. */
  key = this.key ?? null; // it may have been set before this module was loaded
  #frame = document.createElement("iframe");
  #port = null;
  #scene = null;
  #gave = null; // the key that the frame has got
  #isDue = false;
  #state = "connecting";
  #status = null;
  #hear = (event) => this.#welcome(event);

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    root.adoptedStyleSheets = [look];
    if (Object.hasOwn(this, "scene")) {
      this.#scene = this.scene;
      delete this.scene;
    }
    this.#frame.allow = "fullscreen";
    root.append(this.#frame);
  }

  /** Address of the service: the one that has served this module, if absent. */
  get service() {
    const given = this.getAttribute("service") ?? new URL("./", import.meta.url).href;
    return new URL(given.replace(/\/*$/, "/"), document.baseURI);
  }

  /** A scene of one's own; null without one. */
  get scene() {
    return this.#scene ?? JSON.parse(this.getAttribute("scene"));
  }

  set scene(value) {
    this.#scene = value;
    this.#show();
  }

  /** "connecting", "live", "reconnecting", "lost" or "failed". */
  get state() {
    return this.#state;
  }

  /** The newest description of the session, as docs/reference/http-api.md has it; null before the first one. */
  get status() {
    return this.#status;
  }

  connectedCallback() {
    window.addEventListener("message", this.#hear);
    this.#show();
  }

  disconnectedCallback() {
    window.removeEventListener("message", this.#hear);
    this.#port?.close();
    this.#port = null;
  }

  attributeChangedCallback() {
    this.#show();
  }

  /** Load the frame once for all attributes that change together. */
  #show() {
    if (this.#isDue || !this.isConnected) return;
    this.#isDue = true;
    queueMicrotask(async () => {
      this.#isDue = false;
      this.#frame.title = this.title || "Simulation";
      this.#frame.src = await this.#address();
    });
  }

  async #address() {
    const address = new URL("embed?element=1", this.service);
    for (const name of [...PLACES, ...LOOKS]) {
      const value = this.getAttribute(name);
      if (value !== null) address.searchParams.set(name, name === "controls" && value === "off" ? "0" : value);
    }
    const [scene, link] = [this.scene, this.getAttribute("link")];
    if (scene !== null) address.hash = await packed("scene", { scene });
    else if (link !== null) address.hash = new URLSearchParams({ link });
    return address.href;
  }

  /** Answer the service's page in the frame, which says that it is there, with a channel. */
  #welcome({ source, origin, data }) {
    if (source !== this.#frame.contentWindow || origin !== this.service.origin || data?.hybridmpm !== "frame") return;
    const { port1, port2 } = new MessageChannel();
    this.#port?.close();
    this.#port = port1;
    this.#gave = null;
    port1.onmessage = ({ data: message }) => this.#receive(message);
    source.postMessage({ hybridmpm: "element" }, origin, [port2]);
  }

  #receive({ type, detail }) {
    if (type === "key") {
      const key = this.key === this.#gave ? null : this.key; // one that was refused is not tried again
      this.#gave = key;
      this.#port.postMessage({ type, key });
      return;
    }
    if (type === "state") this.#state = detail;
    if (type === "status") this.#status = detail;
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  /** Send a command of the stream, as docs/reference/http-api.md describes them; false while the frame is not there. */
  send(command) {
    this.#port?.postMessage({ type: "command", command });
    return this.#port !== null;
  }

  play() {
    return this.send({ type: "play" });
  }

  pause() {
    return this.send({ type: "pause" });
  }

  step(frames = 1) {
    return this.send({ type: "step", frames });
  }

  reset() {
    return this.send({ type: "reset" });
  }

  speed(value) {
    return this.send({ type: "speed", value });
  }

  push(hand) {
    return this.send({ type: "push", ...hand });
  }

  /** Pull at a rigid body; `letGo` ends it, too. */
  pull(grip) {
    return this.send({ type: "pull", ...grip });
  }

  letGo() {
    return this.send({ type: "push_end" });
  }
}

if (customElements.get("hybridmpm-view") === undefined) customElements.define("hybridmpm-view", HybridmpmView);
