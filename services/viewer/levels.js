// A picture in halves of its size: a large one is drawn from the level that is just fine enough, so that zooming and
// panning cost the same however many pixels it has.

const COARSEST_PX = 1024;

/** The bitmap and its halves; those come a little later, each with a call of `arrived`. */
export function levelsOf(bitmap, arrived) {
  const levels = [bitmap];
  const halve = async () => {
    const last = levels.at(-1);
    if (Math.max(last.width, last.height) <= COARSEST_PX) return;
    const [resizeWidth, resizeHeight] = [last.width, last.height].map((side) => Math.max(1, Math.round(side / 2)));
    levels.push(await createImageBitmap(last, { resizeWidth, resizeHeight, resizeQuality: "medium" }));
    arrived();
    await halve();
  };
  halve().catch(() => {}); // without its halves a picture is only slower
  return levels;
}

/** The coarsest level that is at least `width` device pixels wide, or the finest there is. */
export const levelFor = (levels, width) => levels.findLast((level) => level.width >= width) ?? levels[0];
