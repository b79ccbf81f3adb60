// Where the label bench gets pictures and labels from: files, a folder, a ZIP archive; all become `{ path, blob() }`.
// A label belongs to the picture whose bytes have its SHA-256; its name decides only where it has none.

const PICTURE = /\.(png|jpe?g|jpe|jfif|gif|bmp|tiff?|webp)$/i;
const FORMAT = "dlo-label/1";

/** What somebody chose or dropped, archives unpacked. */
export async function listed(files) {
  const all = [];
  for (const file of files) {
    if (/\.zip$/i.test(file.name)) all.push(...(await (await import("./zip.js")).entriesOf(file)));
    else all.push({ path: file.webkitRelativePath || file.name, blob: async () => file });
  }
  return all.filter(({ path }) => !/(^|\/)(\.|__MACOSX)/.test(path));
}

/** Pictures `{ path, blob }`, and labels `{ label, confirmed }`: corrections go before drafts, those before the
 *  service's own. `refused` names what looks like a label and is none. */
export async function sorted(entries) {
  const pictures = entries.filter(({ path }) => PICTURE.test(path));
  const [labels, refused] = [[], []];
  for (const { path, blob } of entries.filter(({ path }) => /\.jsonl?$/i.test(path))) {
    for (const line of linesOf(path, await (await blob()).text())) {
      const label = labelIn(line);
      if (label) labels.push({ label, rank: rankOf(path, label), confirmed: label.origin === "corrected" });
      else if (/(^|\/)(labels|corrected|drafts)\//.test(path)) refused.push(path);
    }
  }
  labels.sort((a, b) => b.rank - a.rank);
  return { pictures, labels, refused };
}

const linesOf = (path, text) => (/\.jsonl$/i.test(path) ? text.split("\n").filter((line) => line.trim()) : [text]);

function labelIn(text) {
  try {
    const label = JSON.parse(text);
    return label.format === FORMAT && label.width > 0 && label.height > 0 && Array.isArray(label.instances) ? label : null;
  } catch {
    return null;
  }
}

function rankOf(path, { origin }) {
  if (/(^|\/)corrected\//.test(path) || origin === "corrected") return 2;
  return /(^|\/)drafts\//.test(path) ? 1 : 0;
}

/** The label of a picture with these bytes and this name, or undefined. A name that means several pictures means none. */
export function labelFor(labels, { sha256, path }, paths) {
  const own = labels.find(({ label }) => label.sha256?.toLowerCase() === sha256);
  if (own) return own;
  const alone = (name) => paths.filter((other) => fits(other, name)).length === 1;
  return labels.find(({ label }) => !label.sha256 && fits(path, label.name) && alone(label.name));
}

/** Whether a path ends like the name, folder by folder. */
function fits(path, name) {
  const [a, b] = [path, name].map((text) => text.replaceAll("\\", "/").normalize("NFC").split("/").reverse());
  const shared = Math.min(a.length, b.length);
  return a.slice(0, shared).every((part, i) => part === b[i]);
}
