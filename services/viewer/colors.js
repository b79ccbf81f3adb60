// The color of a cable, everywhere the same.

const LIGHT = 0.18; // luminance from which black stands out better than white

/** `[r, g, b]` of an instance, the same as in overlay.png and instances.png: hues a golden ratio apart. */
export function rgb(id) {
  const number = id - 1;
  const hue = (0.02 + number * 0.61803398875) % 1;
  const dim = Math.floor(number / 12) % 3;
  const [saturation, value] = [0.9 - 0.2 * dim, 1 - 0.15 * dim];
  const channel = (n) => {
    const k = (n + 6 * hue) % 6;
    return Math.round(255 * value * (1 - saturation * Math.max(0, Math.min(k, 4 - k, 1))));
  };
  return [channel(5), channel(3), channel(1)];
}

export const color = (id) => `rgb(${rgb(id).join(" ")})`;

/** Black or white, whichever is read better on the color of an instance. */
export function inkOn(id) {
  const [r, g, b] = rgb(id).map((value) => (value / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > LIGHT ? "#000" : "#fff";
}
