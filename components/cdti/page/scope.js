"use strict";
// The traffic display: ownship in the middle, its heading up.
const Scope = (() => {
  const canvas = document.getElementById("scope");
  const rad = Math.PI / 180;
  const MOST_TAGS = 40, LONGEST = 24, NARROW = 150, FRAME = 15;
  let place = 5;

  const ranges = () => Units.system.ranges;
  function zoom(step) { place = Math.min(Math.max(place + step, 0), ranges().length - 1); }
  function range() { return Units.metres("distance", ranges()[place]); }
  // The least range that holds so many metres.
  function hold(far) {
    const least = ranges().findIndex((r) => Units.metres("distance", r) >= far * 0.999);
    place = least < 0 ? ranges().length - 1 : least;
  }
  // A range at which the sensors' reach and what they see fit.
  function fit(sensors) {
    const far = Math.max(0, ...sensors.map((s) => s.range || 0));
    if (far > 0) hold(far);
  }

  function draw(frame, scene, chosen, bug, drawn) {
    const c = Canvas.ready(canvas);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const x0 = width / 2, y0 = height / 2 + 4;
    const outer = Math.max(Math.min(width / 2 - 24, height / 2 - 34), 20);
    const metres = range(), scale = outer / metres, heading = frame.own.heading;
    const at = (bearing, far) => {
      const angle = (bearing - heading) * rad;
      return [x0 + far * scale * Math.sin(angle), y0 - far * scale * Math.cos(angle)];
    };
    Rose.rings(c, x0, y0, outer, heading);
    c.save();
    c.beginPath();
    c.arc(x0, y0, outer, 0, 2 * Math.PI);
    c.clip();
    Rose.area(c, x0, y0, outer, frame.area, at, metres);
    for (const sensor of scene.sensors) Rose.reach(c, x0, y0, scale, sensor);
    c.restore();
    for (const one of frame.bands.direction) Rose.band(c, x0, y0, outer, heading, one);
    // On the ring itself: the numbers of the compass stand outside of it.
    if (bug !== null) Symbols.bug(c, ...at(bug, (outer - 2) / scale));
    // The most urgent are drawn last, over others, and named first.
    const ranged = frame.contacts.filter((one) => one[1] !== null)
      .sort((a, b) => a[9] - b[9] || (a[0] === chosen) - (b[0] === chosen));
    const lines = frame.contacts.filter((one) => one[1] === null);
    drawn.lines = lines.map((one) => line(c, at, one, metres, chosen));
    drawn.symbols = ranged.map((one) => symbol(c, x0, y0, scale, outer, heading, one, chosen));
    Symbols.own(c, x0, y0, 12);

    // Words come last, and keep clear of symbols and of each other.
    Labels.block(x0, y0, 12, 12);
    for (const one of drawn.symbols) {
      const half = one.number === chosen ? FRAME + 1 : 9;
      Labels.block(one.x, one.y, half, half);
    }
    for (const one of frame.bands.direction) Rose.blockBand(x0, y0, outer, heading, one);
    Rose.words(c, x0, y0, outer, metres, heading);
    for (const sensor of scene.sensors) Rose.reachWords(x0, y0, scale, outer, sensor);
    for (const one of drawn.lines) {
      Labels.add(`${scene.name(one.number)} no range`, one.x, one.y, 8, 4, Symbols.ink(one.level));
    }
    const tagged = drawn.symbols.slice(-MOST_TAGS);
    const apart = (one) => (one.number === chosen ? FRAME + 3 : 14);
    const words = tagged.reverse().map((one) => tag(c, one, scene, outer, apart(one))).reverse();
    tagged.reverse().forEach((one, i) => {
      Labels.add(words[i], one.x, one.y, apart(one), 4, Symbols.ink(one.level));
    });
    drawn.labels = Labels.draw(c, Symbols.colours.ground);
    drawn.range = metres;
    drawn.area = frame.area.length;
    drawn.bands = frame.bands;
  }

  function line(c, at, one, far, chosen) {
    const [number, , , , bearing, , , , , level] = one;
    c.beginPath();
    c.moveTo(...at(bearing, 0));
    c.lineTo(...at(bearing, far));
    c.strokeStyle = Symbols.ink(level);
    c.lineWidth = number === chosen ? 3 : 1.5;
    c.stroke();
    const [x, y] = at(bearing, far * 0.9);
    return { number, bearing, level, x, y };
  }

  function symbol(c, x0, y0, scale, outer, heading, one, chosen) {
    const [number, east, north, up, , , ve, vn, vu, level] = one;
    const turn = -heading * rad;
    const right = east * Math.cos(turn) + north * Math.sin(turn);
    const ahead = north * Math.cos(turn) - east * Math.sin(turn);
    let x = right * scale, y = -ahead * scale;
    const far = Math.hypot(x, y), off = far > outer;
    if (off) { x *= outer / far; y *= outer / far; }
    const moving = ve !== null && Math.hypot(ve, vn) > 1;
    const course = moving ? Math.atan2(ve, vn) + turn : null;
    x += x0; y += y0;
    c.save();
    if (off) {  // beyond the outer ring: half a symbol on it
      c.beginPath();
      c.arc(x0, y0, outer, 0, 2 * Math.PI);
      c.clip();
    }
    if (moving && !off) {  // where it will be in half a minute
      c.beginPath();
      c.moveTo(x, y);
      c.lineTo(x + 30 * Math.hypot(ve, vn) * scale * Math.sin(course),
        y - 30 * Math.hypot(ve, vn) * scale * Math.cos(course));
      c.strokeStyle = Symbols.colours.faint;
      c.lineWidth = 1;
      c.stroke();
    }
    Symbols.traffic(c, x, y, level, course, level ? 10 : 8);
    c.restore();
    if (number === chosen) {
      c.strokeStyle = Symbols.colours.ink;
      c.lineWidth = 1.5;
      c.strokeRect(x - FRAME, y - FRAME, 2 * FRAME, 2 * FRAME);
    }
    return { number, x, y, level, shape: Symbols.shape(level, course !== null), above: up >= 0,
      tag: Units.above(up), arrow: Symbols.climb(vu), off };
  }
  // Writes the relative altitude above or below a symbol; returns the words beside it, which hold
  // the altitude as well where there was no room for it.
  function tag(c, one, scene, outer, apart) {
    const colour = Symbols.ink(one.level), halo = Symbols.colours.ground;
    // In a hand there is room for names only: the level is told by the symbol, list and banner.
    const word = one.level && outer > NARROW ? ` ${Symbols.WORDS[Math.min(one.level, 3)]}` : "";
    const whole = scene.name(one.number);
    const name = whole.length > LONGEST ? `${whole.slice(0, LONGEST - 1)}…` : whole;
    const height = `${one.tag}${one.arrow}`, x = one.x - Labels.width(c, height) / 2;
    const written = Labels.place(c, height, x, one.above ? one.y - apart - 4 : one.y + apart + 14,
      colour, halo);
    return `${name}${word}${written ? "" : ` ${height}`}`;
  }

  return { canvas, draw, zoom, fit, hold, range };
})();
