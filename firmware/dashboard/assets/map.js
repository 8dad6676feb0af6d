// The city with everything that moves over it. One unit of the drawing is one cell; north is up.
function mix(low, high, share) {
  const channel = (text, index) => parseInt(text.slice(1 + 2 * index, 3 + 2 * index), 16);
  const value = (index) => Math.round(channel(low, index) * (1 - share) + channel(high, index) * share);
  return `rgb(${value(0)} ${value(1)} ${value(2)})`;
}

const MapView = {
  // The buildings as an image, for the small maps.
  picture: "",

  // Paints the buildings once per size and colour scheme.
  city(scene) {
    const { width, height } = scene.grid;
    const stage = byId("map");
    stage.style.aspectRatio = `${width} / ${height}`;
    byId("overlay").setAttribute("viewBox", `0 0 ${width} ${height}`);
    const scale = Math.max(4, Math.min(24, Math.round((stage.clientWidth * devicePixelRatio) / width)));
    const canvas = byId("city");
    canvas.width = width * scale;
    canvas.height = height * scale;
    const context = canvas.getContext("2d");
    context.fillStyle = colour("--city");
    context.fillRect(0, 0, canvas.width, canvas.height);
    const tallest = Math.max(1, ...scene.heights_m);
    const [low, high] = [colour("--roof-low"), colour("--roof-high")];
    scene.heights_m.forEach((height_m, index) => {
      if (!height_m) return;
      const [x, y] = [index % width, Math.floor(index / width)];
      context.fillStyle = mix(low, high, height_m / tallest);
      context.fillRect(x * scale, (height - 1 - y) * scale, scale, scale);
    });
    this.picture = canvas.toDataURL();
    if (scene.fence) this.fence(context, scene, scale);
    this.sight(context, scene, scale);
    byId("legend").textContent = this.legend(scene, tallest);
  },

  legend(scene, tallest) {
    const { cell_m, rotation_deg } = scene.grid;
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    return `Buildings up to ${tallest} m, the ${dark ? "brighter" : "darker"} the taller. Cells of ${cell_m} m, ` +
      `grid north ${rotation_deg ? `${rotation_deg}° clockwise of true north` : "up"}. ` +
      `${scene.fence ? "Hatched: outside the fence. " : ""}Square: terminal. Ring: device, filled by the data left, ` +
      "dashed out of reach. Line to a device: attention.";
  },

  // Cells that may not be flown over, hatched.
  fence(context, scene, scale) {
    const { width, height } = scene.grid;
    context.strokeStyle = colour("--fence");
    context.lineWidth = Math.max(1, scale / 12);
    scene.fence.forEach((allowed, index) => {
      if (allowed) return;
      const [left, top] = [(index % width) * scale, (height - 1 - Math.floor(index / width)) * scale];
      context.beginPath();
      context.moveTo(left, top + scale);
      context.lineTo(left + scale, top);
      context.stroke();
    });
  },

  // The cells from which the chosen device is in line of sight.
  sight(context, scene, scale) {
    const cells = scene.sight[Number(byId("sight").value)];
    if (byId("sight").value === "" || !cells) return;
    const { width, height } = scene.grid;
    context.fillStyle = colour("--sight");
    [...cells].forEach((seen, index) => {
      if (seen === "1") {
        context.fillRect((index % width) * scale, (height - 1 - Math.floor(index / width)) * scale, scale, scale);
      }
    });
  },

  // An arrow to true north, which is not up where the grid is rotated.
  compass({ grid }) {
    const [x, y] = [grid.width - 1.6, 1.8];
    const turn = `rotate(${-grid.rotation_deg} ${x} ${y})`;
    return [
      shape("path", { class: "north", d: `M${x} ${y - 1.2} l.55 2 l-.55 -.4 l-.55 .4 z`, transform: turn }),
      shape("text", { x, y: y + 1.5, "text-anchor": "middle" }, "N"),
    ];
  },

  // Everything that depends on the moment.
  draw(flight, t) {
    const { scene } = flight;
    const overlay = byId("overlay");
    const live = flight.liveAt(t);
    const decision = flight.decisionAt(t);
    const up = (y) => scene.grid.height - y;
    const parts = [];
    const [tx, ty] = scene.terminal;
    parts.push(shape("rect", { class: "terminal", x: tx + 0.1, y: up(ty + 0.9), width: 0.8, height: 0.8 }));
    const points = flight.live.filter((point) => point.t_s <= t && point.x !== null);
    if (points.length > 1) {
      parts.push(shape("polyline", { class: "track", points: points.map((p) => `${p.x},${up(p.y)}`).join(" ") }));
    }
    const whatIf = flight.whatIfAt(t);
    const chosen = whatIf && live && whatIf.options.find((option) => Math.abs(option.w - live.w_data) < 0.126);
    if (chosen && t - whatIf.t_s < 20) parts.push(this.path(chosen.path, up, "ahead"));
    if (live && live.x !== null && decision) parts.push(...this.attention(scene, live, decision, up));
    scene.devices.forEach((device, index) => parts.push(...this.device(device, live && live.devices[index], up, scene.grid.width)));
    if (live && live.x !== null) {
      parts.push(shape("circle", { class: "aircraft", cx: live.x, cy: up(live.y), r: 0.55 }));
    }
    overlay.replaceChildren(...parts, ...this.compass(scene));
    byId("map-words").textContent = this.words(scene, live, decision);
  },

  path(cells, up, kind) {
    return shape("polyline", { class: kind, points: cells.map(([x, y]) => `${x + 0.5},${up(y + 0.5)}`).join(" ") });
  },

  device(device, state, up, width) {
    const [x, y] = [device.x + 0.5, up(device.y + 0.5)];
    const share = state && device.data > 0 ? Math.min(1, state.remaining / device.data) : 1;
    const out = state && !state.reachable;
    return [
      shape("circle", { class: out ? "device out" : "device", cx: x, cy: y, r: 0.7 }),
      shape("circle", { class: "full", cx: x, cy: y, r: (0.55 * Math.sqrt(share)).toFixed(3) }),
      // Inside the map at its east edge, too.
      device.x + 3 > width
        ? shape("text", { x: x - 0.85, y: y - 0.35, "text-anchor": "end" }, String(device.id))
        : shape("text", { x: x + 0.85, y: y - 0.35 }, String(device.id)),
    ];
  },

  // What each device receives from the aircraft's token, as lines whose width is the weight.
  attention(scene, live, decision, up) {
    if (!decision.attention) return [];
    const [from] = decision.attention;
    return decision.slots.map((device, slot) => {
      const weight = from[3 + slot];
      const site = scene.devices[device];
      if (!site || !(weight > 0.01)) return null;
      return shape("line", {
        class: "attends", x1: live.x, y1: up(live.y), x2: site.x + 0.5, y2: up(site.y + 0.5),
        "stroke-width": (0.05 + 0.9 * weight).toFixed(3), "stroke-opacity": (0.25 + 0.75 * weight).toFixed(2),
      });
    }).filter(Boolean);
  },

  words(scene, live, decision) {
    if (!live || live.x === null) return "No position yet.";
    const heading = decision ? ` Last decision: ${decision.action}.` : "";
    return `Aircraft in cell ${Math.floor(live.x)}, ${Math.floor(live.y)}; terminal in cell ${scene.terminal.join(", ")}; ` +
      `${scene.devices.length} devices.${heading}`;
  },
};
