// Elements by id, and the one way in which text gets into them.

export const byId = (id) => document.getElementById(id);

/** Set an element's text. It goes in through textContent alone: nothing that a server sends becomes markup. */
export function setText(id, text) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}
