// The gallery: pictures of richer scenes than the scenarios.

import { request } from "../net/api.js";
import { byId } from "../panels/dom.js";

let parts = null; // {open, show, toast}, from openGallery

async function choose(name, coarse) {
  byId("gallery").close();
  try {
    const scene = await request("GET", `gallery/${name}.json`);
    parts.open(coarse === undefined ? { scene } : { scene, coarse });
  } catch (problem) {
    parts.toast(problem);
  }
}

function itemOf(name, { title, about }, chosen) {
  const button = document.createElement("button");
  button.type = "button";
  button.title = about;
  const picture = document.createElement("img");
  picture.src = `gallery/${name}.png`;
  picture.alt = "";
  const caption = document.createElement("span");
  caption.textContent = title;
  button.append(picture, caption);
  button.addEventListener("click", chosen);
  return button;
}

/** What plays a demonstration, as in presets.js. */
function presetOf({ scenario, sketch }, { sketches, played: { seed, frame, hold } }) {
  return {
    scene: { scenario, seed, solver: "mpm", coarse: null },
    frame,
    sketch: sketches[sketch],
    settings: { hold },
    seconds: 1,
    repeats: false,
  };
}

async function fill() {
  const entries = await request("GET", "gallery/entries.json");
  const scenes = Object.entries(entries.scenes).map(([name, scene]) =>
    itemOf(name, scene, () => choose(name, scene.coarse)),
  );
  const demos = Object.entries(entries.demos).map(([name, demo]) =>
    itemOf(name, demo, () => {
      byId("gallery").close();
      parts.show(presetOf(demo, entries));
    }),
  );
  byId("gallery-list").replaceChildren(...scenes);
  byId("gallery-demos").replaceChildren(...demos);
}

/** Show the gallery; `given` is {open(body of POST /v1/sessions), show(preset as in presets.js), toast(problem)}. */
export async function openGallery(given) {
  if (parts === null) {
    parts = given;
    byId("gallery-close").addEventListener("click", () => byId("gallery").close());
  }
  byId("gallery").showModal();
  if (byId("gallery-list").childElementCount > 0) return;
  try {
    await fill();
  } catch (problem) {
    byId("gallery").close();
    parts.toast(problem);
  }
}
