// The gallery: pictures of richer scenes than the scenarios.

import { request } from "../net/api.js";
import { byId } from "../panels/dom.js";
import { DEMOS } from "./demos.js";

const SCENES = {
  "water-wheel": "Water wheel",
  "wave-maker": "Wave maker",
  hourglass: "Hourglass",
  "dam-and-gate": "Dam and gate",
  "sand-and-water": "Sand and water",
  jelly: "Jelly afloat",
  letters: "Letters",
  "dam-in-space": "Dam in space",
};
const LEVELS = { "dam-in-space": "1/16" }; // scenes with too many particles to simulate all of them

let parts = null; // {open, show, toast}, from openGallery

async function choose(name) {
  byId("gallery").close();
  try {
    const scene = await request("GET", `gallery/${name}.json`);
    parts.open(name in LEVELS ? { scene, coarse: LEVELS[name] } : { scene });
  } catch (problem) {
    parts.toast(problem);
  }
}

function itemOf(name, title, chosen) {
  const button = document.createElement("button");
  button.type = "button";
  const picture = document.createElement("img");
  picture.src = `gallery/${name}.png`;
  picture.alt = "";
  const caption = document.createElement("span");
  caption.textContent = title;
  button.append(picture, caption);
  button.addEventListener("click", chosen);
  return button;
}

function itemOfDemo([name, { title, preset }]) {
  return itemOf(name, title, () => {
    byId("gallery").close();
    parts.show(preset);
  });
}

/** Show the gallery; `given` is {open(body of POST /v1/sessions), show(preset as in presets.js), toast(problem)}. */
export function openGallery(given) {
  if (parts === null) {
    parts = given;
    const scenes = Object.entries(SCENES).map(([name, title]) => itemOf(name, title, () => choose(name)));
    byId("gallery-list").replaceChildren(...scenes);
    byId("gallery-demos").replaceChildren(...Object.entries(DEMOS).map(itemOfDemo));
    byId("gallery-close").addEventListener("click", () => byId("gallery").close());
  }
  byId("gallery").showModal();
}
