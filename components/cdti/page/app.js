"use strict";
// What the operator does, and one picture for each frame that comes.
const App = (() => {
  const get = (id) => document.getElementById(id);
  const root = document.documentElement;
  const scene = { title: "", sensors: [], names: [], heading: 0, console: false,
    name: (number) => (number >= 1000000 ? `track ${number - 1000000}`
      : scene.names[number] || (number < 0 ? "unknown" : `target ${number}`)) };
  const state = { role: "", frame: null, dirty: false, chosen: -1, picked: false, order: [], over: false,
    ended: "", began: false, lost: false, notice: "", noticeUntil: 0 };
  const levels = new Map(), said = [];
  let decided = [], commands = {};
  const rejected = new Map();  // by target, for as long as the contact is there: at which level
  const shown = new Map();  // by target: until when alerts on it have been told of, s
  let drawn = {};
  const frames = { count: 0, spent_ms: 0 };
  const trips = [];
  let trip = null;

  function may() { return state.role === "operator" && scene.console && state.began && !state.over; }
  function decide(decision, value) {
    if (!may()) return;
    const target = state.chosen;
    if (value === undefined && target < 0) return;
    const content = { decision, target };
    if (value !== undefined) content.value = value;
    if (decision === "turn" && state.frame && state.frame.own) {
      trip = { at: performance.now(), heading: state.frame.own.heading, side: Math.sign(value) };
    }
    return Link.decide(content);
  }
  function choose(number, picked = true) {
    const anew = number !== state.chosen, heeded = picked && (anew || !state.picked);
    state.picked = picked;
    state.chosen = number;
    if (anew) Link.send({ type: "chosen", target: number });
    if (heeded && number >= 0 && levels.get(number) && may()) decide("looked");
    state.dirty = true;
  }
  function step(by) {
    if (!state.order.length) return;
    const now = state.order.indexOf(state.chosen);
    choose(state.order[(now + by + state.order.length) % state.order.length]);
  }

  // An alert that is new or more urgent sounds; that it is on screen is told once.
  function heed(frame) {
    const on = new Set(), there = new Set(frame.contacts.map((one) => one[0]));
    for (const one of frame.alerts) {
      on.add(one.target);
      const before = levels.get(one.target) || 0;
      if (one.level > (rejected.get(one.target) || 0)) rejected.delete(one.target);
      if (one.level > before && !rejected.has(one.target)) Sound.alert(one.level);
      levels.set(one.target, one.level);
      if (!(shown.get(one.target) >= one.since)) {
        shown.set(one.target, frame.t);
        if (may()) Link.decide({ decision: "shown", target: one.target });
      }
    }
    for (const target of [...levels.keys()]) if (!on.has(target)) levels.delete(target);
    for (const target of [...rejected.keys()]) {
      if (!on.has(target) && !there.has(target)) rejected.delete(target);
    }
  }
  // Until somebody picks a contact, and when it is gone, the chosen one is that of the most urgent
  // alert; among alerts of one level it stays.
  function follow(frame) {
    if (state.picked && !frame.contacts.some((one) => one[0] === state.chosen)) state.picked = false;
    const mine = rejected.has(state.chosen) ? 0 : levels.get(state.chosen) || 0;
    const open = frame.alerts.find((one) => !rejected.has(one.target));
    if (!state.picked && open && open.level > mine) choose(open.target, false);
  }
  // What was decided, by whichever page: it is known to all of them.
  function take(one) {
    decided.push(one);
    if (one.decision === "rejected") rejected.set(one.target, one.level);
    if (one.decision === "verified") rejected.delete(one.target);
    if (one.to !== undefined) commands[one.decision] = one;
  }
  // A line for a while, that the next picture does not take away.
  function notice(text) {
    state.notice = text;
    state.noticeUntil = performance.now() + 8000;
    state.dirty = true;
  }
  function words() {
    if (state.over) return `ended: ${state.ended}`;
    if (performance.now() < state.noticeUntil) return state.notice;
    if (state.lost) return "connection lost: the display stands still";
    if (!state.began) return "waiting for the operator to begin";
    if (!scene.console) return "nobody decides in this scene";
    if (state.role === "operator") return "you decide";
    return state.frame && state.frame.operators === 0
      ? "you watch, nobody decides: the terminal shows the address of a page that does"
      : "you watch: another page decides";
  }
  function render() {
    const began = performance.now();
    const frame = state.frame;
    drawn = { t: frame ? frame.t : null, lines: [], symbols: [], alerts: [] };
    if (frame && frame.own) {
      scene.heading = frame.own.heading;
      heed(frame);
      follow(frame);
      const { turn, climb } = commands, flown = (one) => (one && frame.t < one.ends ? one.to : null);
      Scope.draw(frame, scene, state.chosen, flown(turn), drawn);
      Tapes.draw(frame.own, frame.bands, flown(climb), drawn);
      Panel.flying(commands, frame.t);
      Panel.silent(frame);
      state.order = Panel.contacts(frame, scene, state.chosen, rejected);
      drawn.alerts = Panel.alerts(frame, scene, rejected);
      drawn.camera = Camera.draw(frame.camera, scene);
      drawn.own = frame.own;
      measure(frame);
    }
    if (frame) {
      Panel.put(get("time"), `${frame.t.toFixed(1)} s`);
      const late = frame.lag > 0.1;
      const told = frame.lag < 10 ? `${(1000 * frame.lag).toFixed(0)} ms` : `${frame.lag.toFixed(0)} s`;
      Panel.put(get("lag"), `lag ${told}`);
      get("lag").className = late ? "late" : "";
    }
    Panel.status(words());
    Panel.put(get("range"), Units.range(Scope.range()));
    Panel.put(get("chosen"), state.chosen < 0 ? "no contact is chosen"
      : `chosen: ${scene.name(state.chosen)}`);
    for (const id of ["verify", "reject"]) get(id).disabled = !may() || state.chosen < 0;
    for (const id of ["left", "right", "up", "down"]) get(id).disabled = !may();
    frames.count += 1;
    frames.spent_ms += performance.now() - began;
    state.dirty = false;
    if (frame && !frame.told) {
      frame.told = true;
      Link.send({ type: "drawn", frame: frame.frame });
    }
  }
  // Wall time from a turn that was told to the first picture in which the ownship turns.
  function measure(frame) {
    if (!trip) return;
    const turned = ((frame.own.heading - trip.heading + 540) % 360) - 180;
    if (turned * trip.side > 0.01) {
      trips.push(performance.now() - trip.at);
      trip = null;
    }
  }
  function loop() {
    if (state.dirty) render();
    requestAnimationFrame(loop);
  }

  Link.hears.welcome = (content) => {
    Object.assign(scene, { title: content.title, sensors: content.sensors, names: content.names,
      console: content.console });
    state.role = content.role;
    state.began = content.began;
    state.lost = false;
    get("title").textContent = content.title;
    document.title = `${content.title}: traffic display`;
    decided = [];
    commands = {};
    for (const one of content.log) {
      take(one);
      if (one.decision === "shown") shown.set(one.target, one.time);
    }
    let kept = "";
    try { kept = sessionStorage.getItem("units") || ""; } catch { /* as it was started */ }
    units(kept || content.units);
    get("start").hidden = content.began || content.role !== "operator";
    if (!get("start").hidden) get("ready").focus();
    Scope.fit(content.sensors);
    if (state.chosen >= 0) Link.send({ type: "chosen", target: state.chosen });
    state.dirty = true;
  };
  Link.hears.names = (content) => { scene.names = content.names; state.dirty = true; };
  Link.hears.frame = (content) => { state.frame = content; state.dirty = true; };
  Link.hears.began = () => {
    state.began = true;
    get("start").hidden = true;
    state.dirty = true;
  };
  Link.hears.taken = (content) => {
    said.push(content);
    take(content);
    Panel.decided(content, scene);
    if (content.replaces) notice(Panel.command(content) + Panel.replaced(content));
    state.dirty = true;
  };
  Link.hears.refused = (content) => {
    said.push(content);
    notice(`refused: ${content.why}`);
  };
  Link.hears.end = (content) => {
    state.over = true;
    state.ended = content.why;
    state.dirty = true;
  };
  Link.hears.lost = (code) => {
    if (code === 4001) { state.over = true; state.ended = "opened in another window"; }
    state.lost = true;
    state.dirty = true;
  };

  function theme(name) {
    root.dataset.theme = name;
    Symbols.readTheme();
    Legend.draw(scene.sensors);
    state.dirty = true;
  }
  function units(name) {
    const before = Scope.range();
    Units.choose(name);
    Scope.hold(before);
    get("units").textContent = Units.system.words;
    const place = Math.max(get("climb-by").selectedIndex, 0), was = get("climb-by").options.length;
    get("climb-by").replaceChildren(...Units.system.climbs.map((value) => {
      const metres = Units.metres("height", value);
      return new Option(Units.height(metres), metres.toFixed(4).replace(/\.?0+$/, ""));
    }));
    get("climb-by").selectedIndex = was ? place : 1;
    Tapes.units();
    Legend.draw(scene.sensors);
    Panel.decisions(decided.slice(-100), scene);
    state.dirty = true;
  }
  const by = (id, sign) => sign * Number(get(id).value);
  const press = {
    ready: () => {
      Sound.allow();
      Link.send({ type: "ready" });
      get("scope").focus();
    },
    verify: () => decide("verified"), reject: () => decide("rejected"),
    left: () => decide("turn", by("turn-by", -1)), right: () => decide("turn", by("turn-by", 1)),
    up: () => decide("climb", by("climb-by", 1)), down: () => decide("climb", by("climb-by", -1)),
    in: () => { Scope.zoom(-1); state.dirty = true; },
    out: () => { Scope.zoom(1); state.dirty = true; },
    units: () => {
      units(Units.other());
      try { sessionStorage.setItem("units", Units.name); } catch { /* until it is loaded again */ }
    },
    theme: () => theme(root.dataset.theme === "dark" ? "light" : "dark"),
    mute: () => {
      const on = get("mute").getAttribute("aria-pressed") !== "true";
      get("mute").setAttribute("aria-pressed", String(on));
      Sound.mute(on);
    },
  };
  for (const [id, act] of Object.entries(press)) get(id).addEventListener("click", act);
  document.addEventListener("pointerdown", Sound.allow);
  document.addEventListener("keydown", Sound.allow);
  const keys = {
    l: () => {
      get("legend").open = !get("legend").open;
      if (get("legend").open) get("legend").scrollIntoView({ block: "nearest" });
    },
    u: press.units, v: press.verify, x: press.reject, n: () => step(1), p: () => step(-1), "+": press.in,
    "=": press.in, "-": press.out, d: press.theme, s: press.mute, ArrowLeft: press.left,
    ArrowRight: press.right, ArrowUp: press.up, ArrowDown: press.down,
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    const where = event.target.tagName;
    if (where === "SELECT") return;
    if (event.target === Panel.list && (event.key === "ArrowDown" || event.key === "ArrowUp")) {
      event.preventDefault();
      step(event.key === "ArrowDown" ? 1 : -1);
      return;
    }
    const act = keys[event.key] || keys[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act();
  });
  Panel.list.addEventListener("click", (event) => {
    const row = event.target.closest("li");
    if (row) choose(Number(row.dataset.number));
  });
  Scope.canvas.addEventListener("pointerdown", (event) => {
    const near = (drawn.symbols || [])
      .map((one) => [Math.hypot(one.x - event.offsetX, one.y - event.offsetY), one.number])
      .sort((a, b) => a[0] - b[0])[0];
    if (near && near[0] < 30) choose(near[1]);
  });
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", () => theme(dark.matches ? "dark" : "light"));
  window.addEventListener("resize", () => { state.dirty = true; });
  theme(dark.matches ? "dark" : "light");
  Link.open();
  requestAnimationFrame(loop);

  // What is on screen, for those who look at it by program.
  return {
    state: () => { if (state.dirty) render(); return { ...drawn, role: state.role, chosen: state.chosen,
      over: state.over, ended: state.ended, began: state.began, sounds: Sound.count,
      waiting: Link.waiting.size }; },
    said, trips, scene,
    timing: () => ({ ...frames, mean_ms: frames.spent_ms / Math.max(1, frames.count) }),
  };
})();
window.App = App;
