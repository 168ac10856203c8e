// A whole run or scene in a link: JSON, packed with a checksum.

async function through(bytes, stream) {
  const result = new Blob([bytes]).stream().pipeThrough(stream);
  return new Uint8Array(await new Response(result).arrayBuffer());
}

/** The part of an address behind the # with a value, under a name. */
export async function packed(name, value) {
  // gzip, because it has a checksum.
  const bytes = await through(new TextEncoder().encode(JSON.stringify(value)), new CompressionStream("gzip"));
  let binary = "";
  for (const byte of bytes) binary += String.fromCharCode(byte);
  return `${name}=${btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
}

/** The value that `packed` packed. Throws where it is damaged. */
export async function unpacked(hash) {
  const text = hash.slice(hash.indexOf("=") + 1);
  const binary = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
  const bytes = Uint8Array.from(binary, (sign) => sign.charCodeAt(0));
  return JSON.parse(new TextDecoder().decode(await through(bytes, new DecompressionStream("gzip"))));
}
