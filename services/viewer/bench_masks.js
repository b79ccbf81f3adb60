// A second worker of the label bench, for what no click waits for: masks as a picture, and labels with masks to save.

import { rgb } from "./colors.js";
import { finished } from "./label_save.js";
import { labelMap, tint } from "./masks.js";
import { answer } from "./worker_answers.js";

answer({
  finish: ({ label, confirmed }) => finished(label, confirmed),
  masks: (label) => {
    const map = labelMap(label);
    return { bitmap: tint(map, rgb).transferToImageBitmap(), width: map.width * map.step, height: map.height * map.step };
  },
});
