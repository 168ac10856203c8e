// The gallery: scenes with more in them than the scenarios have, as pictures to choose from.

import { request } from "../net/api.js";
import { byId } from "../panels/dom.js";

const SCENES = {
  "water-wheel": "Water wheel",
  "wave-maker": "Wave maker",
  hourglass: "Hourglass",
  "dam-and-gate": "Dam and gate",
  "sand-and-water": "Sand and water",
  jelly: "Jelly afloat",
  "dam-in-space": "Dam in space",
};
const RUNGS = { "dam-in-space": "1/16" }; // where so many particles need few that carry them

let parts = null; // {open, toast}, from openGallery

async function choose(name) {
  byId("gallery").close();
  try {
    const scene = await request("GET", `gallery/${name}.json`);
    parts.open(name in RUNGS ? { scene, rung: RUNGS[name] } : { scene });
  } catch (problem) {
    parts.toast(problem);
  }
}

function itemOf([name, title]) {
  const button = document.createElement("button");
  button.type = "button";
  const picture = document.createElement("img");
  picture.src = `gallery/${name}.png`;
  picture.alt = "";
  const caption = document.createElement("span");
  caption.textContent = title;
  button.append(picture, caption);
  button.addEventListener("click", () => choose(name));
  return button;
}

/** Show the gallery; `given` is {open(body of POST /v1/sessions), toast(problem)}. */
export function openGallery(given) {
  if (parts === null) {
    parts = given;
    byId("gallery-list").replaceChildren(...Object.entries(SCENES).map(itemOf));
    byId("gallery-close").addEventListener("click", () => byId("gallery").close());
  }
  byId("gallery").showModal();
}
