"use strict";
// Log and simulations run along their tracks; plain canvas, no network.
for (const box of document.querySelectorAll(".replay")) {
  const data = JSON.parse(box.querySelector("script").textContent);
  const canvas = box.querySelector("canvas"), slider = box.querySelector("input");
  const button = box.querySelector("button"), told = box.querySelector("output");
  const n = data.t.length;
  const known = data.series[0].x.map((x, i) => [x, data.series[0].y[i]]).filter(p => p[0] !== null);
  const low = [0, 1].map(k => Math.min(...known.map(p => p[k])));
  const high = [0, 1].map(k => Math.max(...known.map(p => p[k])));
  const span = 1.5 * Math.max(high[0] - low[0], high[1] - low[1], 1e-9);
  const mid = [0, 1].map(k => (low[k] + high[k]) / 2);
  let at = 0, playing = false, last = 0;
  slider.max = n - 1;
  function draw() {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    canvas.width = w * ratio; canvas.height = h * ratio;
    const c = canvas.getContext("2d"), scale = Math.min(w, h) / span;
    c.scale(ratio, ratio); c.fillStyle = "#fff"; c.fillRect(0, 0, w, h);
    const px = i => [w / 2 + (i[1] - mid[1]) * scale, h / 2 - (i[0] - mid[0]) * scale];
    for (const s of data.series) {
      c.strokeStyle = c.fillStyle = s.colour; c.setLineDash(s.dash); c.globalAlpha = 0.55; c.beginPath();
      let pen = false;
      for (let i = 0; i < n; i++) {
        if (s.x[i] === null) { pen = false; continue; }
        const p = px([s.x[i], s.y[i]]);
        if (pen) c.lineTo(...p); else c.moveTo(...p);
        pen = true;
      }
      c.stroke(); c.setLineDash([]); c.globalAlpha = 1;
      if (s.x[at] === null) continue;
      const p = px([s.x[at], s.y[at]]), a = s.psi ? s.psi[at] : null;
      c.beginPath();
      if (a === null) c.arc(p[0], p[1], 5, 0, 7);
      else for (const [k, r] of [[0, 11], [2.5, 8], [-2.5, 8]]) c.lineTo(p[0] + r * Math.sin(a + k), p[1] - r * Math.cos(a + k));
      c.closePath(); c.fill();
    }
    c.font = "12px sans-serif"; c.textBaseline = "top";
    data.series.forEach((s, i) => { c.fillStyle = s.colour; c.fillText(s.label, 8, 8 + 16 * i); });
    slider.value = at;
    const orders = data.orders.map(o => o.label + " " + o.values[at].toFixed(1) + " " + o.unit);
    const miss = data.series.slice(1).map(s => {
      const d = s.x[at] === null || data.series[0].x[at] === null ? null
        : Math.hypot(s.x[at] - data.series[0].x[at], s.y[at] - data.series[0].y[at]);
      return s.label + " " + (d === null ? "–" : d.toFixed(1) + " m");
    });
    told.textContent = data.t[at].toFixed(0) + " s · " + [...orders, "distance to the log: " + miss.join(", ")].join(" · ");
  }
  function run(now) {
    if (!playing) return;
    if (now - last > 1000 * 20 / n) { last = now; at = (at + 1) % n; draw(); }
    requestAnimationFrame(run);
  }
  slider.addEventListener("input", () => { at = Number(slider.value); draw(); });
  button.addEventListener("click", () => {
    playing = !playing; button.textContent = playing ? "Pause" : "Play"; requestAnimationFrame(run);
  });
  window.addEventListener("resize", draw);
  draw();
}
