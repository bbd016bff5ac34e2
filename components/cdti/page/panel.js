"use strict";
// The words beside the display: contacts, alerts, decisions. Names are only ever put in as text.
const Panel = (() => {
  const get = (id) => document.getElementById(id);
  const list = get("contacts"), banner = get("banner"), log = get("log");
  const MOST = 30;
  const SAID = { shown: "shown", looked: "looked at", verified: "verified", rejected: "rejected" };

  function order(frame) {
    return [...frame.contacts].sort((a, b) => b[9] - a[9]
      || Math.hypot(a[1] || 1e9, a[2] || 0) - Math.hypot(b[1] || 1e9, b[2] || 0)).slice(0, MOST);
  }
  function row(place) {
    while (list.children.length <= place) {
      const made = document.createElement("li");
      made.setAttribute("role", "option");
      made.id = `contact-${list.children.length}`;
      list.appendChild(made);
    }
    return list.children[place];
  }
  function words(one, scene) {
    const [number, east, north, up, bearing, , , , vu, level] = one;
    const from = ((bearing - scene.heading) % 360 + 360) % 360;
    const clock = Math.round(from / 30) % 12 || 12;
    const parts = [level ? Symbols.WORDS[Math.min(level, 3)] : "traffic", scene.name(number),
      `${clock} o'clock`];
    if (east === null) parts.push("no range");
    else parts.push(`${(Math.hypot(east, north) / 1000).toFixed(1)} km`,
      `${Symbols.altitude(up)}${Symbols.climb(vu)}`);
    return parts.join(", ");
  }
  function contacts(frame, scene, chosen) {
    const shown = order(frame);
    shown.forEach((one, place) => {
      const made = row(place);
      const text = words(one, scene);
      if (made.textContent !== text) made.textContent = text;
      made.className = one[9] ? `level${Math.min(one[9], 3)}` : "";
      made.setAttribute("aria-selected", String(one[0] === chosen));
      made.dataset.number = String(one[0]);
      if (one[0] === chosen) list.setAttribute("aria-activedescendant", made.id);
    });
    while (list.children.length > shown.length) list.lastChild.remove();
    return shown.map((one) => one[0]);
  }
  function alerts(frame, scene, rejected) {
    const open = frame.alerts.filter((one) => !rejected.has(one.target));
    const most = open[0];
    let text = "";
    if (most) {
      const wait = most.to_loss === null ? "" : most.to_loss <= 0 ? ": separation is lost"
        : `: separation is lost in ${Math.round(most.to_loss)} s`;
      text = `${Symbols.WORDS[Math.min(most.level, 3)]} ${scene.name(most.target)}${wait}`;
    }
    if (banner.textContent !== text) banner.textContent = text;
    banner.className = most ? `level${Math.min(most.level, 3)}` : "";
    return open;
  }
  function decided(one, scene) {
    const made = document.createElement("li");
    const who = one.target >= 0 ? ` ${scene.name(one.target)}` : "";
    let what = SAID[one.decision] || "";
    if (one.decision === "turn") {
      what = `turn ${Math.abs(one.value)}° ${one.value < 0 ? "left" : "right"}`;
    } else if (one.decision === "climb") {
      what = `${one.value < 0 ? "descend" : "climb"} ${Math.round(Math.abs(one.value) / 0.3048)} ft`;
    }
    made.textContent = `${one.time.toFixed(2)} s: ${what}${who}`;
    log.prepend(made);
    while (log.children.length > 100) log.lastChild.remove();
  }
  function status(text) {
    if (get("status").textContent !== text) get("status").textContent = text;
  }
  return { contacts, alerts, decided, status, list };
})();
