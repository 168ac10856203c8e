// Light or dark, and full screen. The page stores nothing: a choice of colours stays in the address.

import { byId } from "./dom.js";

const wantsLight = window.matchMedia("(prefers-color-scheme: light)");
const root = document.documentElement;

const present = () => root.dataset.theme ?? (wantsLight.matches ? "light" : "dark");

function chooseTheme(theme) {
  root.dataset.theme = theme;
  const address = new URL(window.location.href);
  address.searchParams.set("theme", theme);
  window.history.replaceState(null, "", address);
}

/** Take the colours that the address asks for, and let the user change them, and fill the screen. */
export function bindAppearance() {
  const asked = new URLSearchParams(window.location.search).get("theme");
  if (asked === "light" || asked === "dark") root.dataset.theme = asked;
  byId("theme").addEventListener("click", () => chooseTheme(present() === "light" ? "dark" : "light"));
  byId("fullscreen").hidden = !document.fullscreenEnabled;
  byId("fullscreen").addEventListener("click", () => {
    if (document.fullscreenElement) document.exitFullscreen();
    else root.requestFullscreen();
  });
}
