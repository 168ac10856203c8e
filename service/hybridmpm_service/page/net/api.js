// The client of this page: that of ../client.js with the key of this tab, and with advice for its user.

import { Client, Problem } from "../client.js";
import { present, renewed } from "./key.js";

const ADVICE = {
  401: "Ask the operator of the server for a key, or whoever sent the link for a new one.",
  403: "Ask the operator of the server for a key that may do this.",
  404: "Start a new simulation from the scene panel.",
  413: "Draw a shorter stroke.",
  429: "Wait a moment and try again.",
  503: "Close a simulation in another tab, or wait a minute, then try again.",
};

const ADVICE_BY_KIND = {
  "model-damaged": "Choose MPM, or contact the operator of the server.",
  "simulation-failed": "Return to the start (r), or start a new simulation.",
};

/** Advice about a refused body, by the end of the address. */
const ADVICE_ON_BODY = {
  sketches: "Draw the stroke again, inside the box.",
  sessions: "Choose another scenario or seed in the scene panel, or correct the file that was opened.",
};

/** A problem with what its user can do; `path` is the address of the call, empty for a command of the stream. */
export function advised(problem, path = "") {
  const onBody = problem.status === 422 ? ADVICE_ON_BODY[path.split("/").at(-1)] : undefined;
  problem.advice = ADVICE_BY_KIND[problem.kind] ?? onBody ?? ADVICE[problem.status] ?? "";
  return problem;
}

class PageClient extends Client {
  constructor() {
    super(new URL("./", document.baseURI));
  }

  /** Make a call with the key that there is, or that the user is asked for. */
  async call(method, path, options) {
    for (;;) {
      const sent = (this.key = present());
      try {
        return await super.call(method, path, options);
      } catch (problem) {
        if (!(problem instanceof Problem)) throw problem;
        if (problem.status !== 401 || !(await renewed(sent))) throw advised(problem, path);
      }
    }
  }

  socket(id) {
    this.key = present();
    return super.socket(id);
  }
}

export const client = new PageClient();
