// HTTP calls to the service. Each failure becomes a Problem, with advice for the user.

import { headers, present, renewed } from "./key.js";

const ADVICE = {
  401: "Ask the operator of the server for a key, or whoever sent the link for a new one.",
  403: "Ask the operator of the server for a key that may do this.",
  404: "Start a new simulation from the scene panel.",
  413: "Draw a shorter stroke.",
  429: "Wait a moment and try again.",
  503: "Close a simulation in another tab, or wait a minute, then try again.",
};

const ADVICE_BY_TYPE = {
  "urn:hybridmpm:problem:model-damaged": "Choose MPM, or contact the operator of the server.",
  "urn:hybridmpm:problem:simulation-failed": "Return to the start (r), or start a new simulation.",
};

/** Advice about a refused body, by the end of the address. */
const ADVICE_ON_BODY = {
  sketches: "Draw the stroke again, inside the box.",
  sessions: "Choose another scenario or seed in the scene panel, or correct the file that was opened.",
};

/** A request that the server refused or that never reached it. */
export class Problem extends Error {
  /**
   * @param {string} title   short description
   * @param {string} detail  exact description, with the field and its range where the server names them
   * @param {number} status  HTTP status, 0 when there was no answer
   * @param {string} type    name of the kind of problem, where the server gives one
   * @param {string} path    address of the call; empty for a command of the stream
   */
  constructor(title, detail, status, type = "", path = "") {
    super(detail ? `${title}: ${detail}` : title);
    this.title = title;
    this.detail = detail;
    this.status = status;
    const onBody = status === 422 ? ADVICE_ON_BODY[path.split("/").at(-1)] : undefined;
    this.advice = ADVICE_BY_TYPE[type] ?? onBody ?? ADVICE[status] ?? "";
  }
}

async function problemOf(response, path) {
  try {
    const body = await response.json();
    const fields = (body.errors ?? []).map((error) => `${error.field}: ${error.message}`);
    const detail = fields.length > 0 ? fields.join("; ") : body.detail;
    return new Problem(body.title ?? response.statusText, detail ?? "", response.status, body.type, path);
  } catch {
    return new Problem("The server answered with an error", `status ${response.status}`, response.status);
  }
}

/** The whole address of a path of the service, which need not be at the root of its host. */
export const at = (path) => new URL(path.replace(/^\//, "./"), document.baseURI);

/** Make a call with the key that there is, or that the user is asked for, and return its answer. */
async function call(path, options = {}) {
  for (;;) {
    const sent = present();
    let response;
    try {
      response = await fetch(at(path), { ...options, headers: { ...options.headers, ...headers() } });
    } catch {
      throw new Problem("The server does not answer", "Check that it is still running.", 0);
    }
    if (response.ok) return response;
    if (response.status !== 401 || !(await renewed(sent))) throw await problemOf(response, path);
  }
}

/**
 * Make a call and return its JSON, or null for a 204. Throws Problem for every answer that is not a success.
 *
 * @param signal an AbortSignal that cancels the call
 */
export async function request(method, path, body, signal) {
  const response = await call(path, {
    method,
    headers: body === undefined ? {} : { "Content-Type": "application/json" },
    body: body === undefined ? undefined : JSON.stringify(body),
    signal,
  });
  return response.status === 204 ? null : response.json();
}

/** Make a GET call and return the body of its answer as it is. Throws as `request`. */
export async function requestFile(path, accept = "*/*") {
  const response = await call(path, { headers: { Accept: accept } });
  return response.blob();
}

const LEAVE_SECONDS = 60; // in which a reload, or the browser's Back, finds a session again

/** Leave a session, perhaps while the page closes: it ends soon, unless the page comes back to it. */
export function abandon(path) {
  fetch(at(`${path}?after=${LEAVE_SECONDS}`), { method: "DELETE", keepalive: true, headers: headers() }).catch(() => {
    // The session expires by itself when the server cannot be reached.
  });
}
