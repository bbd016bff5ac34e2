"use strict";
// The clock of the replay, the controls, and one picture for each frame.
const App = (() => {
  const get = (id) => document.getElementById(id);
  const root = document.documentElement;
  const state = { t: 0, playing: false, speed: 1, steps: -1, dirty: true, keepsTime: true };
  const options = {
    sensors: new Set(Data.sensors.map((_, number) => number)),
    trackers: new Set(Data.trackers.map((_, number) => number)),
    truth: Boolean(Data.tables.truth), fields: true, bands: Boolean(Data.tables.bands),
    follow: true, headingUp: false, fade: 4,
  };
  const swatches = [];
  let drawn = {};
  let frames = { count: 0, spent_ms: 0 };

  // What is done to one page is done to all beside it (view A B): they share clock, scale and theme.
  // The first of them keeps the time.
  let beside = [];
  const shared = {
    seek(t) { state.t = Math.min(Math.max(t, 0), Data.duration_s); },
    play(on) {
      state.playing = on;
      get("play").textContent = on ? "Pause" : "Play";
    },
    speed(factor) {
      state.speed = factor;
      get("speed").value = String(factor);
    },
    scale(perPixel) { Plan.view.perPixel = perPixel; },
    pan(dx, dy) { Plan.pan(dx, dy); },
    near() { Plan.near(state.t); },
    all() { Plan.all(state.t); },
    follow(on) {
      options.follow = on;
      get("follow").setAttribute("aria-pressed", String(on));
    },
    headingUp(on) {
      options.headingUp = on;
      get("up").textContent = on ? "Heading up" : "North up";
    },
    theme(name) {
      root.dataset.theme = name;
      Symbols.readTheme();
      swatches.forEach((paint) => paint());
      Timeline.forget();
    },
  };
  function perform(what, ...values) {
    shared[what](...values);
    state.dirty = true;
  }
  function tell(what, ...values) {
    perform(what, ...values);
    for (const other of beside) other.perform(what, ...values);
  }
  function seek(t) { tell("seek", t); }
  function play(on) {
    if (on && state.t >= Data.duration_s) seek(0);
    tell("play", on);
  }
  function fit(what) {
    tell(what);
    if (beside.length) tell("scale", Math.max(...[App, ...beside].map((one) => one.scale())));
  }
  function step(direction) {
    play(false);
    const numbers = state.steps < 0 ? [...options.sensors] : [state.steps];
    let found = direction > 0 ? Infinity : -Infinity;
    for (const number of numbers) {
      const times = Data.scanTimes[number];
      const next = Data.after(times, state.t + 1e-9);
      if (direction > 0) {
        if (next < times.length) found = Math.min(found, times[next]);
      } else {
        let before = next - 1;
        while (before >= 0 && times[before] > state.t - 1e-9) before--;
        if (before >= 0) found = Math.max(found, times[before]);
      }
    }
    if (Number.isFinite(found)) seek(found);
    else seek(direction > 0 ? Data.duration_s : 0);
  }

  // Lists of all that is on screen are made for who looks at it by program only.
  function render(listing = false) {
    const began = performance.now();
    drawn = { t: state.t, alerts: [] };
    if (listing) Object.assign(drawn, { detections: [], tracks: [], truth: [] });
    Plan.draw(state.t, options, drawn);
    Altitude.draw(state.t, options);
    Timeline.draw(state.t);
    Seen.update(state.t, drawn);
    const words = (state.t + Data.start_s).toFixed(3);
    if (document.activeElement !== get("time")) get("time").value = words;
    frames.count += 1;
    frames.spent_ms += performance.now() - began;
    state.dirty = false;
  }
  let last = null;
  function frame(now) {
    if (state.playing && last !== null && state.keepsTime) {
      seek(state.t + (state.speed * Math.min(now - last, 250)) / 1000);
      if (state.t >= Data.duration_s) play(false);
    }
    last = now;
    if (state.dirty) render();
    requestAnimationFrame(frame);
  }

  const page = Data.page;
  function address(eyes) {
    const looks = eyes === null ? "" : `&eyes=${encodeURIComponent(eyes)}`;
    return `#t=${+(state.t + Data.start_s).toFixed(6)}${options.headingUp ? "&up=heading" : ""}${looks}`;
  }
  function link() {
    const hash = address(Data.eyes);
    page.history.replaceState(null, "", hash);
    get("note").textContent = `address ends in ${hash}`;
    if (navigator.clipboard) navigator.clipboard.writeText(page.location.href).catch(() => {});
  }
  function readLink() {
    if (Data.chosenEyes() !== Data.eyes) {
      page.location.reload();
      return;
    }
    const parts = new URLSearchParams(page.location.hash.slice(1));
    const t = Number(parts.get("t"));
    if (parts.has("t") && Number.isFinite(t)) {
      play(false);
      seek(t - Data.start_s);
    }
    if (parts.get("up") === "heading") tell("headingUp", true);
  }

  // A marker as it stands on the plan: a sensor's colour holds in both themes, a tracker's is the theme's.
  function swatch(marker, colour, filled) {
    const canvas = document.createElement("canvas");
    canvas.className = "swatch";
    canvas.width = canvas.height = 32;
    const c = canvas.getContext("2d");
    const paint = () => {
      c.setTransform(2, 0, 0, 2, 0, 0);
      c.clearRect(0, 0, 16, 16);
      Symbols.mark(c, marker, 8, 8, 6, colour(), filled);
    };
    swatches.push(paint);
    return canvas;
  }
  function layer(text, on, change, mark) {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = on;
    box.addEventListener("change", () => { change(box.checked); state.dirty = true; });
    label.appendChild(box);
    if (mark) label.appendChild(mark);
    label.appendChild(document.createTextNode(text));
    get("layers").appendChild(label);
  }
  Data.sensors.forEach((sensor, number) => layer(sensor.on ? `${sensor.name} on ${sensor.on}` : sensor.name, true,
    (on) => options.sensors[on ? "add" : "delete"](number), swatch(sensor.marker, () => sensor.colour, true)));
  Data.trackers.forEach((tracker, number) => layer(Data.trackers.length > 1 ? tracker : "tracks", true,
    (on) => options.trackers[on ? "add" : "delete"](number), swatch("D", () => Symbols.tracker(number), false)));
  if (Data.tables.truth) layer("truth", true, (on) => { options.truth = on; });
  if (Data.tables.bands) layer("bands", true, (on) => { options.bands = on; });
  layer("fields of view", true, (on) => { options.fields = on; });

  for (const speed of [0.1, 0.25, 0.5, 1, 2, 5, 10, 30, 100]) {
    get("speed").add(new Option(`${speed} ×`, String(speed), speed === 1, speed === 1));
  }
  get("steps").add(new Option("all shown", "-1", true, true));
  Data.sensors.forEach((s, n) => get("steps").add(new Option(s.name, String(n))));
  for (const name of ["all", ...Data.platforms]) {
    const mine = name === (Data.eyes ?? "all");
    get("eyes").add(new Option(name, name, mine, mine));
  }
  get("eyes").parentElement.hidden = Data.platforms.length === 0;
  document.querySelector("h1").title = document.title;
  get("facts").title = get("facts").textContent = Object.entries(Data.facts)
    .map(([k, v]) => (k === "description" ? v : `${k} ${v}`)).join(" · ");

  const press = {
    play: () => play(!state.playing), back: () => step(-1), forth: () => step(1),
    up: () => tell("headingUp", !options.headingUp), follow: () => tell("follow", !options.follow),
    link, in: () => tell("scale", Plan.zoomed(1 / 1.4)), out: () => tell("scale", Plan.zoomed(1.4)),
    near: () => fit("near"), all: () => fit("all"),
    theme: () => tell("theme", root.dataset.theme === "dark" ? "light" : "dark"),
  };
  for (const [id, act] of Object.entries(press)) get(id).addEventListener("click", act);
  get("speed").addEventListener("change", (e) => tell("speed", Number(e.target.value)));
  get("steps").addEventListener("change", (e) => { state.steps = Number(e.target.value); });
  get("eyes").addEventListener("change", (e) => {
    page.location.hash = address(e.target.selectedIndex ? e.target.value : null);
  });
  get("time").addEventListener("change", (e) => {
    const t = Number(e.target.value);
    if (Number.isFinite(t)) { play(false); seek(t - Data.start_s); }
  });

  const keys = {
    " ": press.play, ArrowRight: (e) => (e.shiftKey ? seek(state.t + 1) : step(1)),
    ArrowLeft: (e) => (e.shiftKey ? seek(state.t - 1) : step(-1)),
    Home: () => seek(0), End: () => seek(Data.duration_s), "+": press.in, "=": press.in,
    "-": press.out, 0: press.near, a: press.all, n: press.up, f: press.follow, l: press.link, d: press.theme,
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const where = event.target.tagName;
    if (where === "INPUT" && event.target.type === "number") return;
    if (where === "SELECT" || (where === "BUTTON" && event.key === " ")) return;
    const act = keys[event.key] || keys[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act(event);
  });

  let dragged = null;
  Plan.canvas.addEventListener("pointerdown", (e) => {
    dragged = [e.clientX, e.clientY];
    Plan.canvas.setPointerCapture(e.pointerId);
  });
  Plan.canvas.addEventListener("pointermove", (e) => {
    if (!dragged) return;
    if (options.follow) tell("follow", false);
    tell("pan", e.clientX - dragged[0], e.clientY - dragged[1]);
    dragged = [e.clientX, e.clientY];
  });
  Plan.canvas.addEventListener("pointerup", () => { dragged = null; });
  Plan.canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    tell("scale", Plan.zoomed(e.deltaY > 0 ? 1.15 : 1 / 1.15));
  }, { passive: false });
  const slide = (e) => { play(false); seek(Timeline.timeAt(e.offsetX)); };
  Timeline.canvas.addEventListener("pointerdown", (e) => {
    Timeline.canvas.setPointerCapture(e.pointerId);
    slide(e);
  });
  Timeline.canvas.addEventListener("pointermove", (e) => { if (e.buttons) slide(e); });

  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", () => perform("theme", dark.matches ? "dark" : "light"));
  window.addEventListener("resize", () => { Timeline.forget(); state.dirty = true; });
  page.addEventListener("hashchange", readLink);
  perform("theme", dark.matches ? "dark" : "light");
  const { first_s } = Data.reach;
  perform("seek", first_s);
  perform("near");
  readLink();
  requestAnimationFrame(frame);

  // Stand beside other pages: `lasts_s` is the longest of all.
  function join(others, keepsTime, lasts_s) {
    beside = others;
    state.keepsTime = keepsTime;
    Data.duration_s = lasts_s;
    Timeline.forget();
    root.classList.add("beside");
    root.classList.toggle("listens", !keepsTime);
    if (keepsTime) {
      fit("near");
      seek(Math.min(...[App, ...beside].map((one) => one.first_s)));
      readLink();
    }
  }

  // What is on screen, for those who look at it by program.
  return {
    join, perform, scale: () => Plan.view.perPixel, lasts_s: Data.duration_s, first_s,
    state: () => { render(true); return { ...drawn, playing: state.playing }; },
    seek, play, step, options,
    timing: () => ({ ...frames, mean_ms: frames.spent_ms / Math.max(1, frames.count) }),
  };
})();
window.App = App;
