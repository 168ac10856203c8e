// The dialog that asks for the key of the service.

import { byId, setText } from "./dom.js";

/** Ask for a key; resolves to its token, or to null if the user gives none. `refused` says that one was wrong. */
export function askForKey(refused) {
  const dialog = byId("key");
  setText("key-problem", refused ? "This key is not known, or not any more." : "");
  byId("key-token").value = "";
  return new Promise((resolve) => {
    byId("key-form").onsubmit = (event) => {
      event.preventDefault();
      const given = byId("key-token").value.trim();
      dialog.close(given);
    };
    dialog.onclose = () => resolve(dialog.returnValue || null);
    dialog.returnValue = "";
    dialog.showModal();
  });
}
