// The address of what is shown. It names the scene, so that a link, a reload and the browser's Back lead to it again; the
// browser keeps the name of the running session beside it.

const SEED = /^\d{1,9}$/;
const SOLVERS = ["mpm", "hybrid", "neural"];
const LEVELS = ["1/4", "1/8", "1/16", "1/32", "1/64"];
/** Names in the query that say what is shown; all others say how. */
const NAMES = ["scenario", "seed", "solver", "coarse", "gallery", "demo", "preset", "session", "watch"];
const REPLAY = "#replay=";
const SCENE = "#scene=";

/**
 * What an address asks for, and what is wrong with it.
 *
 * @returns {place, faults}. The place has the fields of the query as strings, but `seed` as a number, and `replay` or
 *   `packed` where the part behind the # has a run or a scene. A fault is {title, detail, advice}; what it is about is left out.
 */
export function placeOf(address) {
  const place = {};
  const faults = [];
  for (const [name, value] of address.searchParams) {
    if (NAMES.includes(name)) place[name] = value;
  }
  const refuse = (name, title, allowed) => {
    faults.push({ title, detail: `${allowed}, not "${place[name].slice(0, 40)}".`, advice: "The usual one is used instead." });
    delete place[name];
  };
  if ("seed" in place && !SEED.test(place.seed)) {
    refuse("seed", "Invalid seed in the address", "A seed is a whole number from 0 to 999 999 999");
  }
  if ("seed" in place) place.seed = Number(place.seed);
  if ("solver" in place && !SOLVERS.includes(place.solver)) {
    refuse("solver", "Unknown simulator in the address", `A simulator is ${SOLVERS.join(", ")}`);
  }
  if ("coarse" in place && !LEVELS.includes(place.coarse)) {
    refuse("coarse", "Unknown coarse level in the address", `A level is ${LEVELS.join(", ")}`);
  }
  if (address.hash.startsWith(REPLAY)) place.replay = address.hash;
  if (address.hash.startsWith(SCENE)) place.packed = address.hash;
  return { place, faults };
}

/** The address of a place, with the looks that the present one asks for. */
export function addressOf(place) {
  const address = new URL(window.location.href);
  for (const name of NAMES) address.searchParams.delete(name);
  for (const name of NAMES) {
    if (place[name] !== undefined && place[name] !== null) address.searchParams.set(name, String(place[name]));
  }
  address.hash = place.replay ?? place.packed ?? "";
  return address;
}

/** What the browser keeps beside the present address: {session, plays, scene}; fields may be absent. */
export const kept = () => window.history.state ?? {};

/** Keep something more beside the present address. */
export function keep(more) {
  window.history.replaceState({ ...kept(), ...more }, "");
}

/**
 * Go to a place: it gets an entry of its own in the browser's history, unless it is where the page is already.
 *
 * @param state what the browser keeps beside it
 * @param replaces whether it takes the place of the present entry, as at the start
 */
export function goTo(place, state = {}, { replaces = false } = {}) {
  const address = addressOf(place);
  if (replaces || address.href === window.location.href) window.history.replaceState(state, "", address);
  else window.history.pushState(state, "", address);
}
