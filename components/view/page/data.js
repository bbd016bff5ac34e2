"use strict";
// The run's columns, and what they say of an instant. Times are seconds since the start.
const Data = (() => {
  const whole = JSON.parse(document.getElementById("data").textContent);
  // Pages beside each other stand in one, whose address says with whose eyes of several one looks.
  const page = window.frameElement ? window.parent : window;
  function chosenEyes() {
    const named = new URLSearchParams(page.location.hash.slice(1)).get("eyes");
    return named !== null && Object.hasOwn(whole.eyes, named) ? named : null;
  }
  const eyes = chosenEyes();
  const raw = eyes === null ? whole : whole.eyes[eyes];

  function column(packed) {
    const text = atob(packed.data);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    const kinds = { i4: Int32Array, f4: Float32Array, f8: Float64Array };
    return new kinds[packed.kind](bytes.buffer);
  }

  function unpacked(packed) {
    const table = {};
    for (const [key, values] of Object.entries(packed)) table[key] = column(values);
    table.count = Object.values(table)[0].length;
    return table;
  }
  const tables = {};
  for (const [name, packed] of Object.entries(raw.tables)) tables[name] = unpacked(packed);

  // Number of elements in [from, to) that are not above a value, as the place of the next one.
  function after(values, value, from = 0, to = values.length) {
    while (from < to) {
      const middle = (from + to) >> 1;
      if (values[middle] <= value) from = middle + 1;
      else to = middle;
    }
    return from;
  }

  function between(times, columns, t, from, to) {
    const next = after(times, t, from, to);
    if (next === from) return null;
    const last = next - 1;
    if (next === to) return t - times[last] > 1e-6 ? null : columns.map((c) => c[last]);
    const part = (t - times[last]) / (times[next] - times[last]);
    return columns.map((c) => c[last] + part * (c[next] - c[last]));
  }

  function poseAt(own, t) {
    if (!own || own.count === 0) return { east: 0, north: 0, alt: 0, heading: 0, known: false };
    const columns = [own.east_m, own.north_m, own.alt_m, own.heading_rad];
    const inside = Math.min(Math.max(t, own.time_s[0]), own.time_s[own.count - 1]);
    const at = between(own.time_s, columns, inside, 0, own.count);
    return { east: at[0], north: at[1], alt: at[2], heading: at[3], known: true };
  }
  const ownship = (t) => poseAt(tables.own, t);
  // Where what carries a sensor is.
  const carriers = new Map();
  if (eyes === null) {
    for (const [name, one] of Object.entries(whole.eyes)) carriers.set(name, unpacked(one.tables.own));
  }
  const carrier = (sensor, t) => poseAt(carriers.get(sensor.on) || tables.own, t);

  const spans = [];
  if (tables.truth) {
    const target = tables.truth.target;
    for (let i = 0; i < target.length; ) {
      let end = i + 1;
      while (end < target.length && target[end] === target[i]) end++;
      spans.push({ target: target[i], from: i, to: end });
      i = end;
    }
  }
  const known = { t: null, found: [] };
  function truths(t) {
    if (known.t === t) return known.found;  // asked for by several parts of one picture
    const found = [];
    const c = tables.truth;
    for (const span of spans) {
      const at = between(c.time_s, [c.east_m, c.north_m, c.alt_m], t, span.from, span.to);
      if (at) {
        const later = between(c.time_s, [c.east_m, c.north_m], t + 1, span.from, span.to);
        found.push({
          target: span.target, east: at[0], north: at[1], alt: at[2],
          rate: later ? [later[0] - at[0], later[1] - at[1]] : null,
        });
      }
    }
    known.t = t;
    known.found = found;
    return found;
  }

  // Rows of a table in (t - lasts, t], by their place.
  function recent(name, t, lasts) {
    const table = tables[name];
    if (!table) return [0, 0];
    return [after(table.time_s, t - lasts), after(table.time_s, t)];
  }

  // Rows of the last instant not after t at which a table has any.
  function latest(name, t) {
    const table = tables[name];
    if (!table) return [0, 0];
    const end = after(table.time_s, t);
    if (end === 0) return [0, 0];
    let start = end - 1;
    while (start > 0 && table.time_s[start - 1] === table.time_s[end - 1]) start--;
    return [start, end];
  }

  // Bands of guidance stand for as long as the alerting takes to look again.
  const BANDS_LAST = 1.5;
  function bandsAt(t) {
    const b = tables.bands;
    const [from, to] = latest("bands", t);
    const found = [];
    for (let i = from; i < to && t - b.time_s[i] < BANDS_LAST; i++) {
      found.push({ region: b.region[i], low_rad: b.low_rad[i], high_rad: b.high_rad[i],
        low_m: b.low_m[i], high_m: b.high_m[i] });
    }
    return found;
  }

  // Rows of the last instant of each source (a column: who sends) not after t. What a source says
  // stands until it may say something else: two and a half of its steps.
  const lasting = new Map();
  function lasts(name, column) {
    if (!lasting.has(name)) {
      const { time_s } = tables[name], before = new Map(), steps = [];
      for (let i = 0; i < time_s.length; i++) {
        const who = column ? column[i] : 0, step = time_s[i] - before.get(who);
        if (step > 0) steps.push(step);
        before.set(who, time_s[i]);
      }
      steps.sort((a, b) => a - b);
      lasting.set(name, Math.max(1, 2.5 * (steps[steps.length >> 1] || 0)));
    }
    return lasting.get(name);
  }
  function standing(name, t) {
    const table = tables[name];
    if (!table) return [];
    const found = [], newest = new Map(), oldest = t - lasts(name, table.source);
    for (let i = after(table.time_s, t) - 1; i >= 0 && table.time_s[i] >= oldest; i--) {
      const who = table.source ? table.source[i] : 0;
      if (!newest.has(who)) newest.set(who, table.time_s[i]);
      if (newest.get(who) === table.time_s[i]) found.push(i);
    }
    return found.reverse();
  }
  // Tracks that do not say whose they are, are those of one tracker.
  const trackers = (raw.trackers || []).length ? raw.trackers : tables.tracks ? ["tracks"] : [];
  // What a track is called, and which tracker's it is where there are several.
  function trackName(number, source) {
    const who = trackers.length > 1 && source >= 0 ? trackers[source] : "track";
    return `${who} ${number}`;
  }
  // The highest level of each aircraft with an alert, whoever alerts.
  function alertsAt(t) {
    const a = tables.alerts, found = new Map();
    for (const i of standing("alerts", t)) {
      const target = a.target[i], track = a.track ? a.track[i] : -1;
      const who = target >= 0 ? target : `track ${track}`;
      if (a.level[i] > 0 && !(found.has(who) && found.get(who).level >= a.level[i])) {
        found.set(who, { target, track, level: a.level[i] });
      }
    }
    return [...found.values()];
  }

  // How far around the ownship that happens which matters: alerts, else detections, else the last two
  // minutes before the closest approach.
  function nearReach() {
    const spanOf = new Map(spans.map((span) => [span.target, span]));
    function apart(target, t) {
      const span = spanOf.get(target);
      const at = span && between(tables.truth.time_s, [tables.truth.east_m, tables.truth.north_m], t,
        span.from, span.to);
      const here = ownship(t);
      return at ? Math.hypot(at[0] - here.east, at[1] - here.north) : NaN;
    }
    const a = tables.alerts, d = tables.detections;
    const far = [];
    for (let i = 0; a && i < a.count; i++) if (a.level[i] > 0) far.push(apart(a.target[i], a.time_s[i]));
    const alerted = far.filter(Number.isFinite);
    if (alerted.length) return alerted.reduce((most, one) => Math.max(most, one));
    const seen = [];
    for (let i = 0; d && i < d.count; i++) {
      if (d.target[i] < 0) continue;
      const here = Number.isFinite(d.east_m[i])
        ? Math.hypot(d.east_m[i] - d.from_east_m[i], d.north_m[i] - d.from_north_m[i])
        : apart(d.target[i], d.time_s[i]);
      if (Number.isFinite(here)) seen.push(here);
    }
    if (seen.length) return seen.sort((x, y) => x - y)[Math.floor(0.9 * (seen.length - 1))];
    let closest = { far: Infinity, t: 0, target: -1 };
    for (const span of spans) {
      for (let i = span.from; i < span.to; i++) {
        const far = apart(span.target, tables.truth.time_s[i]);
        if (far < closest.far) closest = { far, t: tables.truth.time_s[i], target: span.target };
      }
    }
    const span = spanOf.get(closest.target);
    if (!span) return 5000;
    return apart(closest.target, Math.max(closest.t - 120, tables.truth.time_s[span.from]));
  }

  // The first instant at which an aircraft is within a distance of the ownship, or was measured there.
  function firstWithin(far) {
    let first = Infinity;
    const look = (time_s, east_m, north_m, from, to) => {
      for (let i = from; i < to; i++) {
        if (time_s[i] >= first) continue;
        const here = ownship(time_s[i]);
        if (Math.hypot(east_m[i] - here.east, north_m[i] - here.north) <= far) first = time_s[i];
      }
    };
    const c = tables.truth, d = tables.detections;
    for (const span of spans) look(c.time_s, c.east_m, c.north_m, span.from, span.to);
    if (d) look(d.time_s, d.east_m, d.north_m, 0, d.count);
    return Number.isFinite(first) ? first : 0;
  }

  // Times of detections by sensor and target, with the range at the first.
  const looks = raw.sensors.map(() => new Map());
  if (tables.detections) {
    const d = tables.detections;
    for (let i = 0; i < d.count; i++) {
      const mine = looks[d.sensor[i]];
      if (!mine.has(d.target[i])) mine.set(d.target[i], { times: [], range: d.range_m[i] });
      mine.get(d.target[i]).times.push(d.time_s[i]);
    }
  }
  const scans = raw.sensors.map(() => []);
  if (tables.scans) {
    const s = tables.scans;
    for (let i = 0; i < s.count; i++) scans[s.sensor[i]].push(i);
  }
  const scanTimes = scans.map((rows) => Float64Array.from(rows, (i) => tables.scans.time_s[i]));

  const near_m = nearReach();
  return {
    ...raw, page, eyes, chosenEyes, platforms: Object.keys(whole.eyes),
    tables, trackers, after, ownship, carrier, truths, recent, latest, standing, alertsAt, trackName, bandsAt,
    looks, scanTimes, reach: { near_m, first_s: firstWithin(near_m) },
    scanDetected: scans.map((rows) => Int32Array.from(rows, (i) => tables.scans.detected[i])),
  };
})();
