"use strict";
// What all pages draw with: colours of the theme, text, and a canvas of its size on screen.
const Canvas = (() => {
  function theme(names) {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(
      names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }
  function font(c, size = 12) {
    c.font = `${size}px system-ui, sans-serif`;
  }
  // With a halo, a colour, words stand out from what is under them.
  function text(c, words, x, y, colour, align = "left", size = 12, halo = null) {
    font(c, size);
    c.textAlign = align;
    if (halo !== null) {
      c.save();
      c.setLineDash([]);
      c.lineJoin = "round";
      c.lineWidth = 4;
      c.strokeStyle = halo;
      c.strokeText(words, x, y);
      c.restore();
    }
    c.fillStyle = colour;
    c.fillText(words, x, y);
  }
  // In pixels of the screen; returns its context, cleared.
  function ready(canvas) {
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio);
    const height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const c = canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    return c;
  }
  return { theme, font, text, ready };
})();
