"use strict";
// What contacts are seen against: rings and compass, the reach of sensors, where not to fly.
const Rose = (() => {
  const rad = Math.PI / 180;
  const WINDS = { 0: "N", 90: "E", 180: "S", 270: "W" };

  function rings(c, x0, y0, outer, heading) {
    c.lineWidth = 1;
    for (let part = 1; part <= 4; part++) {
      c.beginPath();
      c.arc(x0, y0, (outer * part) / 4, 0, 2 * Math.PI);
      c.strokeStyle = part === 4 ? Symbols.colours.faint : Symbols.colours.line;
      c.stroke();
    }
    c.strokeStyle = Symbols.colours.faint;
    for (let mark = 0; mark < 360; mark += 10) {
      const angle = (mark - heading) * rad, long = mark % 30 === 0 ? 9 : 4;
      c.beginPath();
      c.moveTo(x0 + outer * Math.sin(angle), y0 - outer * Math.cos(angle));
      c.lineTo(x0 + (outer - long) * Math.sin(angle), y0 - (outer - long) * Math.cos(angle));
      c.stroke();
    }
  }
  // The words of rings and compass, after all that could cover them.
  function words(c, x0, y0, outer, range, heading) {
    const { faint, ink, ground } = Symbols.colours;
    for (const part of outer < 150 ? [2] : [1, 2, 3]) {
      const from = (outer * part) / 4;
      Labels.add(Units.range((range * part) / 4), x0 + from * 0.7071, y0 + from * 0.7071, 3, 0,
        faint, 1);
    }
    for (let mark = 0; mark < 360; mark += 30) {
      const angle = (mark - heading) * rad;
      // The window of the heading hides what is under it.
      if (Math.abs((outer + 12) * Math.sin(angle)) < 36 && Math.cos(angle) > 0) continue;
      const text = WINDS[mark] || String(mark / 10).padStart(2, "0");
      Labels.keep(c, text, x0 + (outer + 12) * Math.sin(angle) - Labels.width(c, text) / 2,
        y0 - (outer + 12) * Math.cos(angle) + 4, WINDS[mark] ? ink : faint, ground);
    }
    c.fillStyle = ground;
    c.fillRect(x0 - 24, y0 - outer - 29, 48, 20);
    c.strokeStyle = ink;
    c.lineWidth = 1;
    c.strokeRect(x0 - 24, y0 - outer - 29, 48, 20);
    Canvas.text(c, Units.heading(heading), x0, y0 - outer - 14, ink, "center", 14);
    Labels.block(x0, y0 - outer - 19, 24, 10);
  }

  // Detection ranges: EO unbroken, radar dashed, IR dotted, each in a colour of its own.
  const DASHES = { eo: [], radar: [10, 5], ir: [2, 4] };
  function reach(c, x0, y0, scale, sensor) {
    if (!sensor.range || !sensor.azimuth) return;
    let [low, high] = sensor.azimuth;
    while (high <= low) high += 360;
    const whole = high - low >= 359.9, r = sensor.range * scale;
    c.beginPath();
    if (!whole) c.moveTo(x0, y0);
    c.arc(x0, y0, r, (low - 90) * rad, (high - 90) * rad);
    if (!whole) c.closePath();
    c.setLineDash(DASHES[sensor.kind]);
    c.strokeStyle = Symbols.colours[sensor.kind];
    c.lineWidth = 2;
    c.stroke();
    c.setLineDash([]);
  }
  function reachWords(x0, y0, scale, outer, sensor) {
    if (!sensor.range || !sensor.azimuth || sensor.range * scale > outer) return;
    let [low, high] = sensor.azimuth;
    while (high <= low) high += 360;
    const angle = (low + (high - low) * (sensor.kind === "radar" ? 0.2 : 0.8)) * rad;
    const r = sensor.range * scale - 8;
    Labels.add(`${sensor.name} ${Units.range(sensor.range)}`, x0 + r * Math.sin(angle),
      y0 - r * Math.cos(angle), 3, 4, Symbols.colours[sensor.kind], 3);
  }

  // Guidance: the thicker, the more urgent; dashes where a recovery leads. Tapes paint alike.
  const BANDS = { FAR: ["symbol-caution", 3, []], MID: ["symbol-caution", 6, []],
    NEAR: ["symbol-warning", 9, []], RECOVERY: ["recovery", 6, [6, 4]] };
  function painted(region) { return BANDS[region] || BANDS.FAR; }
  function band(c, x0, y0, outer, heading, [low, high, region]) {
    const [colour, width, dash] = painted(region);
    c.beginPath();
    c.arc(x0, y0, outer - 2 - width / 2, (low - heading - 90) * rad, (high - heading - 90) * rad);
    c.strokeStyle = Symbols.colours[colour];
    c.lineWidth = width;
    c.setLineDash(dash);
    c.stroke();
    c.setLineDash([]);
  }

  // Names keep clear of a band.
  function blockBand(x0, y0, outer, heading, [low, high, region]) {
    const wide = painted(region)[1], r = outer - 2 - wide / 2, step = 5 / (r * rad);
    for (let bearing = low; bearing <= high + step; bearing += step) {
      const angle = (Math.min(bearing, high) - heading) * rad;
      Labels.block(x0 + r * Math.sin(angle), y0 - r * Math.cos(angle), wide / 2 + 1, wide / 2 + 1);
    }
  }

  // The area of a loss: where the ownship would be inside a volume, if it turned there at once.
  function edge(c, at, [bearing, near, far], range, half) {
    const end = Math.min(far, range * 1.05);
    c.moveTo(...at(bearing - half, near));
    c.lineTo(...at(bearing - half, end));
    c.lineTo(...at(bearing + half, end));
    c.lineTo(...at(bearing + half, near));
    c.closePath();
  }
  function area(c, x0, y0, outer, every, at, range) {
    if (!every.length) return;
    c.fillStyle = c.strokeStyle = Symbols.colours["symbol-caution"];
    c.globalAlpha = 0.2;
    for (const one of every) {
      c.beginPath();
      edge(c, at, one, range, 1.5);
      c.fill();
    }
    c.globalAlpha = 1;
    c.save();
    c.beginPath();
    for (const one of every) edge(c, at, one, range, 1.55);
    c.clip("nonzero");
    hatch(c, x0 - outer, y0 - outer, 2 * outer, 2 * outer);
    c.restore();
  }
  function hatch(c, left, top, wide, high) {
    c.beginPath();
    for (let d = -high; d < wide; d += 9) {
      c.moveTo(left + d, top);
      c.lineTo(left + d + high, top + high);
    }
    c.lineWidth = 1;
    c.stroke();
  }
  return { rings, words, reach, reachWords, painted, band, blockBand, area, hatch, DASHES };
})();
