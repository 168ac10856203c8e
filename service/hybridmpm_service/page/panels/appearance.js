// Light or dark, full screen, and the colours of particles. A choice stays in the address.

import { QUANTITIES } from "../stage/quantities.js";
import { css, onScale } from "../stage/renderer/palette.js";
import { byId, setText } from "./dom.js";

const wantsLight = window.matchMedia("(prefers-color-scheme: light)");
const root = document.documentElement;

const present = () => root.dataset.theme ?? (wantsLight.matches ? "light" : "dark");

function keepInAddress(name, value) {
  const address = new URL(window.location.href);
  if (value === null) address.searchParams.delete(name);
  else address.searchParams.set(name, value);
  window.history.replaceState(window.history.state, "", address);
}

function chooseTheme(theme) {
  root.dataset.theme = theme;
  keepInAddress("theme", theme);
}

/** Show the scale of a quantity on the picture; none where particles have the look of their material. */
function showScale(quantity) {
  const scale = QUANTITIES[quantity];
  byId("scale").hidden = scale === undefined;
  if (scale === undefined) return;
  setText("scale-title", scale.title);
  showHighest(scale.most);
  const stops = [0, 0.25, 0.5, 0.75, 1].map((t) => css(onScale(t)));
  byId("scale-bar").style.background = `linear-gradient(to right, ${stops.join(", ")})`;
}

/** Show the value at the upper end of the scale; null where it is unknown. */
export function showHighest(most) {
  const scale = QUANTITIES[byId("quantity").value];
  if (scale !== undefined) setText("scale-high", `${most ?? "…"} ${scale.unit}`);
}

/** Offer the pressure, or not: only MPM computes it. */
export function offerPressure(known) {
  const option = byId("quantity").querySelector('[value="pressure"]');
  if (option.disabled === !known) return;
  option.disabled = !known;
  if (known || byId("quantity").value !== "pressure") return;
  byId("quantity").value = "material";
  byId("quantity").dispatchEvent(new Event("change"));
}

/** Call `colourBy(quantity)` with what the address asks for, and whenever the user chooses. */
export function bindColours(colourBy) {
  const select = byId("quantity");
  const choose = () => {
    showScale(select.value);
    colourBy(select.value);
  };
  const asked = new URLSearchParams(window.location.search).get("colour");
  if (asked !== null && Object.hasOwn(QUANTITIES, asked)) select.value = asked;
  select.addEventListener("change", () => {
    keepInAddress("colour", select.value in QUANTITIES ? select.value : null);
    choose();
  });
  choose();
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
