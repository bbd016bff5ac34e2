"use strict";
// Altitudes over the horizontal distance from the ownship.
const Altitude = (() => {
  const canvas = document.getElementById("altitude");

  function draw(t, options) {
    const c = Canvas.ready(canvas);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const own = Data.ownship(t);
    const marks = [];
    const add = (east, north, alt, how) => {
      if (Number.isFinite(alt)) {
        marks.push({ far: Math.hypot(east - own.east, north - own.north), alt, ...how });
      }
    };
    if (options.truth) {
      for (const one of Data.truths(t)) add(one.east, one.north, one.alt, { truth: true });
    }
    const d = Data.tables.detections;
    const [from, to] = Data.recent("detections", t, options.fade);
    for (let i = from; i < to; i++) {
      if (options.sensors.has(d.sensor[i])) {
        add(d.east_m[i], d.north_m[i], d.alt_m[i], { sensor: Data.sensors[d.sensor[i]] });
      }
    }
    const far = marks.reduce((most, m) => Math.max(most, m.far), 1000) * 1.1;
    const apart = marks.reduce((most, m) => Math.max(most, Math.abs(m.alt - own.alt)), 100) * 1.2;
    const left = 65, bottom = 18;
    const x = (m) => left + (m / far) * (width - left - 6);
    const y = (alt) => (height - bottom) / 2 - ((alt - own.alt) / apart) * ((height - bottom) / 2 - 4);
    c.strokeStyle = Symbols.colours.line;
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(left, y(own.alt)); c.lineTo(width, y(own.alt));
    c.moveTo(left, 0); c.lineTo(left, height - bottom);
    c.stroke();
    const step = Symbols.niceStep(far / 4);
    Canvas.font(c);
    for (let m = step; m < far; m += step) {
      const words = `${+(m / 1000).toFixed(2)} km`;
      const last = x(m) + c.measureText(words).width / 2 > width;  // its middle is too near the edge
      Canvas.text(c, words, last ? width : x(m), height - 4, Symbols.colours.faint,
        last ? "right" : "center");
    }
    for (const up of [-apart / 1.2, 0, apart / 1.2]) {
      Canvas.text(c, `${Math.round(own.alt + up)} m`, left - 11, y(own.alt + up) + 4,
        Symbols.colours.faint, "right");
    }
    if (options.bands) {  // altitudes that lose separation, beside the scale
      for (const one of Data.bandsAt(t)) {
        if (!Number.isFinite(one.low_m)) continue;
        const top = Math.max(y(one.high_m), 0), low = Math.min(y(one.low_m), height - bottom);
        const { colour, dash } = Symbols.region(one.region);
        c.strokeStyle = colour;
        c.lineWidth = 2 + 2 * Math.min(one.region, 3);
        c.setLineDash(dash);
        c.beginPath(); c.moveTo(left + 6, top); c.lineTo(left + 6, low); c.stroke();
      }
      c.setLineDash([]);
    }
    const batch = new Symbols.Batch();
    for (const m of marks) {
      const colour = m.truth ? Symbols.colours.truth : m.sensor.colour;
      Symbols.outline(batch.path(colour, 1, Boolean(m.truth)), m.truth ? "s" : m.sensor.marker,
        x(m.far), y(m.alt), m.truth ? 2 : 4);
    }
    batch.draw(c);
    Symbols.aircraft(c, left, y(own.alt), Math.PI / 2, 7, Symbols.colours.own);
  }
  return { draw };
})();
