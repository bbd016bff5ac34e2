"use strict";
// Colours of the theme, markers of the sensors, and text on a canvas.
const Symbols = (() => {
  const names = ["ground", "ink", "faint", "line", "truth", "own",
    "track", "track2", "track3", "track4", "level1", "level2", "level3", "recovery"];
  let colours = {};
  function readTheme() {
    colours = Canvas.theme(names);
  }

  function level(number) {
    return colours[`level${Math.min(Math.max(number, 1), 3)}`];
  }

  // Tracks are in the colour of their tracker.
  function tracker(number) {
    return colours[["track", "track2", "track3", "track4"][Math.max(number, 0) % 4]];
  }

  // Regions of guidance, by their number: colour and words.
  const REGIONS = ["none", "far", "mid", "near", "recovery", "unknown"];
  function region(number) {
    const name = REGIONS[number];
    if (name === "recovery") return { name, colour: colours.recovery, dash: [6, 4] };
    return { name, colour: level(number), dash: [] };
  }

  // Markers are added to the path at a place; many of one kind are drawn at once.
  const paths = {
    o: (c, x, y, r) => { c.moveTo(x + r, y); c.arc(x, y, r, 0, 2 * Math.PI); },
    s: (c, x, y, r) => c.rect(x - 0.85 * r, y - 0.85 * r, 1.7 * r, 1.7 * r),
    D: (c, x, y, r) => polygon(c, x, y, r, 4, 0),
    d: (c, x, y, r) => polygon(c, x, y, 0.8 * r, 4, 0),
    "^": (c, x, y, r) => polygon(c, x, y, r, 3, 0),
    v: (c, x, y, r) => polygon(c, x, y, r, 3, Math.PI),
    "<": (c, x, y, r) => polygon(c, x, y, r, 3, -Math.PI / 2),
    ">": (c, x, y, r) => polygon(c, x, y, r, 3, Math.PI / 2),
    p: (c, x, y, r) => polygon(c, x, y, r, 5, 0),
    h: (c, x, y, r) => polygon(c, x, y, r, 6, 0),
    8: (c, x, y, r) => polygon(c, x, y, r, 8, Math.PI / 8),
    "*": (c, x, y, r) => star(c, x, y, r, 5, 0.4, 0),
    P: (c, x, y, r) => star(c, x, y, r, 4, 0.35, 0),
    X: (c, x, y, r) => star(c, x, y, r, 4, 0.35, Math.PI / 4),
  };
  function polygon(c, x, y, r, corners, turn) {
    for (let i = 0; i < corners; i++) {
      const angle = turn + (2 * Math.PI * i) / corners;
      c[i ? "lineTo" : "moveTo"](x + r * Math.sin(angle), y - r * Math.cos(angle));
    }
    c.closePath();
  }
  function star(c, x, y, r, points, inner, turn) {
    for (let i = 0; i < 2 * points; i++) {
      const angle = turn + (Math.PI * i) / points, far = i % 2 ? inner * r : r;
      c[i ? "lineTo" : "moveTo"](x + far * Math.sin(angle), y - far * Math.cos(angle));
    }
    c.closePath();
  }
  function outline(c, marker, x, y, r) {
    (paths[marker] || paths.o)(c, x, y, r);
  }
  function mark(c, marker, x, y, r, colour, filled) {
    c.beginPath();
    outline(c, marker, x, y, r);
    if (filled) {
      c.fillStyle = colour;
      c.fill();
    } else {
      c.strokeStyle = colour;
      c.lineWidth = 1.5;
      c.stroke();
    }
  }

  // Paths by how they are drawn: those that look alike are drawn at once.
  class Batch {
    constructor() { this.groups = new Map(); }
    path(colour, alpha, filled, width = 1.5) {
      const shade = Math.ceil(alpha * 8);
      const key = `${colour} ${shade} ${filled} ${width}`;
      let group = this.groups.get(key);
      if (!group) {
        group = { path: new Path2D(), colour, alpha: Math.min(shade / 8, 1), filled, width };
        this.groups.set(key, group);
      }
      return group.path;
    }
    draw(c) {
      for (const group of this.groups.values()) {
        c.globalAlpha = group.alpha;
        if (group.filled) {
          c.fillStyle = group.colour;
          c.fill(group.path);
        } else {
          c.strokeStyle = group.colour;
          c.lineWidth = group.width;
          c.stroke(group.path);
        }
      }
      c.globalAlpha = 1;
    }
  }

  function aircraft(c, x, y, heading, size, colour) {
    c.save();
    c.translate(x, y);
    c.rotate(heading);
    c.strokeStyle = colour;
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(0, -size);
    c.lineTo(0, 0.8 * size);
    c.moveTo(-0.8 * size, 0);
    c.lineTo(0.8 * size, 0);
    c.moveTo(-0.35 * size, 0.7 * size);
    c.lineTo(0.35 * size, 0.7 * size);
    c.stroke();
    c.restore();
  }

  function niceStep(least) {
    const power = 10 ** Math.floor(Math.log10(least));
    return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= least * 0.999);
  }

  return { get colours() { return colours; }, readTheme, level, tracker, region, mark, outline, Batch, aircraft,
    niceStep };
})();
