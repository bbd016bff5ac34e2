"use strict";
// Names beside what they name, moved where they would cover each other.
const Labels = (() => {
  const HIGH = 13, STEPS = 12;
  const widths = new Map();
  let waiting = [], kept = [];

  function widthOf(c, words) {
    if (!widths.has(words)) widths.set(words, c.measureText(words).width);
    return widths.get(words);
  }
  function boxOf(words, left, line, wide) {
    return { words, left, right: left + wide, top: line - HIGH + 3, low: line + 3 };
  }
  // Text that stays where it is; names keep clear of it.
  function keep(c, words, x, y, colour) {
    Canvas.text(c, words, x, y, colour);
    kept.push(boxOf(words, x, y, widthOf(c, words)));
  }
  // A name of what is at (x, y); it stands `right` and `below` of it if there is room.
  function add(words, x, y, right, below, colour) {
    if (words) waiting.push({ words, x, y, right, below, colour });
  }
  function free(taken, box) {
    return taken.every((other) => box.left >= other.right || box.right <= other.left ||
      box.top >= other.low || box.low <= other.top);
  }
  // Those added last have the first choice; where a cluster leaves no room, a name is left out.
  function draw(c) {
    const taken = kept, placed = [];
    Canvas.font(c);
    for (const { words, x, y, right, below, colour } of waiting.reverse()) {
      const wide = widthOf(c, words);
      for (let turn = 0; turn < 4 * STEPS; turn++) {
        const lines = Math.ceil((turn >> 1) / 2) * ((turn >> 1) % 2 ? 1 : -1);
        const left = turn % 2 ? x - right - wide : x + right, line = y + below + HIGH * lines;
        const box = boxOf(words, left, line, wide);
        if (!free(taken, box)) continue;
        taken.push(box);
        placed.push(box);
        if (lines) leader(c, x, y, turn % 2 ? box.right + 2 : left - 2, line - 4, colour);
        Canvas.text(c, words, left, line, colour);
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
  return { keep, add, draw };
})();
