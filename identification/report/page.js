/* The plots of a report: zoom, values under a cursor that all plots over time share, effects
   switched off one by one. Without this script the page shows tables of the same numbers. */
(() => {
  "use strict";
  const data = JSON.parse(document.getElementById("plots").textContent);
  const root = document.documentElement;
  const find = id => document.getElementById(id);
  const colour = name => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const HEIGHT = { time: 190, frequency: 230, signature: 250 };
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const unpack = series => series && Array.from(new Int16Array(bytes(series.data).buffer), v => v * series.scale);
  const shown = (x, digits = 3) => {
    if (x === null || x === undefined || !isFinite(x)) return "–";
    if (x === 0) return "0";
    const decimals = Math.min(Math.max(digits - 1 - Math.floor(Math.log10(Math.abs(x))), 0), 9);
    return x.toFixed(decimals).replace("-", "−");
  };
  const made = [];  // every plot: {key, u, say, idle}
  const announced = find("announced");
  let byKey = false;  // a screen reader hears the cursor only when a key moved it

  /* one plot, and its table folded */
  function place(key, height, options, columns, say, idle) {
    const holder = find("plot-" + key), readout = find("readout-" + key);
    holder.closest("figure").querySelector("details.data").open = false;
    holder.tabIndex = 0;
    holder.setAttribute("role", "application");
    holder.setAttribute("aria-roledescription", "plot with a cursor");
    holder.setAttribute("aria-describedby", "keys");
    const axis = more => ({
      stroke: () => colour("muted"), font: "12px " + getComputedStyle(document.body).fontFamily,
      grid: { stroke: () => colour("grid"), width: 1 }, ticks: { stroke: () => colour("grid"), width: 1, size: 4 }, ...more,
    });
    const plot = { key, holder, idle };
    const cursorChanged = u => {
      const i = u.cursor.idx, at = u.cursor.left >= 0 && i !== null && i !== undefined;
      readout.textContent = at ? say(u, i) : idle();
    };
    const u = new uPlot({
      width: Math.max(holder.clientWidth, 200), height, legend: { show: false }, pxAlign: 1,
      ...options,
      cursor: { y: false, points: { size: 6 }, drag: { x: true, y: false, setScale: true }, ...options.cursor },
      axes: [axis({ size: 30 }), axis({ size: 52 })],
      hooks: { ...options.hooks, setCursor: [cursorChanged] },
    }, columns, holder);
    plot.u = u;
    plot.range = [u.data[0][0], u.data[0][u.data[0].length - 1]];
    plot.silent = () => { readout.textContent = idle(); };
    plot.silent();
    made.push(plot);
    holder.addEventListener("keydown", event => key_pressed(event, plot));
    holder.addEventListener("blur", () => move_cursor(plot, null));
    return plot;
  }

  /* keys: the cursor and the range shown */
  function key_pressed(event, plot) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const u = plot.u, [low, high] = [u.scales.x.min, u.scales.x.max];
    const here = plot.at === null || plot.at === undefined ? (low + high) / 2 : plot.at;
    const step = (high - low) / (event.shiftKey ? 10 : 100);
    const to = { ArrowLeft: here - step, ArrowRight: here + step, Home: low, End: high }[event.key];
    if (to !== undefined) move_cursor(plot, Math.min(Math.max(to, low), high));
    else if (event.key === "+" || event.key === "=") zoom(plot, 0.5, here);
    else if (event.key === "-") zoom(plot, 2, here);
    else if (event.key === "Escape" || event.key === "0") zoom(plot, Infinity, here);
    else return;
    event.preventDefault();
  }
  const together = plot => plot.linked ? made.filter(p => p.linked) : [plot];
  function move_cursor(plot, x) {
    byKey = x !== null;
    for (const p of together(plot)) {
      p.at = x;
      p.u.setCursor(x === null ? { left: -10, top: -10 } : { left: p.u.valToPos(x, "x"), top: 5 });
    }
    if (byKey) announced.textContent = plot.name + ": " + find("readout-" + plot.key).textContent;
    byKey = false;
  }
  function zoom(plot, factor, about) {
    const u = plot.u, [first, last] = plot.range, width = (u.scales.x.max - u.scales.x.min) * factor;
    if (width >= last - first) return set_range(plot, first, last);
    const share = (about - u.scales.x.min) / (u.scales.x.max - u.scales.x.min);
    const low = Math.min(Math.max(about - share * width, first), last - width);
    set_range(plot, low, low + width);
  }
  function set_range(plot, low, high) {
    if (high - low < (plot.range[1] - plot.range[0]) * 1e-4) return;
    plot.u.batch(() => plot.u.setScale("x", { min: low, max: high }));
    announced.textContent = `shown: ${shown(low)} to ${shown(high)}`;
    if (plot.at !== null && plot.at !== undefined) move_cursor(plot, Math.min(Math.max(plot.at, low), high));
  }

  /* the residual over time: six plots with one cursor and one range */
  function over_time(time) {
    const effects = time.effects.map(() => true);
    let plots = [], sameScale = true;
    const piece_at = x => time.pieces.reduce((found, p, i) => p.x <= x + 1e-9 ? i : found, 0);
    const held_at = x => time.held.some(([a, b]) => a <= x && x <= b);
    const name_of = x => {
      const i = piece_at(x), p = time.pieces[i], { min, max } = plots[0].u.scales.x;
      const t = `t = ${(x - p.x + p.t).toFixed(Math.max(2, 3 - Math.floor(Math.log10(max - min))))} s`;
      return (time.pieces.length > 1 ? `piece ${i + 1}, ${t}` : t) + (held_at(x) ? ", held out" : "");
    };
    const shade = u => {
      const { ctx, bbox } = u;
      ctx.save();
      ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip();
      ctx.fillStyle = colour("held");
      for (const [a, b] of time.held) {
        const left = u.valToPos(a, "x", true);
        ctx.fillRect(left, bbox.top, u.valToPos(b, "x", true) - left, bbox.height);
      }
      ctx.restore();
    };
    const pieces = u => {
      if (time.pieces.length < 2) return;
      const { ctx, bbox } = u;
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = colour("muted");
      ctx.font = `${11 * uPlot.pxRatio}px ${getComputedStyle(document.body).fontFamily}`;
      ctx.textBaseline = "top";
      time.pieces.forEach((p, i) => {
        const x = u.valToPos(p.x, "x", true);
        if (x < bbox.left - 1 || x > bbox.left + bbox.width) return;
        ctx.beginPath(); ctx.moveTo(x, bbox.top); ctx.lineTo(x, bbox.top + bbox.height); ctx.stroke();
        if (time.pieces.length <= 12) ctx.fillText(String(i + 1), x + 4, bbox.top + 2);
      });
      ctx.restore();
    };
    plots = time.channels.map(channel => {
      const steps = new Uint16Array(bytes(channel.steps).buffer);
      const x = [], gaps = [];
      let k = 0;
      channel.counts.forEach((count, p) => {
        let t = 0;
        if (p) { gaps.push(x.length); x.push((x[x.length - 1] + time.pieces[p].x) / 2); }
        for (let j = 0; j < count; j++) { t += steps[k++]; x.push(time.pieces[p].x + t * channel.tick); }
      });
      const n = x.length - gaps.length;
      const spread = values => {  // with nothing between pieces of flight
        const out = (values || new Array(n).fill(0)).slice();
        gaps.forEach(i => out.splice(i, 0, null));
        return out;
      };
      const before = spread(unpack(channel.before)), after = spread(unpack(channel.after));
      const parts = channel.parts.map(p => p && spread(unpack(p)));
      /* with some effects left out; with none of them it is the declared model's, exactly */
      channel.chosen = () => effects.every(e => e) ? after : effects.some(e => e)
        ? after.map((a, i) => a === null ? null : parts.reduce((sum, p, e) => p && !effects[e] ? sum + p[i] : sum, a)) : before;
      channel.chosen_rms = () => {
        if (!effects.some(e => e) && effects.length) return channel.rms;
        const weight = [1, ...effects.map(e => e ? 0 : 1)];
        return Math.sqrt(Math.max(channel.products.reduce(
          (sum, row, i) => sum + row.reduce((s, v, j) => s + weight[i] * weight[j] * v, 0), 0), 0));
      };
      const idle = () => `rms ${shown(channel.rms, 2)} → ${shown(channel.chosen_rms(), 2)} ${channel.unit}`;
      /* the cursor's own time: samples that were kept differ from channel to channel */
      const say = (u, i) => `${name_of(u.posToVal(u.cursor.left, "x"))}: before ${shown(u.data[1][i])}, after ${shown(u.data[2][i])} ${channel.unit}`;
      const line = name => ({ stroke: () => colour(name), width: 1.3, points: { show: false } });
      const plot = place(channel.key, HEIGHT.time, {
        scales: { x: { time: false }, y: { range: (u, low, high) => {
          if (sameScale) return [-channel.limit, channel.limit];
          const edge = 1.08 * Math.max(Math.abs(low), Math.abs(high)) || 1;
          return [-edge, edge];
        } } },
        series: [{}, line("before"), line("after")],
        cursor: { sync: { key: "time", scales: ["x", null], filters: { pub: type => type !== "mousedown" && type !== "mouseup" } } },
        hooks: {
          drawClear: [shade], draw: [pieces],
          setScale: [(u, key) => {
            const { min, max } = u.scales.x;
            if (key === "x") for (const p of plots)
              if (p.u.scales.x.min !== min || p.u.scales.x.max !== max) p.u.batch(() => p.u.setScale("x", { min, max }));
          }],
        },
      }, [x, before, channel.chosen()], say, idle);
      Object.assign(plot, { linked: true, name: channel.symbol, range: [time.pieces[0].x, time.end], channel, before });
      return plot;
    });
    const show = () => plots.forEach(p => {
      const { min, max } = p.u.scales.x;
      p.u.batch(() => {
        p.u.setData([p.u.data[0], p.before, p.channel.chosen()], false);
        p.u.setScale("x", { min, max });
      });
      p.silent();
    });
    const each = (name, act) => document.querySelectorAll(`#controls input[name=${name}]`).forEach((box, i) =>
      box.addEventListener("change", () => act(box, i)));
    each("effect", (box, i) => {
      effects[i] = box.checked;
      show();
      announced.textContent = plots.map(p => `${p.name} ${p.idle()}`).join("; ");
    });
    each("line", (box, i) => plots.forEach(p => p.u.setSeries(i + 1, { show: box.checked })));
    each("same", box => { sameScale = box.checked; show(); });
    const shift = share => {
      const u = plots[0].u, width = u.scales.x.max - u.scales.x.min;
      const low = Math.min(Math.max(u.scales.x.min + share * width, plots[0].range[0]), plots[0].range[1] - width);
      set_range(plots[0], low, low + width);
    };
    const middle = () => (plots[0].u.scales.x.min + plots[0].u.scales.x.max) / 2;
    const acts = { in: () => zoom(plots[0], 0.5, middle()), out: () => zoom(plots[0], 2, middle()),
      earlier: () => shift(-0.5), later: () => shift(0.5), all: () => zoom(plots[0], Infinity, middle()) };
    document.querySelectorAll("#controls button").forEach(b => b.addEventListener("click", acts[b.value]));
    find("controls").hidden = false;
  }

  function over_frequency(spectra) {
    for (const s of spectra) {
      const floor = 1e-5 * Math.max(...s.before, ...s.after);
      const series = [s.x, s.before.map(v => Math.max(v, floor)), s.after.map(v => Math.max(v, floor))];
      const line = name => ({ stroke: () => colour(name), width: 1.6, points: { show: false } });
      const plot = place(s.key, HEIGHT.frequency, {
        scales: { x: { time: false }, y: { distr: 3 } },
        series: [{}, line("before"), line("after")],
      }, series, (u, i) => `${shown(s.x[i])} Hz: before ${shown(s.before[i])}, after ${shown(s.after[i])} ${s.unit}`, () => "");
      plot.name = "spectrum";
    }
  }

  function signatures(all) {
    for (const s of all) {
      const residual = unpack(s.residual) || s.x.map(() => 0), fitted = unpack(s.fitted) || s.x.map(() => 0);
      const columns = s.middle.length ? uPlot.join([[s.x, residual, fitted], [s.middle, s.mean]]) : [s.x, residual, fitted, s.x.map(() => null)];
      const dots = (name, size) => ({ stroke: () => colour(name), paths: () => null,
        points: { show: true, size, fill: () => colour(name), stroke: () => colour(name), width: 0 } });
      const say = (u, i) => {
        const [x, r, f, m] = u.data.map(column => column[i]);
        const told = [["residual", r], ["effect", f], ["mean", m]].filter(([, v]) => v !== null && v !== undefined);
        return `${shown(x)}: ${told.map(([what, v]) => `${what} ${shown(v)}`).join(", ")} ${s.unit}`;
      };
      const plot = place(s.key, HEIGHT.signature, {
        scales: { x: { time: false } },
        series: [{}, dots("before", 4), dots("after", 3), { stroke: () => colour("ink"), width: 1.8, spanGaps: true, points: { show: false } }],
      }, columns, say, () => "");
      plot.name = s.effect;
    }
  }

  root.classList.add("scripted");
  if (data.time) over_time(data.time);
  if (data.frequency) over_frequency(data.frequency);
  if (data.signatures) signatures(data.signatures);
  const fit = () => made.forEach(p => {
    const width = Math.max(p.holder.clientWidth, 200);
    if (width !== p.u.width) p.u.setSize({ width, height: p.u.height });
  });
  new ResizeObserver(fit).observe(document.body);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => made.forEach(p => p.u.redraw()));
})();
