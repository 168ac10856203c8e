// A whole run in a link: the log of a session, packed with a checksum.

const NAME = "replay";

async function through(bytes, stream) {
  const result = new Blob([bytes]).stream().pipeThrough(stream);
  return new Uint8Array(await new Response(result).arrayBuffer());
}

/** The part of an address behind the # with a log. */
export async function packedLog(log) {
  // gzip, because it has a checksum.
  const bytes = await through(new TextEncoder().encode(JSON.stringify(log)), new CompressionStream("gzip"));
  let binary = "";
  for (const byte of bytes) binary += String.fromCharCode(byte);
  return `${NAME}=${btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
}

/** The log that `packedLog` packed. Throws where it is damaged. */
export async function unpackedLog(hash) {
  const text = hash.replace(/^#/, "").slice(NAME.length + 1);
  const binary = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
  const bytes = Uint8Array.from(binary, (sign) => sign.charCodeAt(0));
  return JSON.parse(new TextDecoder().decode(await through(bytes, new DecompressionStream("gzip"))));
}
