"use strict";
// Log and simulations run along their tracks, with the orders and the force that each simulation lacks; plain canvas, no network.
for (const box of document.querySelectorAll(".replay")) {
  const data = JSON.parse(box.querySelector("script").textContent);
  const canvas = box.querySelector("canvas.track"), below = box.querySelector("canvas.traces");
  const slider = box.querySelector("input"), button = box.querySelector("button"), told = box.querySelector("output");
  const n = data.t.length, log = data.series[0], forces = data.forces || [];
  const known = log.x.map((x, i) => [x, log.y[i]]).filter(p => p[0] !== null && p[1] !== null);
  const low = [0, 1].map(k => Math.min(...known.map(p => p[k])));
  const high = [0, 1].map(k => Math.max(...known.map(p => p[k])));
  const span = 1.5 * Math.max(high[0] - low[0], high[1] - low[1], 1e-9);
  const mid = [0, 1].map(k => (low[k] + high[k]) / 2);
  const there = values => values.filter(v => v !== null);
  // all but the largest two per cent, so that one wild instant does not shrink every other arrow
  const reach = values => {
    const sorted = there(values).map(Math.abs).sort((a, b) => a - b);
    return sorted.length ? sorted[Math.floor(0.98 * (sorted.length - 1))] || 1e-12 : 1e-12;
  };
  const push = reach(forces.flatMap(f => f.X.map((x, i) => x === null ? null : Math.hypot(x, f.Y[i]))));
  const twist = reach(forces.flatMap(f => f.N));
  const rows = data.orders.map(o => ({ label: o.label + " [" + o.unit + "]", lines: [{ colour: "#000000", dash: [], values: o.values }] }));
  if (forces.length) for (const [axis, unit] of [["X", "N"], ["Y", "N"], ["N", "N m"]])
    rows.push({ label: axis + " lacking [" + unit + "]", lines: forces.map(f => ({ colour: f.colour, dash: f.dash, values: f[axis] })) });
  const high_row = 46, margin = 8;
  below.style.height = (rows.length ? rows.length * high_row + 4 : 0) + "px";
  let at = 0, playing = false, last = 0;
  slider.max = n - 1;

  function paper(where) {
    const ratio = window.devicePixelRatio || 1, w = where.clientWidth, h = where.clientHeight;
    where.width = w * ratio; where.height = h * ratio;
    const c = where.getContext("2d");
    c.scale(ratio, ratio); c.fillStyle = "#fff"; c.fillRect(0, 0, w, h); c.font = "12px sans-serif";
    return [c, w, h];
  }
  function line(c, count, point) {
    c.beginPath();
    let pen = false;
    for (let i = 0; i < count; i++) {
      const p = point(i);
      if (p === null) { pen = false; continue; }
      if (pen) c.lineTo(...p); else c.moveTo(...p);
      pen = true;
    }
    c.stroke();
  }
  function head(c, x, y, angle) {
    c.beginPath(); c.moveTo(x, y);
    for (const k of [2.65, -2.65]) c.lineTo(x + 9 * Math.cos(angle + k), y + 9 * Math.sin(angle + k));
    c.closePath(); c.fill();
  }
  function arrows(c, p, psi, scale) {
    forces.forEach((f, k) => {
      if (f.X[at] === null) return;
      c.strokeStyle = c.fillStyle = f.colour; c.lineWidth = 2.5;
      const north = f.X[at] * Math.cos(psi) - f.Y[at] * Math.sin(psi);
      const east = f.X[at] * Math.sin(psi) + f.Y[at] * Math.cos(psi);
      const length = scale * Math.min(Math.hypot(north, east) / push, 1.5), angle = Math.atan2(-north, east);
      if (length > 3) {
        const x = p[0] + length * Math.cos(angle), y = p[1] + length * Math.sin(angle);
        c.beginPath(); c.moveTo(...p); c.lineTo(x, y); c.stroke(); head(c, x, y, angle);
      }
      const turn = 2.4 * Math.max(-1.5, Math.min(1.5, f.N[at] / twist)), from = psi - Math.PI / 2, r = 17 + 6 * k;
      if (Math.abs(turn) > 0.15) {
        c.beginPath(); c.arc(p[0], p[1], r, from, from + turn, turn < 0); c.stroke();
        const end = from + turn;
        head(c, p[0] + r * Math.cos(end), p[1] + r * Math.sin(end), end + Math.sign(turn) * Math.PI / 2);
      }
      c.lineWidth = 1;
    });
  }
  function drawTrack() {
    const [c, w, h] = paper(canvas), scale = Math.min(w, h) / span;
    const px = i => [w / 2 + (i[1] - mid[1]) * scale, h / 2 - (i[0] - mid[0]) * scale];
    for (const s of data.series) {
      c.strokeStyle = c.fillStyle = s.colour; c.setLineDash(s.dash); c.globalAlpha = 0.55;
      const spot = i => s.x[i] === null || s.y[i] === null ? null : px([s.x[i], s.y[i]]);
      if (s === log) for (let i = 0; i < n; i++) { const p = spot(i); if (p) c.fillRect(p[0] - 1, p[1] - 1, 2, 2); }
      else line(c, n, spot);
      c.setLineDash([]); c.globalAlpha = 1;
      if (s.x[at] === null || s.y[at] === null) continue;
      const p = px([s.x[at], s.y[at]]), a = s.psi ? s.psi[at] : null;
      if (s === log && a !== null) arrows(c, p, a, Math.min(w, h) / 5);
      c.fillStyle = s.colour; c.beginPath();
      if (a === null) c.arc(p[0], p[1], 5, 0, 7);
      else for (const [k, r] of [[0, 11], [2.5, 8], [-2.5, 8]]) c.lineTo(p[0] + r * Math.sin(a + k), p[1] - r * Math.cos(a + k));
      c.closePath(); c.fill();
    }
    c.textBaseline = "top";
    data.series.forEach((s, i) => { c.fillStyle = s.colour; c.fillText(s.label, 8, 8 + 16 * i); });
    c.fillStyle = "#000"; c.textBaseline = "alphabetic"; c.fillText("N ↑", w - 30, 20);
    const length = Math.pow(10, Math.floor(Math.log10(span / 3)));
    c.fillRect(w - 12 - length * scale, h - 10, length * scale, 2); c.textAlign = "right";
    c.fillText(length + " m", w - 12, h - 14); c.textAlign = "left";
  }
  const across = (i, w) => margin + (w - 2 * margin) * (data.t[i] - data.t[0]) / (data.t[n - 1] - data.t[0] || 1);
  function drawTraces() {
    if (!rows.length) return;
    const [c, w, h] = paper(below);
    rows.forEach((row, k) => {
      const top = k * high_row + 16, tall = high_row - 18, most = 1.15 * reach(row.lines.flatMap(l => l.values));
      const y = v => top + tall / 2 - tall / 2 * Math.max(-1.05, Math.min(1.05, v / most));
      c.strokeStyle = "#bbb"; c.beginPath(); c.moveTo(margin, y(0)); c.lineTo(w - margin, y(0)); c.stroke();
      for (const l of row.lines) {
        c.strokeStyle = l.colour; c.setLineDash(l.dash);
        line(c, n, i => l.values[i] === null ? null : [across(i, w), y(l.values[i])]);
        c.setLineDash([]);
      }
      c.fillStyle = "#000"; c.fillText(row.label, margin, top - 4);
      c.textAlign = "right"; c.fillText("± " + Number((most).toPrecision(2)), w - margin, top - 4); c.textAlign = "left";
    });
    c.strokeStyle = "#a5270d"; c.beginPath(); c.moveTo(across(at, w), 0); c.lineTo(across(at, w), h); c.stroke();
  }
  function draw() {
    drawTrack(); drawTraces();
    slider.value = at;
    const number = v => v === null ? "–" : Number(v.toPrecision(2)).toString();
    const orders = data.orders.map(o => o.label + " " + (o.values[at] === null ? "–" : o.values[at].toFixed(1)) + " " + o.unit);
    const miss = data.series.slice(1).map(s => {
      const d = s.x[at] === null || log.x[at] === null ? null : Math.hypot(s.x[at] - log.x[at], s.y[at] - log.y[at]);
      return s.label + " " + (d === null ? "–" : d.toFixed(1) + " m");
    });
    const lacks = forces.map(f => f.label + " lacks X " + number(f.X[at]) + " N, Y " + number(f.Y[at]) + " N, N " + number(f.N[at]) + " N m");
    told.textContent = data.t[at].toFixed(0) + " s · " + [...orders, "distance to the log: " + miss.join(", "), ...lacks].join(" · ");
  }
  function run(now) {
    if (!playing) return;
    if (now - last > 1000 * 20 / n) { last = now; at = (at + 1) % n; draw(); }
    requestAnimationFrame(run);
  }
  function go(event) {
    const w = below.clientWidth, x = event.offsetX;
    let best = 0;
    for (let i = 1; i < n; i++) if (Math.abs(across(i, w) - x) < Math.abs(across(best, w) - x)) best = i;
    at = best; draw();
  }
  below.addEventListener("pointerdown", go);
  below.addEventListener("pointermove", event => { if (event.buttons) go(event); });
  slider.addEventListener("input", () => { at = Number(slider.value); draw(); });
  button.addEventListener("click", () => {
    playing = !playing; button.textContent = playing ? "Pause" : "Play"; requestAnimationFrame(run);
  });
  window.addEventListener("resize", draw);
  draw();
}
