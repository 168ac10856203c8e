// Elements by id, and their text.

export const byId = (id) => document.getElementById(id);

/** Set an element's text. Only textContent is used, so that nothing from a server becomes markup. */
export function setText(id, text) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}
