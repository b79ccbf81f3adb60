// The pictures of a film: files in the order of their names, or a video taken apart by the browser.

import { t } from "./i18n.js";

const MOST = 2000;
const PAN = { frames: 10, step: 6 }; // of a film made of one picture, pixels from each frame to the next

/** `{ name, time_s, blob }` of every frame; `onFrame(done, all)` tells how far it is. */
export async function framesOf(files, rate, onFrame) {
  const video = files.find(({ type }) => type.startsWith("video/"));
  if (video) return takenApart(video, rate, onFrame);
  const inOrder = [...files].sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
  return inOrder.map((file, k) => ({ name: file.name, time_s: k / rate, blob: file }));
}

/** The pictures that a camera takes of this one while it moves aside. */
export async function panned(file) {
  const bitmap = await createImageBitmap(file);
  const sheet = new OffscreenCanvas(bitmap.width - PAN.frames * PAN.step, bitmap.height);
  const files = [];
  for (let k = 0; k < PAN.frames; k += 1) {
    sheet.getContext("2d").drawImage(bitmap, -k * PAN.step, 0);
    files.push(new File([await sheet.convertToBlob({ type: "image/png" })], `${k}.png`, { type: "image/png" }));
  }
  return files;
}

async function takenApart(file, rate, onFrame) {
  const video = document.createElement("video");
  video.muted = true;
  video.src = URL.createObjectURL(file);
  await once(video, "loadeddata");
  const count = Math.min(MOST, Math.max(1, Math.floor(video.duration * rate)));
  const sheet = new OffscreenCanvas(video.videoWidth, video.videoHeight);
  const frames = [];
  for (let k = 0; k < count; k += 1) {
    video.currentTime = k / rate;
    await once(video, "seeked");
    sheet.getContext("2d").drawImage(video, 0, 0);
    const blob = await sheet.convertToBlob({ type: "image/jpeg", quality: 0.95 });
    frames.push({ name: `${file.name} ${(k / rate).toFixed(2)} s`, time_s: k / rate, blob });
    onFrame(k + 1, count);
  }
  URL.revokeObjectURL(video.src);
  return frames;
}

function once(video, name) {
  return new Promise((resolve, reject) => {
    video.addEventListener(name, resolve, { once: true });
    video.addEventListener("error", () => reject(new Error(t("this video cannot be read by the browser"))), { once: true });
  });
}
