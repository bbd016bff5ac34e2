"use strict";
// An alert sounds when it comes or becomes more urgent: once for a caution, three times for a warning.
const Sound = (() => {
  let context = null, muted = false, count = 0;

  // Browsers let nothing sound before somebody has pressed something.
  function allow() {
    if (context || !window.AudioContext) return;
    context = new AudioContext();
  }
  function tone(at, hertz) {
    const source = context.createOscillator(), gain = context.createGain();
    source.type = "square";
    source.frequency.value = hertz;
    gain.gain.setValueAtTime(0.0001, at);
    gain.gain.exponentialRampToValueAtTime(0.15, at + 0.01);
    gain.gain.exponentialRampToValueAtTime(0.0001, at + 0.22);
    source.connect(gain).connect(context.destination);
    source.start(at);
    source.stop(at + 0.25);
  }
  function alert(level) {
    if (muted || !context) return;
    context.resume();
    count += 1;
    const urgent = level >= 3;
    for (let i = 0; i < (urgent ? 3 : 1); i++) {
      tone(context.currentTime + 0.3 * i, urgent ? 1000 : 660);
    }
  }
  function mute(on) { muted = on; }
  return { allow, alert, mute, get count() { return count; },
    get state() { return context ? context.state : "none"; } };
})();
