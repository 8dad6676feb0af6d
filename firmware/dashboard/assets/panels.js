// The panels beside the map: who has the aircraft, the decision, the devices, the attention matrix, the messages.
const Panels = {
  status(live) {
    byId("owner").textContent = live ? live.owner : "No aircraft yet";
    byId("reason").textContent = live ? live.reason : "";
    const figures = live ? [
      ["State", live.state],
      ["Preference", `${number(live.w_data, 2)} data`],
      ["Collected", percent(live.collected, 1)],
      ["Battery", `${number(live.battery_units, 1)} units`],
      ["Spare battery", live.spare_units === null ? "not watched" : `${number(live.spare_units, 1)} units`],
      ["Charge", number(live.battery_pct, 0, " %")],
      ["At touchdown", live.land_pct === null ? "not known yet" : number(live.land_pct, 0, " %")],
      ["Height", number(live.height_m, 0, " m")],
      ["Mode", live.mode],
    ] : [];
    byId("figures").replaceChildren(...figures.map(([name, value]) =>
      element("div", {}, element("dt", {}, name), element("dd", {}, value))));
  },

  decision(decision) {
    const words = byId("decision-words");
    if (!decision) {
      words.textContent = "No decision yet.";
      byId("probabilities").replaceChildren();
      return;
    }
    words.textContent = `Number ${decision.sequence} at ${clock(decision.t_s)} in cell ${decision.cell.join(", ")}: ` +
      `${decision.action}${decision.source ? `, by ${decision.source}` : ""}.`;
    const rows = ACTIONS.flatMap((action, index) => {
      const allowed = decision.allowed[index];
      const share = decision.probabilities ? decision.probabilities[index] : null;
      const kind = !allowed ? "masked" : action === decision.action ? "chosen" : "";
      const value = !allowed ? "masked by the guard" : share === null ? "" : percent(share, 1);
      const filled = element("span", {});
      filled.style.width = `${100 * (share || 0)}%`;
      return [element("span", { class: kind }, action), element("span", { class: "track" }, filled),
        element("span", {}, value)];
    });
    byId("probabilities").replaceChildren(...rows);
  },

  devices(scene, live) {
    const [names, cells] = live ? this.heard(live) : this.planned(scene);
    const head = ["Device", ...names].map((name) => element("th", { scope: "col" }, name));
    const rows = scene.devices.map((device, index) => element("tr", {},
      element("th", { scope: "row" }, String(device.id)),
      ...cells(device, index).map((text) => element("td", {}, text))));
    byId("devices").replaceChildren(
      element("caption", { class: "hidden" }, `Devices: ${names.join(", ")}`),
      element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...rows));
  },

  // In flight: what the radio reports.
  heard(live) {
    return [["Data left", "of", "SNR", "Reachable"], (device, index) => {
      const state = live.devices[index];
      return [number(state.remaining, 0), number(device.data, 0),
        state.snr_db === null ? "not heard" : number(state.snr_db, 1, " dB"), state.reachable ? "yes" : "no"];
    }];
  },

  // Before the flight: where each device stands, and the share of the cells with line of sight to it.
  planned(scene) {
    return [["Cell", "Data", "In sight from"], (device, index) => {
      const sight = scene.sight[index] || "";
      const seen = [...sight].filter((cell) => cell === "1").length;
      return [`${device.x}, ${device.y}`, number(device.data, 0), sight ? percent(seen / sight.length) : "unknown"];
    }];
  },

  attention(scene, decision) {
    const table = byId("attention");
    if (!decision || !decision.attention) {
      table.replaceChildren(element("tbody", {}, element("tr", {}, element("td", {}, "No inference at this moment."))));
      return;
    }
    const names = ["aircraft", "preference", "map",
      ...decision.slots.map((device) => `device ${scene.devices[device] ? scene.devices[device].id : device}`)];
    const size = names.length;
    const matrix = decision.attention;
    const received = names.map((_, column) => matrix.reduce((sum, row) => sum + row[column], 0));
    const strongest = Math.max(0.01, ...matrix.flat());
    const cell = (weight, most) => {
      const node = element("td", {}, weight.toFixed(2).replace("0.", "."));
      node.style.background = `color-mix(in srgb, var(--attention) ${Math.round((38 * weight) / most)}%, var(--panel))`;
      return node;
    };
    const row = (name, weights, most) => element("tr", {}, element("th", { scope: "row" }, name),
      ...weights.slice(0, size).map((weight) => cell(weight, most)));
    table.replaceChildren(
      element("caption", { class: "hidden" }, "Attention of the second layer: rows attend to columns"),
      element("thead", {}, element("tr", {}, element("td", {}),
        ...names.map((name) => element("th", { scope: "col" }, name)))),
      element("tbody", {}, ...names.map((name, index) => row(name, matrix[index], strongest)),
        row("received", received, Math.max(0.01, ...received))));
  },

  texts(flight, t) {
    const kind = (severity) => (severity <= 3 ? "bad" : severity === 4 ? "warn" : "");
    const shown = flight.texts.filter((text) => text.t_s <= t).slice(-100).reverse();
    byId("texts").replaceChildren(...shown.map((text) => element("li", { class: kind(text.severity) },
      element("time", {}, clock(text.t_s)), text.text)));
  },
};
