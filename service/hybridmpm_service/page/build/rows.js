// Corners and triangles of surfaces: of many of them a scene has one text, base 64 of numbers, three a row.

const NUMBERS = { vertices: Float64Array, triangles: Uint32Array };
const LISTED = 1000; // rows that stay lists
const CHUNK = 1 << 14; // bytes that become text at once

function rowsOf(text, Numbers) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i += 1) bytes[i] = letters.charCodeAt(i);
  const numbers = new Numbers(bytes.buffer);
  return Array.from({ length: numbers.length / 3 }, (_, i) => [numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]]);
}

function textOf(rows, Numbers) {
  const bytes = new Uint8Array(Numbers.from(rows.flat()).buffer);
  let letters = "";
  for (let i = 0; i < bytes.length; i += CHUNK) letters += String.fromCharCode(...bytes.subarray(i, i + CHUNK));
  return btoa(letters);
}

/** A part of a scene with lists in the place of texts. */
export function unpacked(record) {
  const found = { ...record };
  for (const name in NUMBERS) if (typeof record[name] === "string") found[name] = rowsOf(record[name], NUMBERS[name]);
  return found;
}

/** A part of a scene with texts in the place of long lists. */
export function packed(record) {
  const found = { ...record };
  for (const name in NUMBERS) if (record[name]?.length > LISTED) found[name] = textOf(record[name], NUMBERS[name]);
  return found;
}
