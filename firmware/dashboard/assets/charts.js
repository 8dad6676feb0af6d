// Data and battery over time, and the what-if strip.
const Charts = {
  draw(flight, t) {
    const points = flight.live;
    const span = Math.max(1, flight.end - flight.start);
    const units = flight.scene.battery_units || Math.max(1, ...points.map((p) => p.battery_units || 0));
    const names = [["data collected", "--data"], ["battery left", "--battery"]].map(([name, variable]) => {
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = `var(${variable})`;
      return element("span", {}, swatch, name);
    });
    byId("charts").replaceChildren(element("p", { class: "legend" }, ...names), this.chart("Share of the data collected and of the battery units left, over time", [
      { colour: "var(--data)", value: (p) => p.collected },
      { colour: "var(--battery)", value: (p) => (p.battery_units === null ? null : p.battery_units / units) },
    ], points, flight.start, span, t));
  },

  chart(words, series, points, start, span, t) {
    const [width, height, left, bottom] = [Math.max(280, byId("charts").clientWidth), 150, 40, 22];
    const x = (time) => left + ((width - left - 8) * (time - start)) / span;
    const y = (share) => 8 + (height - bottom - 8) * (1 - Math.min(1, share));
    const drawing = shape("svg", { class: "chart", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": words });
    const label = (text, px, py, anchor = "end") =>
      shape("text", { x: px, y: py, "text-anchor": anchor, "font-size": 11, fill: "var(--soft)" }, text);
    for (const share of [0, 0.5, 1]) {
      drawing.append(shape("line", { x1: left, x2: width - 8, y1: y(share), y2: y(share), stroke: "var(--line)" }),
        label(`${100 * share} %`, left - 4, y(share) + 4));
    }
    drawing.append(label(clock(start), left, height - 6, "start"), label(clock(start + span), width - 8, height - 6));
    series.forEach(({ colour: stroke, value }) => {
      const shown = points.filter((p) => value(p) !== null && value(p) !== undefined);
      const line = shown.map((p) => `${x(p.t_s).toFixed(1)},${y(value(p)).toFixed(1)}`).join(" ");
      drawing.append(shape("polyline", { points: line, fill: "none", stroke, "stroke-width": 2 }));
    });
    drawing.append(shape("line", { x1: x(t), x2: x(t), y1: 8, y2: height - bottom, stroke: "var(--ink)" }));
    return drawing;
  },

  whatIf(flight, t) {
    const whatIf = flight.whatIfAt(t);
    byId("what-if-box").hidden = !whatIf;
    if (!whatIf) return;
    const { grid, devices, terminal } = flight.scene;
    const live = flight.liveAt(t);
    const up = (y) => grid.height - y;
    byId("what-if").replaceChildren(...whatIf.options.map((option) => {
      const now = live && Math.abs(live.w_data - option.w) < 1e-6;
      const drawing = shape("svg", { viewBox: `0 0 ${grid.width} ${grid.height}`, role: "img",
        "aria-label": `Predicted path at a preference of ${option.w}` },
      shape("image", { href: MapView.picture, width: grid.width, height: grid.height, opacity: 0.55, preserveAspectRatio: "none" }),
      ...devices.map((d) => shape("circle", { cx: d.x + 0.5, cy: up(d.y + 0.5), r: 0.7, fill: "var(--device)" })),
      shape("rect", { x: terminal[0], y: up(terminal[1] + 1), width: 1, height: 1, fill: "var(--terminal)" }),
      MapView.path(option.path, up, "small-path"),
      shape("circle", { cx: option.path[0][0] + 0.5, cy: up(option.path[0][1] + 0.5), r: 0.8, fill: "var(--aircraft)" }));
      return element("div", { class: now ? "card now" : "card" }, drawing,
        element("p", {}, element("strong", {}, `w = ${option.w}`), now ? " (now)" : ""),
        element("p", {}, `brings home ${percent(option.collected, 0)}`),
        element("p", {}, `for ${number(option.energy, 1)} more units`));
    }));
  },
};
