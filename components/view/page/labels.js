"use strict";
// Names beside what they name, moved where they would cover each other.
const Labels = (() => {
  const HIGH = 13, STEPS = 12;
  const widths = new Map();
  let waiting = [], kept = [];

  // Of the words in the font of names.
  function widthOf(c, words) {
    if (!widths.has(words)) {
      Canvas.font(c);
      widths.set(words, c.measureText(words).width);
    }
    return widths.get(words);
  }
  function boxOf(words, left, line, wide) {
    return { words, left, right: left + wide, top: line - HIGH + 3, low: line + 3 };
  }
  // Text that stays where it is; names keep clear of it.
  function keep(c, words, x, y, colour, halo = null) {
    Canvas.text(c, words, x, y, colour, "left", 12, halo);
    kept.push(boxOf(words, x, y, widthOf(c, words)));
  }
  // Text that stays where it is, if nothing that stays is there; whether it does.
  function place(c, words, x, y, colour, halo = null) {
    const there = free(kept, boxOf(words, x, y, widthOf(c, words)));
    if (there) keep(c, words, x, y, colour, halo);
    return there;
  }
  // Something that names keep clear of, so far to all sides of (x, y).
  function block(x, y, wide, high) {
    kept.push({ words: "", left: x - wide, right: x + wide, top: y - high, low: y + high });
  }
  // A name of what is at (x, y); it stands `right` and `below` of it if there is room, or up to so
  // many `steps` of a line away.
  function add(words, x, y, right, below, colour, steps = STEPS) {
    if (words) waiting.push({ words, x, y, right, below, colour, steps });
  }
  function free(taken, box) {
    return taken.every((other) => box.left >= other.right || box.right <= other.left ||
      box.top >= other.low || box.low <= other.top);
  }
  // Those added last have the first choice; where a cluster leaves no room, a name is left out.
  function draw(c, halo = null) {
    const taken = kept, placed = [], width = c.canvas.clientWidth, height = c.canvas.clientHeight;
    const inside = (box) => box.left >= 0 && box.right <= width && box.top >= 0 && box.low <= height;
    for (const { words, x, y, right, below, colour, steps } of waiting.reverse()) {
      const wide = widthOf(c, words);
      for (let turn = 0; turn < 4 * steps; turn++) {
        const lines = Math.ceil((turn >> 1) / 2) * ((turn >> 1) % 2 ? 1 : -1);
        const left = turn % 2 ? x - right - wide : x + right, line = y + below + HIGH * lines;
        const box = boxOf(words, left, line, wide);
        if (!inside(box) || !free(taken, box)) continue;
        taken.push(box);
        placed.push(box);
        if (lines) leader(c, x, y, turn % 2 ? box.right + 2 : left - 2, line - 4, colour);
        Canvas.text(c, words, left, line, colour, "left", 12, halo);
        break;
      }
    }
    waiting = [];
    kept = [];
    return placed;
  }
  function leader(c, x, y, u, v, colour) {
    c.save();
    c.globalAlpha = 0.5;
    c.strokeStyle = colour;
    c.lineWidth = 1;
    c.beginPath(); c.moveTo(x, y); c.lineTo(u, v); c.stroke();
    c.restore();
  }
  return { keep, place, block, add, draw, width: widthOf };
})();
