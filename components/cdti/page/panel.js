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
  function words(one, scene, rejected) {
    const [number, east, north, up, bearing, , , , vu, level] = one;
    const from = ((bearing - scene.heading) % 360 + 360) % 360;
    const clock = Math.round(from / 30) % 12 || 12;
    const parts = [level ? Symbols.WORDS[Math.min(level, 3)] : "traffic", scene.name(number),
      `${clock} o'clock`];
    if (east === null) parts.push("no range");
    else parts.push(Units.distance(Math.hypot(east, north), 1), `${Units.above(up)}${Symbols.climb(vu)}`);
    if (rejected.has(number)) parts.push("rejected");
    return parts.join(", ");
  }
  function contacts(frame, scene, chosen, rejected) {
    const shown = order(frame);
    shown.forEach((one, place) => {
      const made = row(place);
      const text = words(one, scene, rejected);
      put(made, text);
      made.className = one[9] ? `level${Math.min(one[9], 3)}` : "";
      made.setAttribute("aria-selected", String(one[0] === chosen));
      made.dataset.number = String(one[0]);
      if (one[0] === chosen) list.setAttribute("aria-activedescendant", made.id);
    });
    while (list.children.length > shown.length) list.lastChild.remove();
    return shown.map((one) => one[0]);
  }
  // The most urgent alert in words; one that was rejected stays for as long as it is on.
  function alerts(frame, scene, rejected) {
    const every = frame.alerts.map((one) => ({ ...one, rejected: rejected.has(one.target) }))
      .sort((a, b) => a.rejected - b.rejected);
    const most = every[0];
    let text = "", more = "";
    if (most) {
      text = `${Symbols.WORDS[Math.min(most.level, 3)]} ${scene.name(most.target)}`;
      more = most.to_loss === null ? "" : most.to_loss <= 0 ? ": separation is lost"
        : `: separation is lost in ${Math.round(most.to_loss)} s`;
      if (most.rejected) more += " (rejected)";
      if (every.length > 1) more += `; ${every.length - 1} more`;
    }
    put(get("alert"), text);
    put(get("alert-more"), more);
    banner.className = most ? `level${Math.min(most.level, 3)}` : "";
    return every;
  }
  function put(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }
  function command(one) {
    if (one.decision === "turn") {
      return `turn ${Math.abs(one.value)}° ${one.value < 0 ? "left" : "right"}`;
    }
    return `${one.value < 0 ? "descend" : "climb"} ${Units.height(Math.abs(one.value))}`;
  }
  // Which command one replaces that was still being flown.
  function replaced(one) {
    if (!one.replaces) return "";
    return ` replaces ${command({ ...one, ...one.replaces })} of ${one.replaces.time.toFixed(2)} s`;
  }
  function decided(one, scene) {
    const made = document.createElement("li");
    const who = one.target >= 0 ? ` (${scene.name(one.target)})` : "";
    const what = SAID[one.decision] || command(one);
    made.textContent = `${one.time.toFixed(2)} s: ${what}${who}${replaced(one)}`;
    log.prepend(made);
    while (log.children.length > 100) log.lastChild.remove();
  }
  // All that was decided, again: in other units, or after the page was away.
  function decisions(every, scene) {
    log.replaceChildren();
    for (const one of every) decided(one, scene);
  }
  function flying(commands, time) {
    const { turn, climb } = commands, parts = [];
    if (turn && time < turn.ends) {
      parts.push(`${turn.value < 0 ? "left" : "right"} to ${Units.heading(turn.to)}`);
    }
    if (climb && time < climb.ends) {
      parts.push(`${climb.value < 0 ? "descent" : "climb"} to ${Units.height(climb.to)}`);
    }
    put(get("flying"), parts.length ? `flying ${parts.join(", ")}` : "no command is being flown");
  }
  // Which sensors nothing comes from: what is not shown may be there all the same.
  function silent(frame) {
    put(get("silent"), frame.out.length ? `out: ${frame.out.join(", ")}` : "");
  }
  function status(text) { put(get("status"), text); }
  return { contacts, alerts, command, replaced, decided, decisions, flying, silent, status, put, list };
})();
