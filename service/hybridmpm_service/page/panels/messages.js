// Messages about the connection and about problems: the state, the banner, notices in the corner.

import { byId, setText } from "./dom.js";

const TOAST_MS = 9000;
const HINT_MS = 5000; // advice is shorter, and goes with the next stroke

const CONNECTION = {
  connecting: "Connecting",
  live: "Live",
  reconnecting: "Reconnecting",
  lost: "Simulation ended",
  failed: "Not running",
};

/** Show the state of the connection; while there is none, the player's controls are off. A live one may be silent. */
export function showState(state, silent = false) {
  document.body.dataset.state = state;
  document.body.dataset.silent = String(silent);
  setText("connection", silent ? "No answer" : CONNECTION[state]);
  for (const id of ["play", "step", "reset", "speed"]) byId(id).disabled = state !== "live";
}

/** Cover the stage with a text until there is a picture. */
export function showSkeleton(text) {
  setText("skeleton-text", text);
  byId("skeleton").classList.remove("gone");
}

export function hideSkeleton() {
  byId("skeleton").classList.add("gone");
}

let bannerAction = null;

/** Show a line across the page with one action, {text, label, action}; null removes it. */
export function showBanner(banner) {
  byId("banner").hidden = banner === null;
  if (banner === null) return;
  setText("banner-text", banner.text);
  setText("banner-action", banner.label);
  bannerAction = banner.action;
}

byId("banner-action").addEventListener("click", () => bannerAction?.());

/** Show a message in the corner for a while. `hint` marks it as advice; any other is a problem. */
export function toast({ title, detail = "", advice = "", hint = false }) {
  const box = document.createElement("div");
  box.className = hint ? "toast hint" : "toast";
  const heading = document.createElement("strong");
  heading.textContent = title;
  const close = document.createElement("button");
  close.type = "button";
  close.className = "quiet";
  close.textContent = "Dismiss";
  close.addEventListener("click", () => box.remove());
  box.append(heading, close);
  for (const text of [detail, advice].filter((line) => line !== "")) {
    const line = document.createElement("p");
    line.textContent = text;
    box.append(line);
  }
  const toasts = byId("toasts");
  toasts.append(box);
  while (toasts.children.length > 3) toasts.firstElementChild.remove();
  setTimeout(() => box.remove(), hint ? HINT_MS : TOAST_MS);
}

/** Take away the advice that is shown: the visitor goes on. */
export function clearHints() {
  for (const box of byId("toasts").querySelectorAll(".hint")) box.remove();
}
