// A film of what was seen: the kept pictures are drawn again, and the browser records them as they pass.

import { Problem } from "../client.js";
import { Stage } from "../stage/stage.js";

// The first one that the browser can record. Phones and messengers show mp4, not all show webm.
const KINDS = [
  ["mp4", "video/mp4;codecs=avc1.640028"],
  ["mp4", "video/mp4;codecs=avc1.42E01F"],
  ["mp4", "video/mp4"],
  ["webm", "video/webm;codecs=vp9"],
  ["webm", "video/webm"],
];
const BITS_PER_SECOND = 6e6;
const LAST_MS = 300; // for which the last picture stays
const RATE = 25; // pictures a second

const after = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

let again = null; // stage that draws the kept pictures; one for all films, for contexts of WebGL are few

function layersOf() {
  const layer = () => document.createElement("canvas");
  return { backdrop: layer(), particles: layer(), overlay: layer() };
}

/**
 * Film what was seen. It takes as long as the film lasts.
 *
 * @param moments of Recent
 * @param stage   the stage that has shown them
 * @param tell(done, total) called with the seconds that are filmed, and with all
 * @returns {blob, suffix, seconds}
 */
export async function film(moments, stage, tell) {
  const [suffix, mimeType] = KINDS.find(([, kind]) => globalThis.MediaRecorder?.isTypeSupported(kind)) ?? [];
  if (suffix === undefined) {
    throw new Problem("This browser records no films", "Save the run, and film it with hybridmpm simulate --run.", 0);
  }
  if (moments.length < 2) throw new Problem("Nothing to film yet", "The film shows what was seen in the last 10 s.", 0);
  again ??= new Stage(layersOf(), moments[0].of.shown, stage.rendererKind, () => stage.view.width);
  again.setScene(...stage.setting);
  const picture = document.createElement("canvas");
  const show = ({ of }) => {
    again.recall(of);
    again.draw(performance.now());
    again.paintOn(picture);
  };
  show(moments[0]);
  const stream = picture.captureStream(RATE);
  const recorder = new MediaRecorder(stream, { mimeType, videoBitsPerSecond: BITS_PER_SECOND });
  const pieces = [];
  recorder.addEventListener("dataavailable", ({ data }) => pieces.push(data));
  const ended = new Promise((resolve, reject) => {
    recorder.addEventListener("stop", resolve);
    recorder.addEventListener("error", ({ error }) => reject(new Problem("The film failed", error.message, 0)));
  });
  recorder.start();
  const began = performance.now();
  const total = moments.at(-1).at / 1000;
  for (const [i, moment] of moments.entries()) {
    // A machine that draws slowly leaves pictures out, so that the film has the speed of what was seen.
    const now = performance.now() - began;
    if (i < moments.length - 1 && moments[i + 1].at < now) continue;
    await after(Math.max(0, moment.at - now));
    show(moment);
    tell(moment.at / 1000, total);
  }
  await after(LAST_MS);
  recorder.stop();
  await ended;
  for (const track of stream.getTracks()) track.stop();
  return { blob: new Blob(pieces, { type: `video/${suffix}` }), suffix, seconds: total };
}
