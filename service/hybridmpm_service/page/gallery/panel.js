// The gallery: pictures of richer scenes than the scenarios.

import { Problem } from "../client.js";
import { client } from "../net/api.js";
import { byId } from "../panels/dom.js";

let parts = null; // {open, show, toast}, from openGallery

const entriesKnown = () => client.json("GET", "gallery/entries.json");

/** What the gallery says of a scene or a lesson; a lesson has what is measured. Throws Problem where there is none. */
export async function aboutOf(name) {
  const { lessons, scenes } = await entriesKnown();
  const found = [lessons, scenes].find((entries) => Object.hasOwn(entries, name));
  if (found === undefined) throw new Problem("Not in the gallery", "", 404);
  return found[name];
}

/** A scene of the gallery by its name, {scene, coarse}; the level may be absent. Throws Problem where there is none. */
export async function exhibit(name) {
  const { coarse } = await aboutOf(name);
  return { scene: await client.json("GET", `gallery/${name}.json`), coarse };
}

/** What plays a demonstration of the gallery, as in presets.js. Throws Problem where there is none of this name. */
export async function demonstration(name) {
  const entries = await entriesKnown();
  if (!Object.hasOwn(entries.demos, name)) throw new Problem("Not in the gallery", "", 404);
  return presetOf(entries.demos[name], entries);
}

/** Show a scene of the gallery; `given` is {open(body, place), toast(problem)} as for openGallery. */
export async function openExhibit(name, given) {
  try {
    const { scene, coarse } = await exhibit(name);
    const level = coarse === undefined ? {} : { coarse };
    given.open({ scene, ...level }, { gallery: name, ...level });
  } catch (problem) {
    given.toast(problem);
  }
}

function itemOf(name, { title, about }, chosen) {
  const button = document.createElement("button");
  button.type = "button";
  button.title = about;
  const picture = document.createElement("img");
  picture.src = new URL(`./${name}.png`, import.meta.url); // an address that browsers keep
  picture.alt = "";
  const caption = document.createElement("span");
  caption.textContent = title;
  button.append(picture, caption);
  button.addEventListener("click", chosen);
  return button;
}

/** What plays a demonstration, as in presets.js. */
function presetOf({ scenario, sketch }, { sketches, played: { seed, frame, hold, method } }) {
  return {
    scene: { scenario, seed, solver: "mpm", coarse: null },
    frame,
    sketch: sketches[sketch],
    settings: { hold, method },
    seconds: 1,
    repeats: false,
  };
}

async function fill() {
  const entries = await entriesKnown();
  const items = (section) =>
    Object.entries(section).map(([name, scene]) =>
      itemOf(name, scene, () => {
        byId("gallery").close();
        openExhibit(name, parts);
      }),
    );
  const demos = Object.entries(entries.demos).map(([name, demo]) =>
    itemOf(name, demo, () => {
      byId("gallery").close();
      parts.show(presetOf(demo, entries), name);
    }),
  );
  byId("gallery-lessons").replaceChildren(...items(entries.lessons));
  byId("gallery-list").replaceChildren(...items(entries.scenes));
  byId("gallery-demos").replaceChildren(...demos);
}

/** Show the gallery; `given` is {open(body of POST /v1/sessions, place), show(preset as in presets.js, its name),
 * toast(problem)}. */
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
