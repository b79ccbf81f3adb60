// ZIP archives: read with the browser's own inflation; written without compression, for what is inside has its own.

const [END, CENTRAL, LOCAL] = [0x06054b50, 0x02014b50, 0x04034b50];
const LONGEST_COMMENT = 65_557;
const [STORED, DEFLATED] = [0, 8];

/** `{ path, blob() }` of every file in an archive, in its order. Throws when it is none, or one of more than 4 GiB. */
export async function entriesOf(file) {
  const tail = new DataView(await file.slice(-LONGEST_COMMENT).arrayBuffer());
  let at = tail.byteLength - 22;
  while (at >= 0 && tail.getUint32(at, true) !== END) at -= 1;
  if (at < 0) throw new Error("this is no ZIP archive");
  const [count, size, start] = [tail.getUint16(at + 10, true), tail.getUint32(at + 12, true), tail.getUint32(at + 16, true)];
  if (start === 0xffffffff || count === 0xffff) throw new Error("archives of more than 4 GiB or 65534 files are not read here");
  return central(file, new DataView(await file.slice(start, start + size).arrayBuffer()), count);
}

function central(file, view, count) {
  const found = [];
  for (let k = 0, at = 0; k < count; k += 1) {
    if (view.getUint32(at, true) !== CENTRAL) throw new Error("this archive is damaged");
    const [flags, method, packed] = [view.getUint16(at + 8, true), view.getUint16(at + 10, true), view.getUint32(at + 20, true)];
    const [name, extra, comment] = [28, 30, 32].map((offset) => view.getUint16(at + offset, true));
    const bytes = new Uint8Array(view.buffer, view.byteOffset + at + 46, name);
    const path = new TextDecoder(flags & 0x800 ? "utf-8" : "latin1").decode(bytes);
    const start = view.getUint32(at + 42, true);
    if (!path.endsWith("/")) found.push({ path, blob: () => member(file, start, packed, method, path) });
    at += 46 + name + extra + comment;
  }
  return found;
}

async function member(file, start, packed, method, path) {
  const head = new DataView(await file.slice(start, start + 30).arrayBuffer());
  if (head.getUint32(0, true) !== LOCAL) throw new Error(`${path}: this archive is damaged`);
  const from = start + 30 + head.getUint16(26, true) + head.getUint16(28, true);
  const raw = file.slice(from, from + packed);
  if (method === STORED) return raw;
  if (method !== DEFLATED) throw new Error(`${path}: packed in a way that is not read here`);
  return new Response(raw.stream().pipeThrough(new DecompressionStream("deflate-raw"))).blob();
}
