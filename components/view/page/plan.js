"use strict";
// The plan: east and north of the start, north or heading up.
const Plan = (() => {
  const canvas = document.getElementById("plan");
  const MOST_NAMES = 100;  // of many aircraft the nearest are named
  const STEPS = 5;  // how many lines a name may stand away from what it names
  const LINES_FADE = 1;  // lines cover much of the plan, and fade soon
  const view = { east: 0, north: 0, perPixel: 40, turn: 0, width: 1, height: 1 };
  // Every aircraft has one name on the plan, whoever knows it: by the name, where and how far.
  const names = new Map();
  function name(words, x, y, far, colour, level = 0) {
    const known = names.get(words);
    if (!known) names.set(words, { words, x, y, far, colour, level });
    else if (level > known.level) Object.assign(known, { colour, level });
  }
  function writeNames(own) {
    const [x, y] = place(own.east, own.north);
    Labels.block(x, y, 11, 11);
    // Alerts have the first choice of room, then who is near.
    const all = [...names.values()].sort((a, b) => a.level - b.level || b.far - a.far);
    for (const one of all.slice(-MOST_NAMES)) Labels.block(one.x, one.y, 5, 5);
    for (const one of all.slice(-MOST_NAMES)) {
      const words = one.level ? `${one.words} · alert ${one.level}` : one.words;
      Labels.add(words, one.x, one.y, one.level ? 17 : 11, 4, one.colour, STEPS);
    }
    names.clear();
    return all.length;
  }

  function place(east, north) {
    const x = (east - view.east) / view.perPixel;
    const y = (north - view.north) / view.perPixel;
    const cos = Math.cos(view.turn), sin = Math.sin(view.turn);
    return [view.width / 2 + x * cos - y * sin, view.height / 2 - (x * sin + y * cos)];
  }
  function inside(x, y) {
    return x > -20 && y > -20 && x < view.width + 20 && y < view.height + 20;
  }

  function rings(c, own) {
    const step = Symbols.niceStep(70 * view.perPixel);
    const [x, y] = place(own.east, own.north);
    const far = view.perPixel * Math.hypot(view.width, view.height);
    c.lineWidth = 1;
    for (let i = 1; i * step < far; i++) {
      c.strokeStyle = Symbols.colours.line;
      c.beginPath();
      c.arc(x, y, (i * step) / view.perPixel, 0, 2 * Math.PI);
      c.stroke();
    }
    return step;
  }
  // Behind the ownship, where less is to be seen.
  function ringWords(c, own, step) {
    const [x, y] = place(own.east, own.north);
    for (let i = 1; (i * step) / view.perPixel < view.height; i++) {
      const km = (i * step) / 1000;
      Labels.keep(c, `${km < 1 ? km.toFixed(2) : +km.toFixed(1)} km`, x + 3,
        y + (i * step) / view.perPixel - 4, Symbols.colours.faint, Symbols.colours.ground);
    }
  }

  function fields(c, t, shown) {
    Data.sensors.forEach((sensor, number) => {
      if (!shown.has(number) || !sensor.azimuth_deg) return;
      const own = Data.carrier(sensor, t);
      const [x, y] = place(own.east, own.north);
      const [low, high] = sensor.azimuth_deg.map((deg) => (deg * Math.PI) / 180);
      const around = high - low >= 2 * Math.PI - 1e-6;
      const far = view.perPixel * Math.hypot(view.width, view.height);
      const radius = Math.min(sensor.range_m || far, far) / view.perPixel;
      const nose = own.heading - view.turn - Math.PI / 2;
      c.save();
      c.beginPath();
      if (!around) c.moveTo(x, y);
      c.arc(x, y, radius, nose + low, nose + high);
      if (!around) c.closePath();
      c.strokeStyle = sensor.colour;
      c.lineWidth = 1;
      c.setLineDash(sensor.range_m ? [] : [5, 5]);
      if (sensor.range_m) {
        c.globalAlpha = 0.06;
        c.fillStyle = sensor.colour;
        c.fill();
      }
      c.globalAlpha = 0.6;
      c.stroke();
      c.restore();
    });
  }

  // Where a sweeping beam looks: clockwise over the field of view, once from each scan on.
  function beam(c, t, number, drawn) {
    const sensor = Data.sensors[number], times = Data.scanTimes[number];
    const own = Data.carrier(sensor, t);
    const last = Data.after(times, t) - 1;
    if (!sensor.sweep_s || !sensor.azimuth_deg || last < 0) return;
    const part = (t - times[last]) / sensor.sweep_s;
    if (part > 1) return;
    let [low, high] = sensor.azimuth_deg;
    while (high <= low) high += 360;
    const azimuth_deg = low + part * (high - low);
    const bearing = own.heading + (azimuth_deg * Math.PI) / 180;
    const far = sensor.range_m || view.perPixel * Math.hypot(view.width, view.height);
    const [x, y] = place(own.east, own.north);
    const [u, v] = place(own.east + far * Math.sin(bearing), own.north + far * Math.cos(bearing));
    c.strokeStyle = sensor.colour;
    c.lineWidth = 2;
    c.beginPath(); c.moveTo(x, y); c.lineTo(u, v); c.stroke();
    drawn.beams.push({ sensor: sensor.name, azimuth_deg });
  }

  // Directions in which separation would be lost, around the ownship: thicker the nearer.
  function bands(c, t, own, drawn) {
    const [x, y] = place(own.east, own.north);
    drawn.bands = Data.bandsAt(t);
    for (const one of drawn.bands) {
      if (!Number.isFinite(one.low_rad)) continue;
      const { colour, dash } = Symbols.region(one.region);
      c.beginPath();
      c.arc(x, y, 60 + 4 * one.region, one.low_rad - view.turn - Math.PI / 2,
        one.high_rad - view.turn - Math.PI / 2);
      c.strokeStyle = colour;
      c.lineWidth = 2 + 2 * Math.min(one.region, 3);
      c.setLineDash(dash);
      c.stroke();
    }
    c.setLineDash([]);
  }

  function truth(c, t, own, drawn) {
    c.strokeStyle = Symbols.colours.truth;
    c.lineWidth = 1;
    c.beginPath();
    for (const one of Data.truths(t)) {
      const [x, y] = place(one.east, one.north);
      if (!inside(x, y)) continue;
      if (drawn.truth) drawn.truth.push({ target: one.target, east: one.east, north: one.north });
      c.moveTo(x - 4, y); c.lineTo(x + 4, y);
      c.moveTo(x, y - 4); c.lineTo(x, y + 4);
      if (one.rate) {  // where it will be in ten seconds
        const [u, v] = place(one.east + 10 * one.rate[0], one.north + 10 * one.rate[1]);
        c.moveTo(x, y); c.lineTo(u, v);
      }
      name(Data.targets[one.target], x, y, away(one, own), Symbols.colours.faint);
    }
    c.stroke();
  }

  function away(one, own) {
    return Math.hypot(one.east - own.east, one.north - own.north);
  }

  function detections(c, t, options, drawn) {
    const d = Data.tables.detections;
    const [from, to] = Data.recent("detections", t, options.fade);
    const far = view.perPixel * Math.hypot(view.width, view.height);
    const batch = new Symbols.Batch();
    for (let i = from; i < to; i++) {
      const number = d.sensor[i];
      if (!options.sensors.has(number)) continue;
      const sensor = Data.sensors[number];
      const ranged = Number.isFinite(d.east_m[i]);
      if (drawn.detections) {
        drawn.detections.push({
          sensor: sensor.name, target: Data.targets[d.target[i]] ?? null, time_s: d.time_s[i],
          ranged, east_m: d.east_m[i], north_m: d.north_m[i], bearing_rad: d.bearing_rad[i],
        });
      }
      if (ranged) {
        const [x, y] = place(d.east_m[i], d.north_m[i]);
        if (!inside(x, y)) continue;
        const alpha = Math.max(0.12, 1 - (t - d.time_s[i]) / options.fade);
        Symbols.outline(batch.path(sensor.colour, alpha, d.target[i] >= 0), sensor.marker, x, y, 5);
      } else if (Number.isFinite(d.bearing_rad[i]) && t - d.time_s[i] < LINES_FADE) {
        const alpha = Math.max(0.15, 1 - (t - d.time_s[i]) / LINES_FADE);
        const [x, y] = place(d.from_east_m[i], d.from_north_m[i]);
        const [u, v] = place(d.from_east_m[i] + far * Math.sin(d.bearing_rad[i]),
          d.from_north_m[i] + far * Math.cos(d.bearing_rad[i]));
        const path = batch.path(sensor.colour, alpha, false, 1);
        path.moveTo(x, y);
        path.lineTo(u, v);
      }
    }
    batch.draw(c);
  }

  function ellipse(path, x, y, track) {
    // 95 % of a normal distribution in two dimensions lie within 2.448 standard deviations.
    const { xx, xy, yy } = track;
    const mean = (xx + yy) / 2, part = Math.hypot((xx - yy) / 2, xy);
    const long = 2.448 * Math.sqrt(Math.max(mean + part, 0)) / view.perPixel;
    const short = 2.448 * Math.sqrt(Math.max(mean - part, 0)) / view.perPixel;
    const turn = -0.5 * Math.atan2(2 * xy, xx - yy) - view.turn;
    path.moveTo(x + long * Math.cos(turn), y + long * Math.sin(turn));
    path.ellipse(x, y, long, short, turn, 0, 2 * Math.PI);
  }

  // A track without a range: a dashed line with its name a third of the way to the edge.
  function directionOnly(c, k, i, label, colour) {
    if (!Number.isFinite(k.bearing_rad[i])) return;
    const far = view.perPixel * Math.hypot(view.width, view.height);
    const at = (away) => place(k.from_east_m[i] + away * Math.sin(k.bearing_rad[i]),
      k.from_north_m[i] + away * Math.cos(k.bearing_rad[i]));
    const [x, y] = at(0), [u, v] = at(far), [p, q] = at(0.16 * far);
    c.strokeStyle = colour;
    c.setLineDash([8, 4]);
    c.beginPath(); c.moveTo(x, y); c.lineTo(u, v); c.stroke();
    c.setLineDash([]);
    if (label) name(label, p, q, Infinity, colour);
  }

  function tracks(c, t, own, trackers, drawn) {
    const k = Data.tables.tracks;
    c.lineWidth = 1.5;
    const sure = new Symbols.Batch(), tentative = new Symbols.Batch();
    for (const i of Data.standing("tracks", t)) {
      const source = k.source ? Math.max(k.source[i], 0) : 0;
      if (!trackers.has(source)) continue;
      const colour = Symbols.tracker(source);
      const label = k.number ? Data.trackName(k.number[i], k.source ? k.source[i] : -1) : Data.targets[k.target[i]];
      if (drawn.tracks) {
        drawn.tracks.push({ label, time_s: k.time_s[i], east_m: k.east_m[i],
          north_m: k.north_m[i] });
      }
      if (!Number.isFinite(k.east_m[i])) {
        directionOnly(c, k, i, label, colour);
        continue;
      }
      const [x, y] = place(k.east_m[i], k.north_m[i]);
      if (!inside(x, y)) continue;
      const path = (k.tentative && k.tentative[i] ? tentative : sure).path(colour, 1, false);
      Symbols.outline(path, "D", x, y, 8);
      if (k.variance_east_m2) {
        ellipse(path, x, y, { xx: k.variance_east_m2[i], yy: k.variance_north_m2[i],
          xy: k.covariance_m2[i] });
      }
      if (k.east_mps && Number.isFinite(k.east_mps[i])) {
        const [u, v] = place(k.east_m[i] + 10 * k.east_mps[i], k.north_m[i] + 10 * k.north_mps[i]);
        path.moveTo(x, y);
        path.lineTo(u, v);
      }
      const far = away({ east: k.east_m[i], north: k.north_m[i] }, own);
      if (label) name(label, x, y, far, colour);
    }
    sure.draw(c);
    c.setLineDash([3, 3]);
    tentative.draw(c);
    c.setLineDash([]);
  }

  // A ring for each aircraft with an alert, in the colour of the highest.
  function alerts(c, t, own, drawn) {
    const where = new Map(Data.truths(t).map((one) => [one.target, one]));
    for (const { target, track, level } of Data.alertsAt(t)) {
      const words = target >= 0 ? Data.targets[target] : Data.trackName(track);
      drawn.alerts.push({ target: words, level });
      const one = where.get(target) || (target >= 0 ? lastSeen(target, t) : trackAt(track, t));
      if (!one) continue;
      const [x, y] = place(one.east, one.north);
      c.strokeStyle = Symbols.level(level);
      c.lineWidth = 1 + level;
      c.beginPath(); c.arc(x, y, 14, 0, 2 * Math.PI); c.stroke();
      if (inside(x, y)) name(words, x, y, away(one, own), Symbols.level(level), level);
    }
  }
  function lastSeen(target, t) {
    const d = Data.tables.detections;
    for (let i = Data.after(d.time_s, t) - 1; i >= 0 && d.time_s[i] > t - 20; i--) {
      if (d.target[i] === target && Number.isFinite(d.east_m[i])) {
        return { east: d.east_m[i], north: d.north_m[i] };
      }
    }
    return null;
  }
  function trackAt(number, t) {
    const k = Data.tables.tracks;
    for (const i of Data.standing("tracks", t)) {
      if (k.number && k.number[i] === number && Number.isFinite(k.east_m[i])) {
        return { east: k.east_m[i], north: k.north_m[i] };
      }
    }
    return null;
  }

  function draw(t, options, drawn) {
    const c = Canvas.ready(canvas);
    view.width = canvas.clientWidth;
    view.height = canvas.clientHeight;
    const own = Data.ownship(t);
    view.turn = options.headingUp ? own.heading : 0;
    if (options.follow) [view.east, view.north] = [own.east, own.north];
    const step = rings(c, own);
    drawn.beams = [];
    if (options.fields) {
      fields(c, t, options.sensors);
      for (const number of options.sensors) beam(c, t, number, drawn);
    }
    if (options.bands) bands(c, t, own, drawn);
    if (options.truth) truth(c, t, own, drawn);
    detections(c, t, options, drawn);
    if (options.trackers.size) tracks(c, t, own, options.trackers, drawn);
    alerts(c, t, own, drawn);
    ringWords(c, own, step);
    drawn.named = writeNames(own);
    drawn.labels = Labels.draw(c, Symbols.colours.ground);
    const [x, y] = place(own.east, own.north);
    Symbols.aircraft(c, x, y, own.heading - view.turn, 11, Symbols.colours.own);
    drawn.own = own;
  }

  function zoomed(factor) {
    return Math.min(Math.max(view.perPixel * factor, 0.05), 5000);
  }
  function pan(dx, dy) {
    const cos = Math.cos(view.turn), sin = Math.sin(view.turn);
    view.east -= view.perPixel * (dx * cos - dy * sin);
    view.north += view.perPixel * (dx * sin + dy * cos);
  }

  function frame(far, own) {
    const size = Math.min(canvas.clientWidth, canvas.clientHeight);
    view.perPixel = (2.3 * Math.max(far, 500)) / Math.max(200, size);
    [view.east, view.north] = [own.east, own.north];
  }
  // What matters in the whole run, around the ownship.
  function near(t) { frame(Data.reach.near_m, Data.ownship(t)); }
  // All that is there now.
  function all(t) {
    const own = Data.ownship(t), d = Data.tables.detections;
    let far = Data.truths(t).reduce((most, one) => Math.max(most, away(one, own)), 1000);
    const [from, to] = Data.recent("detections", t, 4);
    for (let i = from; i < to; i++) {
      const seen = away({ east: d.east_m[i], north: d.north_m[i] }, own);
      if (Number.isFinite(seen)) far = Math.max(far, seen);
    }
    frame(far, own);
  }

  return { canvas, view, draw, zoomed, pan, near, all, place };
})();
