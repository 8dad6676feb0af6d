// Where the flight comes from: a finished one in this file, or a server that streams it.
//
// The stream is read with fetch, since an EventSource cannot carry an access token. The token stands in the fragment of
// the address (#token=...), which browsers never send.
const Source = {
  token: new URLSearchParams(location.hash.slice(1)).get("token"),

  headers(extra = {}) {
    return this.token ? { ...extra, Authorization: `Bearer ${this.token}` } : extra;
  },

  // The flight in this file, if it holds one.
  embedded() {
    const text = byId("flight").textContent.trim();
    return text ? JSON.parse(text) : null;
  },

  // Follows the server for ever: the whole flight so far, then its events; after an error again from the start.
  async follow(onFlight, onEvent, onLink) {
    let wait_ms = 500;
    for (;;) {
      try {
        const response = await fetch("api/events", { headers: this.headers(), cache: "no-store" });
        if (response.status === 401) {
          onLink("bad", "access token missing or wrong: open the address that the program printed");
          return;
        }
        if (!response.ok) throw new Error(response.status === 503 ? "too many viewers" : `status ${response.status}`);
        wait_ms = 500;
        await this.read(response.body.getReader(), (kind, value) => {
          if (kind === "flight") {
            onFlight(value);
            onLink("good", "live");
          } else onEvent(kind, value);
        });
        onLink("warn", "connection closed, trying again");
      } catch (error) {
        onLink("warn", `no connection (${error.message}), trying again`);
      }
      await new Promise((resume) => setTimeout(resume, wait_ms));
      wait_ms = Math.min(5000, wait_ms * 2);
    }
  },

  // Server-sent events: blocks of "event:" and "data:" lines, parted by an empty line.
  async read(reader, onEvent) {
    const decoder = new TextDecoder();
    let buffer = "";
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      buffer += decoder.decode(value, { stream: true });
      for (let end = buffer.indexOf("\n\n"); end >= 0; end = buffer.indexOf("\n\n")) {
        const block = buffer.slice(0, end);
        buffer = buffer.slice(end + 2);
        const kind = /^event: ?(.*)$/m.exec(block);
        const data = /^data: ?(.*)$/m.exec(block);
        if (kind && data) onEvent(kind[1], JSON.parse(data[1]));
      }
    }
  },

  // Sends a command; the answer says what the aircraft acknowledged.
  async send(command) {
    const response = await fetch("api/command", {
      method: "POST",
      headers: this.headers({ "Content-Type": "application/json" }),
      body: JSON.stringify(command),
    });
    const text = await response.text();
    if (!response.ok) throw new Error(text || `status ${response.status}`);
    return JSON.parse(text);
  },
};
