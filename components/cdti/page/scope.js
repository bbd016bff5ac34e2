"use strict";
// The traffic display: ownship in the middle, its heading up.
const Scope = (() => {
  const canvas = document.getElementById("scope");
  const RANGES_M = [500, 1000, 2000, 4000, 6000, 8000, 10000, 15000, 20000, 40000, 80000];
  const rad = Math.PI / 180;
  const MOST_TAGS = 40;
  let place = 5;
  let bug = null;

  function zoom(step) { place = Math.min(Math.max(place + step, 0), RANGES_M.length - 1); }
  // A range at which the sensors' reach and what they see fit.
  function fit(sensors) {
    const far = Math.max(0, ...sensors.map((s) => s.range || 0));
    if (far > 0) place = Math.max(RANGES_M.findIndex((r) => r >= far * 0.999), 0);
    if (far > RANGES_M[RANGES_M.length - 1]) place = RANGES_M.length - 1;
  }

  function draw(frame, scene, chosen, drawn) {
    const c = Canvas.ready(canvas);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const x0 = width / 2, y0 = height / 2;
    const outer = Math.max(Math.min(width, height) / 2 - 34, 20);
    const range = RANGES_M[place];
    const scale = outer / range;
    const heading = frame.own.heading;
    const at = (bearing, far) => {
      const angle = (bearing - heading) * rad;
      return [x0 + far * scale * Math.sin(angle), y0 - far * scale * Math.cos(angle)];
    };
    drawn.range = range;
    rings(c, x0, y0, outer, range, heading);
    c.save();
    c.beginPath();
    c.arc(x0, y0, outer, 0, 2 * Math.PI);
    c.clip();
    for (const one of frame.area) wedge(c, at, one, range, 1.5);
    if (frame.area.length) hatch(c, x0, y0, outer, frame.area, at, range);
    for (const sensor of scene.sensors) reach(c, x0, y0, scale, sensor);
    c.restore();
    for (const one of frame.bands) band(c, x0, y0, outer, heading, one);
    if (bug !== null) {
      const [x, y] = at(bug, range * 1.03);
      c.beginPath();
      c.arc(x, y, 5, 0, 2 * Math.PI);
      c.strokeStyle = Symbols.colours.own;
      c.lineWidth = 2;
      c.stroke();
    }
    drawn.lines = [];
    drawn.symbols = [];
    for (const one of frame.contacts) {
      if (one[1] === null) line(c, at, one, range, scene, chosen, drawn);
    }
    const ranged = frame.contacts.filter((one) => one[1] !== null);
    ranged.sort((a, b) => a[9] - b[9]);
    const tagged = new Set(ranged.slice(-MOST_TAGS));
    for (const one of ranged) {
      symbol(c, x0, y0, scale, outer, heading, one, scene, chosen, drawn, tagged.has(one));
    }
    Symbols.own(c, x0, y0, 12);
    drawn.area = frame.area.length;
    drawn.bands = frame.bands;
  }

  function rings(c, x0, y0, outer, range, heading) {
    const colours = Symbols.colours;
    c.lineWidth = 1;
    for (let part = 1; part <= 4; part++) {
      c.beginPath();
      c.arc(x0, y0, (outer * part) / 4, 0, 2 * Math.PI);
      c.strokeStyle = part === 4 ? colours.faint : colours.line;
      c.stroke();
      if (part === 4) break;
      const words = `${+((range * part) / 4000).toFixed(2)} km`;
      Canvas.text(c, words, x0 + ((outer * part) / 4) * 0.7071 + 3, y0 + ((outer * part) / 4) * 0.7071,
        colours.faint);
    }
    for (let mark = 0; mark < 360; mark += 10) {
      const angle = (mark - heading) * rad;
      const long = mark % 30 === 0 ? 9 : 4;
      c.beginPath();
      c.moveTo(x0 + outer * Math.sin(angle), y0 - outer * Math.cos(angle));
      c.lineTo(x0 + (outer - long) * Math.sin(angle), y0 - (outer - long) * Math.cos(angle));
      c.strokeStyle = colours.faint;
      c.stroke();
      const fromTop = Math.abs(((mark - heading + 540) % 360) - 180);
      if (mark % 30 === 0 && fromTop > 8) {
        Canvas.text(c, String(mark / 10).padStart(2, "0"), x0 + (outer + 10) * Math.sin(angle),
          y0 - (outer + 10) * Math.cos(angle) + 4, colours.faint, "center");
      }
    }
    Canvas.text(c, `range ${+(range / 1000).toFixed(2)} km`, canvas.clientWidth - 8,
      canvas.clientHeight - 8, colours.ink, "right");
    const words = `${String(Math.round(heading) % 360).padStart(3, "0")}°`;
    c.fillStyle = colours.ground;
    c.fillRect(x0 - 24, y0 - outer - 32, 48, 20);
    c.strokeStyle = colours.ink;
    c.strokeRect(x0 - 24, y0 - outer - 32, 48, 20);
    Canvas.text(c, words, x0, y0 - outer - 17, colours.ink, "center", 14);
  }

  // Detection range: EO in blue, unbroken; radar in green, dashed; IR in violet, dotted.
  const DASHES = { eo: [], radar: [10, 5], ir: [2, 4] };
  function reach(c, x0, y0, scale, sensor) {
    if (!sensor.range || !sensor.azimuth) return;
    let [low, high] = sensor.azimuth;
    while (high <= low) high += 360;
    const whole = high - low >= 359.9;
    const from = (low - 90) * rad, to = (high - 90) * rad, r = sensor.range * scale;
    c.beginPath();
    if (!whole) c.moveTo(x0, y0);
    c.arc(x0, y0, r, from, to);
    if (!whole) c.closePath();
    c.setLineDash(DASHES[sensor.kind]);
    c.strokeStyle = Symbols.colours[sensor.kind];
    c.lineWidth = 2;
    c.stroke();
    c.setLineDash([]);
    const words = `${sensor.name} ${+(sensor.range / 1000).toFixed(1)} km`;
    const side = sensor.kind === "radar" ? low + (high - low) * 0.2 : low + (high - low) * 0.8;
    const angle = side * rad;
    Canvas.text(c, words, x0 + (r - 34) * Math.sin(angle), y0 - (r - 14) * Math.cos(angle),
      Symbols.colours[sensor.kind], "center");
  }

  // Directions in which separation would be lost, inside the outer ring: the thicker the more urgent.
  const BANDS = { FAR: ["symbol-caution", 3, []], MID: ["symbol-caution", 6, []],
    NEAR: ["symbol-warning", 9, []], RECOVERY: ["sight", 6, [6, 4]] };
  function band(c, x0, y0, outer, heading, [low, high, region]) {
    const [colour, width, dash] = BANDS[region] || BANDS.FAR;
    c.beginPath();
    c.arc(x0, y0, outer - 2 - width / 2, (low - heading - 90) * rad, (high - heading - 90) * rad);
    c.strokeStyle = Symbols.colours[colour];
    c.lineWidth = width;
    c.setLineDash(dash);
    c.stroke();
    c.setLineDash([]);
  }

  function edge(c, at, one, range, half) {
    const [bearing, near, far] = one;
    const end = Math.min(far, range * 1.05);
    c.moveTo(...at(bearing - half, near));
    c.lineTo(...at(bearing - half, end));
    c.lineTo(...at(bearing + half, end));
    c.lineTo(...at(bearing + half, near));
    c.closePath();
  }
  function wedge(c, at, one, range, half) {
    c.beginPath();
    edge(c, at, one, range, half);
    c.globalAlpha = 0.28;
    c.fillStyle = Symbols.colours["symbol-warning"];
    c.fill();
    c.globalAlpha = 1;
  }
  function hatch(c, x0, y0, outer, area, at, range) {
    c.save();
    c.beginPath();
    for (const one of area) edge(c, at, one, range, 1.55);
    c.clip("nonzero");
    c.beginPath();
    for (let d = -2 * outer; d < 2 * outer; d += 9) {
      c.moveTo(x0 + d - outer, y0 - outer);
      c.lineTo(x0 + d + outer, y0 + outer);
    }
    c.strokeStyle = Symbols.colours["symbol-warning"];
    c.lineWidth = 1;
    c.stroke();
    c.restore();
  }

  function line(c, at, one, range, scene, chosen, drawn) {
    const [number, , , , bearing, , , , , level] = one;
    const [x1, y1] = at(bearing, 0), [x2, y2] = at(bearing, range);
    c.beginPath();
    c.moveTo(x1, y1);
    c.lineTo(x2, y2);
    c.strokeStyle = Symbols.colours.sight;
    c.lineWidth = number === chosen ? 3 : 1.5;
    c.stroke();
    const [x, y] = at(bearing, range * 0.9);
    const left = x > canvas.clientWidth / 2;
    Canvas.text(c, `${scene.name(number)} no range`, left ? x - 8 : x + 8, y,
      Symbols.colours.sight, left ? "right" : "left");
    drawn.lines.push({ number, bearing, level });
  }

  function symbol(c, x0, y0, scale, outer, heading, one, scene, chosen, drawn, tagged) {
    const [number, east, north, up, , , ve, vn, vu, level] = one;
    const turn = -heading * rad;
    const right = east * Math.cos(turn) + north * Math.sin(turn);
    const ahead = north * Math.cos(turn) - east * Math.sin(turn);
    let x = right * scale, y = -ahead * scale;
    const far = Math.hypot(x, y);
    const off = far > outer;
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
      c.strokeRect(x - 15, y - 15, 30, 30);
    }
    const tag = Symbols.altitude(up), arrow = Symbols.climb(vu);
    const colour = level >= 3 ? Symbols.colours.warning
      : level > 0 ? Symbols.colours.caution : Symbols.colours.traffic;
    if (tagged) {
      Canvas.text(c, tag, x, up >= 0 ? y - 19 : y + 29, colour, "center");
      if (arrow) Canvas.text(c, arrow, x + 17, y + 5, colour, "left", 16);
      const words = level ? `${scene.name(number)} ${Symbols.WORDS[Math.min(level, 3)]}`
        : scene.name(number);
      const low = y + (up >= 0 ? 16 : -8), away = arrow ? 28 : 20;
      c.font = "12px system-ui, sans-serif";
      const fits = x + away + c.measureText(words).width < canvas.clientWidth;
      Canvas.text(c, words, fits ? x + away : x - 20, low, colour, fits ? "left" : "right");
    }
    drawn.symbols.push({ number, x, y, level, shape: Symbols.shape(level, course !== null), tag,
      arrow, off });
  }

  return { canvas, draw, zoom, fit, set bug(value) { bug = value; } };
})();
