// Wires the parts: one moment is shown, live or scrubbed to.
const Page = {
  flight: null,
  following: true,
  pending: false,

  show(data) {
    this.flight = new Flight(data);
    const { scene } = this.flight;
    byId("title").textContent = scene.title;
    document.title = `Gleaner: ${scene.title}`;
    document.body.classList.toggle("plan", !scene.controls && this.flight.live.length === 0);
    byId("sight").replaceChildren(element("option", { value: "" }, "no device"),
      ...scene.devices.map((device, index) => element("option", { value: index }, `device ${device.id}`)));
    byId("sight-box").hidden = scene.sight.length === 0;
    MapView.city(scene);
    Controls.build(scene);
    this.refresh();
  },

  get t() {
    return this.following ? this.flight.end : Number(byId("scrub").value);
  },

  // Draws at most once a frame, however many events arrive.
  refresh() {
    if (this.pending || !this.flight) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.draw();
    });
  },

  draw() {
    const { flight, t } = this;
    const scrub = byId("scrub");
    scrub.min = flight.start;
    scrub.max = flight.end;
    if (this.following) scrub.value = flight.end;
    byId("scrub-time").textContent = clock(t - flight.start);
    byId("follow").setAttribute("aria-pressed", String(this.following));
    const live = flight.liveAt(t);
    const decision = flight.decisionAt(t);
    MapView.draw(flight, t);
    Panels.status(live);
    Panels.decision(decision);
    Panels.devices(flight.scene, live);
    Panels.attention(flight.scene, decision);
    Panels.texts(flight, t);
    Charts.draw(flight, t);
    Charts.whatIf(flight, t);
    Controls.reflect(live);
  },

  link(kind, words) {
    const pill = byId("link");
    if (pill.textContent === words) return;
    pill.className = `pill ${kind}`;
    pill.textContent = words;
  },

  start() {
    byId("scrub").addEventListener("input", () => {
      this.following = false;
      this.refresh();
    });
    byId("follow").addEventListener("click", () => {
      this.following = true;
      this.refresh();
    });
    const repaint = () => {
      if (!this.flight) return;
      MapView.city(this.flight.scene);
      this.refresh();
    };
    byId("sight").addEventListener("change", repaint);
    addEventListener("resize", repaint);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
    const embedded = Source.embedded();
    if (embedded) {
      this.link("good", embedded.live.length ? "finished flight" : "mission");
      byId("follow").textContent = "End";
      this.show(embedded);
      return;
    }
    this.link("warn", "connecting");
    Source.follow(
      (data) => this.show(data),
      (kind, value) => {
        this.flight.add(kind, value);
        this.refresh();
      },
      (kind, words) => this.link(kind, words),
    );
  },
};

// Sends what a ground station would send, and shows the acknowledgement.
const Controls = {
  touched: false,

  build(scene) {
    const box = byId("controls");
    box.hidden = !scene.controls;
    if (!scene.controls || box.dataset.built) return;
    box.dataset.built = "yes";
    const slider = byId("preference");
    slider.addEventListener("input", () => {
      this.touched = true;
      byId("preference-value").textContent = Number(slider.value).toFixed(2);
    });
    slider.addEventListener("change", () => this.send({ preference: Number(slider.value) }));
    const button = (words, command, kind = "") => {
      const node = element("button", { type: "button", class: kind }, words);
      node.addEventListener("click", () => this.send(command));
      return node;
    };
    byId("presets").replaceChildren(
      ...[["energy only", 0], ["0.25", 0.25], ["balanced", 0.5], ["0.75", 0.75], ["data only", 1]]
        .map(([words, w]) => button(words, { preference: w })));
    byId("requests").replaceChildren(button("Engage", { request: "engage" }, "main"),
      button("Shadow", { request: "shadow" }), button("Return now", { request: "return" }),
      button("Off", { request: "off" }));
    byId("incidents-box").hidden = scene.incidents.length === 0;
    byId("incidents").replaceChildren(...scene.incidents.map((name) => button(name, { incident: name })));
  },

  // Follows the preference that the aircraft reports, except while it is being dragged.
  reflect(live) {
    const slider = byId("preference");
    if (!live || this.touched || document.activeElement === slider) return;
    slider.value = live.w_data;
    byId("preference-value").textContent = live.w_data.toFixed(2);
  },

  async send(command) {
    const answer = byId("answer");
    answer.textContent = "sent, waiting for the acknowledgement";
    try {
      const { words } = await Source.send(command);
      answer.textContent = words;
    } catch (error) {
      answer.textContent = `not done: ${error.message}`;
    }
    this.touched = false;
  },
};

Page.start();
