// The key of the service, where it needs one, or a link, which shows one session.
//
// A key stays in the session storage of the tab: reloads and tabs that this one opens have it, and nobody who opens the
// browser later. The password store of the browser may keep it for longer, if its user wants that. A link stays in the
// address, behind the #, and is kept nowhere else.

const NAME = "hybridmpm-key";

let link = null; // the token of a link; null without one
let token = stored();
let asking = null; // promise of an answer of the user, whom several calls may wait for
let ask = async () => null; // from onKeyNeeded

function stored() {
  try {
    return window.sessionStorage.getItem(NAME);
  } catch {
    return null; // browsers may deny storage to pages within pages of other sites
  }
}

/** Use a link in place of a key. */
export function useLink(value) {
  link = value;
}

/** Say how the user is asked: `handler(refused)` resolves to a token, or to null where there is none. */
export function onKeyNeeded(handler) {
  ask = handler;
}

/** The token that calls carry at present; null without one. */
export const present = () => link ?? token;

/** Whether a call that was refused is worth another try: it had `sent`, and there is another key by now. */
export async function renewed(sent) {
  if (link !== null) return false;
  if (sent !== token) return true;
  asking ??= ask(sent !== null).finally(() => {
    asking = null;
  });
  const given = await asking;
  if (given === null) return false;
  token = given;
  try {
    window.sessionStorage.setItem(NAME, given);
  } catch {
    // It is kept until the page is left.
  }
  return true;
}
