// Elements by name, and the one way in which text gets into them.

export const byId = (id) => document.getElementById(id);

/** Text goes in through textContent only: nothing that comes from a server becomes markup. */
export function setText(id, text) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}
