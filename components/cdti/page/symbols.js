"use strict";
// Traffic symbols: TSO-C195b / AC 20-172B and TCAS. Caution: amber circle; warning: red square; the
// direction of flight is an arrowhead inside; without an alert an open arrowhead, or a diamond.
const Symbols = (() => {
  const names = ["ground", "ink", "faint", "line", "own", "traffic", "eo", "ir", "radar", "recovery",
    "symbol-caution", "symbol-warning", "on-caution", "on-warning", "caution", "warning"];
  const WORDS = ["", "PREVENTIVE", "CORRECTIVE", "WARNING"];
  const CLIMBS_MPS = 2.54;  // 500 ft/min
  let colours = {};

  function readTheme() {
    colours = Canvas.theme(names);
  }
  function shape(level, directed) {
    if (level >= 3) return "square";
    if (level === 2) return "circle";
    if (level === 1) return "open circle";
    return directed ? "arrowhead" : "diamond";
  }
  function arrowhead(c, r) {
    c.moveTo(0, -r);
    c.lineTo(0.8 * r, 0.8 * r);
    c.lineTo(0, 0.35 * r);
    c.lineTo(-0.8 * r, 0.8 * r);
    c.closePath();
  }
  // `course` is the direction of flight on screen, clockwise from up, or null.
  function traffic(c, x, y, level, course, r) {
    const alert = level >= 3 ? colours["symbol-warning"] : colours["symbol-caution"];
    c.save();
    c.translate(x, y);
    c.lineWidth = 2;
    c.strokeStyle = level > 0 ? alert : colours.traffic;
    c.fillStyle = alert;
    c.beginPath();
    if (level >= 3) c.rect(-r, -r, 2 * r, 2 * r);
    else if (level > 0) c.arc(0, 0, r, 0, 2 * Math.PI);
    else if (course === null) {
      c.moveTo(0, -r); c.lineTo(r, 0); c.lineTo(0, r); c.lineTo(-r, 0); c.closePath();
    } else {
      c.rotate(course);
      arrowhead(c, r);
    }
    if (level >= 2) c.fill();
    c.stroke();
    if (level > 0 && course !== null) {
      c.rotate(course);
      c.beginPath();
      arrowhead(c, 0.62 * r);
      c.strokeStyle = level >= 3 ? colours["on-warning"] : level === 2 ? colours["on-caution"] : alert;
      c.lineWidth = 1.5;
      c.stroke();
    }
    c.restore();
  }
  // The colour of words about a contact.
  function ink(level) {
    return level >= 3 ? colours.warning : level > 0 ? colours.caution : colours.traffic;
  }
  function climb(rate) {
    if (rate === null || Math.abs(rate) < CLIMBS_MPS) return "";
    return rate > 0 ? "↑" : "↓";
  }
  // What was commanded: a heading on the outer ring, an altitude on its tape.
  function bug(c, x, y) {
    c.beginPath();
    c.arc(x, y, 5, 0, 2 * Math.PI);
    c.fillStyle = colours.ground;
    c.fill();
    c.strokeStyle = colours.own;
    c.lineWidth = 2;
    c.stroke();
  }
  function own(c, x, y, r) {
    c.save();
    c.translate(x, y);
    c.strokeStyle = colours.own;
    c.lineWidth = 2.5;
    c.beginPath();
    c.moveTo(0, -r); c.lineTo(0, 0.8 * r);
    c.moveTo(-0.85 * r, 0); c.lineTo(0.85 * r, 0);
    c.moveTo(-0.35 * r, 0.7 * r); c.lineTo(0.35 * r, 0.7 * r);
    c.stroke();
    c.restore();
  }
  return { get colours() { return colours; }, WORDS, readTheme, shape, traffic, ink, climb, bug,
    own };
})();
