"use strict";
// Tapes of speed and altitude beside the traffic, with their bands of guidance and commands.
const Tapes = (() => {
  const get = (id) => document.getElementById(id);

  // Marks grow upward; bands lie at the edge that is next to the traffic.
  function tape(canvas, kind, value, [half, step, numbered], bands, bug, left) {
    const c = Canvas.ready(canvas);
    const width = canvas.clientWidth, height = canvas.clientHeight, middle = height / 2;
    if (!width || !height) return;
    const { ink, faint, ground } = Symbols.colours;
    const at = (shown) => middle - ((shown - value) * middle) / half;
    const edge = left ? width - 1 : 1, inward = left ? -1 : 1;
    c.strokeStyle = faint;
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(edge, 0);
    c.lineTo(edge, height);
    c.stroke();
    for (const [low, high, region] of bands) {
      const [colour, wide, dash] = Rose.painted(region), x = edge + inward * (2 + wide / 2);
      const from = Math.min(at(Units.of(kind, low)), height), to = Math.max(at(Units.of(kind, high)), 0);
      if (from <= to) continue;
      c.beginPath();
      c.moveTo(x, from);
      c.lineTo(x, to);
      c.strokeStyle = Symbols.colours[colour];
      c.lineWidth = wide;
      c.setLineDash(dash);
      c.stroke();
      c.setLineDash([]);
    }
    c.lineWidth = 1;
    c.strokeStyle = faint;
    for (let mark = Math.ceil((value - half) / step) * step; mark <= value + half; mark += step) {
      if (kind === "speed" && mark < 0) continue;
      const y = at(mark), long = mark % numbered === 0;
      c.beginPath();
      c.moveTo(edge, y);
      c.lineTo(edge + inward * (long ? 13 : 8), y);
      c.stroke();
      // The window with the value hides what is behind it.
      if (!long || Math.abs(y - middle) < 22 || y < 8 || y > height - 4) continue;
      Canvas.text(c, String(mark), edge + inward * 17, y + 4, faint, left ? "right" : "left", 12, ground);
    }
    if (bug !== null) {
      Symbols.bug(c, edge + inward * 9, Math.min(Math.max(at(Units.of(kind, bug)), 6), height - 6));
    }
    c.strokeStyle = ink;
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(edge, middle);
    c.lineTo(edge + inward * 14, middle);
    c.stroke();
  }
  function say(id, text) {
    if (get(id).textContent !== text) get(id).textContent = text;
  }
  // `wanted` is the altitude that a climb leads to, m, or null.
  function draw(own, bands, wanted, drawn) {
    const system = Units.system;
    tape(get("speed-tape"), "speed", Units.of("speed", own.speed), system.speeds, bands.speed, null,
      true);
    tape(get("altitude-tape"), "height", Units.of("height", own.alt), system.heights, bands.altitude,
      wanted, false);
    say("speed", String(Math.round(Units.of("speed", own.speed))));
    say("altitude", String(Math.round(Units.of("height", own.alt))));
    say("climb", Units.rate(own.climb));
    drawn.wanted = wanted;
  }
  function units() {
    say("speed-unit", Units.unit("speed"));
    say("altitude-unit", Units.unit("height"));
    say("climb-unit", Units.unit("rate"));
  }
  return { draw, units };
})();
