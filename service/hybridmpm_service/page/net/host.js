// The page around this one, where the element of ../element.js shows it: it hears what happens, and commands.

export class Host {
  #port = null;
  #keys = []; // called with the key that the page around has
  #arrived;

  /** @param handlers {command(message), present() -> {state}: what is told first} */
  constructor({ command, present }) {
    this.#arrived = new Promise((resolve) => {
      window.addEventListener("message", ({ source, data, ports }) => {
        // The service's frame-ancestors admit no other parents than its front ends.
        if (source !== window.parent || data?.hybridmpm !== "element") return;
        [this.#port] = ports;
        this.#port.onmessage = ({ data: message }) => {
          if (message.type === "command") command(message.command);
          else if (message.type === "key") this.#keys.shift()?.(message.key);
        };
        this.tell("state", present().state);
        resolve();
      });
    });
    window.parent.postMessage({ hybridmpm: "frame" }, "*"); // says nothing but that it is there
  }

  /** Tell the page around what happens. */
  tell(type, detail) {
    this.#port?.postMessage({ type, detail });
  }

  /** The key that the page around has; null where it has none but the one that it gave before. */
  async key() {
    await this.#arrived;
    return new Promise((resolve) => {
      this.#keys.push(resolve);
      this.tell("key", null);
    });
  }
}
