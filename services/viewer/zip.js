// ZIP archives: read with the browser's own inflation; written without compression, for what is inside has its own.

import { t } from "./i18n.js";

const [END, CENTRAL, LOCAL] = [0x06054b50, 0x02014b50, 0x04034b50];
const LONGEST_COMMENT = 65_557;
const [STORED, DEFLATED] = [0, 8];
const FIRST_DAY = 0x21; // 1980-01-01, the first that an archive can state
const REMAINDERS = Int32Array.from({ length: 256 }, (_, byte) => {
  for (let k = 0; k < 8; k += 1) byte = byte & 1 ? (byte >>> 1) ^ 0xedb88320 : byte >>> 1;
  return byte;
}); // of CRC-32

/** `{ path, blob() }` of every file in an archive, in its order. Throws when it is none, or one of more than 4 GiB. */
export async function entriesOf(file) {
  const tail = new DataView(await file.slice(-LONGEST_COMMENT).arrayBuffer());
  let at = tail.byteLength - 22;
  while (at >= 0 && tail.getUint32(at, true) !== END) at -= 1;
  if (at < 0) throw new Error(t("this is no ZIP archive"));
  const [count, size, start] = [tail.getUint16(at + 10, true), tail.getUint32(at + 12, true), tail.getUint32(at + 16, true)];
  if (start === 0xffffffff || count === 0xffff) throw new Error(t("archives of more than 4 GiB or 65534 files are not read here"));
  return central(file, new DataView(await file.slice(start, start + size).arrayBuffer()), count);
}

function central(file, view, count) {
  const found = [];
  for (let k = 0, at = 0; k < count; k += 1) {
    if (view.getUint32(at, true) !== CENTRAL) throw new Error(t("this archive is damaged"));
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
  if (head.getUint32(0, true) !== LOCAL) throw new Error(`${path}: ${t("this archive is damaged")}`);
  const from = start + 30 + head.getUint16(26, true) + head.getUint16(28, true);
  const raw = file.slice(from, from + packed);
  if (method === STORED) return raw;
  if (method !== DEFLATED) throw new Error(t("{path}: packed in a way that is not read here", { path }));
  return new Response(raw.stream().pipeThrough(new DecompressionStream("deflate-raw"))).blob();
}

/** An archive of `{ path, blob }`. Their bytes are read one file after the other, for the checksum, and not kept. */
export async function archiveOf(files) {
  const [parts, directory] = [[], []];
  let at = 0;
  for (const { path, blob } of files) {
    const name = new TextEncoder().encode(path);
    const size = [await checksum(blob), blob.size, blob.size].flatMap(long);
    const shared = [...short(20), ...short(0x800), ...short(STORED), ...short(0), ...short(FIRST_DAY), ...size, ...short(name.length), ...short(0)];
    parts.push(Uint8Array.from([...long(LOCAL), ...shared]), name, blob);
    directory.push(Uint8Array.from([...long(CENTRAL), ...short(20), ...shared, ...short(0), ...short(0), ...short(0), ...long(0), ...long(at)]), name);
    at += 30 + name.length + blob.size;
  }
  const length = new Blob(directory).size;
  if (at + length > 0xfffffffe || files.length > 0xfffe) throw new Error(t("this is more than an archive of 4 GiB or 65534 files holds"));
  const count = short(files.length);
  const end = [...long(END), ...short(0), ...short(0), ...count, ...count, ...long(length), ...long(at), ...short(0)];
  return new Blob([...parts, ...directory, Uint8Array.from(end)], { type: "application/zip" });
}

const short = (value) => [value & 255, (value >> 8) & 255];
const long = (value) => [...short(value), ...short(value >>> 16)];

async function checksum(blob) {
  let crc = -1;
  for await (const bytes of blob.stream()) for (const byte of bytes) crc = (crc >>> 8) ^ REMAINDERS[(crc ^ byte) & 255];
  return ~crc;
}
