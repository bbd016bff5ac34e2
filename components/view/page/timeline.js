"use strict";
// Scans of every sensor on its own clock, alerts and manoeuvres, and the cursor of time.
const Timeline = (() => {
  const canvas = document.getElementById("timeline");
  const left = 70;
  let still = null;

  function x(t) {
    return left + (t / (Data.duration_s || 1)) * (canvas.clientWidth - left - 10);
  }
  function timeAt(pixel) {
    const part = (pixel - left) / (canvas.clientWidth - left - 10);
    return Math.min(Math.max(part, 0), 1) * Data.duration_s;
  }

  function rows() {
    const found = Data.sensors.map((sensor, number) => ({ name: sensor.name, number }));
    if (Data.tables.alerts) found.push({ name: "alerts" });
    if (Data.tables.manoeuvres) found.push({ name: "steered" });
    return found;
  }

  // What does not move is drawn once for each size and theme.
  function drawStill() {
    const copy = document.createElement("canvas");
    const ratio = window.devicePixelRatio || 1;
    copy.width = Math.round(canvas.clientWidth * ratio);
    copy.height = Math.round(canvas.clientHeight * ratio);
    const c = copy.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const all = rows();
    const high = (canvas.clientHeight - 18) / Math.max(1, all.length);
    all.forEach((row, place) => {
      const top = place * high + 2, low = top + high - 4;
      Canvas.text(c, row.name.slice(0, 11), 4, (top + low) / 2 + 4, Symbols.colours.ink);
      if (row.number !== undefined) scansOf(c, row.number, top, low);
      else if (row.name === "alerts") alertsOf(c, top, low);
      else for (const t of Data.tables.manoeuvres.time_s) tick(c, t, top, low, Symbols.colours.own, 2);
    });
    const step = Symbols.niceStep(Data.duration_s / Math.max(2, canvas.clientWidth / 90));
    for (let t = 0; t <= Data.duration_s; t += step) {
      Canvas.text(c, `${+(t + Data.start_s).toFixed(3)} s`, Math.min(x(t), canvas.clientWidth - 20), canvas.clientHeight - 4,
        Symbols.colours.faint, "center");
    }
    still = { copy, width: canvas.clientWidth, height: canvas.clientHeight, ratio };
  }
  function tick(c, t, top, low, colour, wide) {
    c.fillStyle = colour;
    c.fillRect(x(t) - wide / 2, top, wide, low - top);
  }
  function scansOf(c, number, top, low) {
    const times = Data.scanTimes[number], detected = Data.scanDetected[number];
    for (let i = 0; i < times.length; i++) tick(c, times[i], low - 3, low, Symbols.colours.line, 1);
    for (let i = 0; i < times.length; i++) {
      if (detected[i]) tick(c, times[i], top, low, Data.sensors[number].colour, 1);
    }
  }
  function alertsOf(c, top, low) {
    const a = Data.tables.alerts;
    const highest = new Map();
    for (let i = 0; i < a.count; i++) {
      highest.set(a.time_s[i], Math.max(a.level[i], highest.get(a.time_s[i]) || 0));
    }
    for (const [t, level] of highest) {
      if (level > 0) tick(c, t, low - ((low - top) * Math.min(level, 3)) / 3, low, Symbols.level(level), 3);
    }
  }

  function draw(t) {
    const ratio = window.devicePixelRatio || 1;
    if (!still || still.width !== canvas.clientWidth || still.height !== canvas.clientHeight
        || still.ratio !== ratio) drawStill();
    const c = Canvas.ready(canvas);
    c.drawImage(still.copy, 0, 0, canvas.clientWidth, canvas.clientHeight);
    c.fillStyle = Symbols.colours.own;
    c.fillRect(x(t) - 1, 0, 2, canvas.clientHeight - 16);
    canvas.setAttribute("aria-valuemax", String(Data.duration_s));
    canvas.setAttribute("aria-valuenow", t.toFixed(3));
    canvas.setAttribute("aria-valuetext", `${(t + Data.start_s).toFixed(2)} s`);
  }
  function forget() { still = null; }
  return { canvas, draw, timeAt, forget };
})();
