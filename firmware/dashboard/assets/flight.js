// The flight as the page knows it: what the server has sent, and what held at a moment.
const ACTIONS = ["hover", "north", "west", "south", "east"];

class Flight {
  constructor(data) {
    this.scene = data.scene;
    this.live = data.live || [];
    this.decisions = data.decisions || [];
    this.texts = data.texts || [];
    this.whatIf = data.what_if || [];
  }

  get end() {
    return this.live.length ? this.live[this.live.length - 1].t_s : 0;
  }

  get start() {
    return this.live.length ? this.live[0].t_s : 0;
  }

  // One event of the stream. A point of the track that lies within a second of the last kept one replaces it, so that
  // a long flight stays small.
  add(kind, value) {
    if (kind === "live") Flight.thin(this.live, value, 1);
    else if (kind === "decision") this.decisions.push(value);
    else if (kind === "text") this.texts.push(value);
    else if (kind === "what_if") Flight.thin(this.whatIf, value, 10);
  }

  static thin(list, value, interval_s) {
    const previous = list[list.length - 2];
    if (previous && value.t_s - previous.t_s < interval_s) list[list.length - 1] = value;
    else list.push(value);
  }

  // The last entry of a list at or before a time; the first one before that.
  static at(list, t) {
    let low = 0, high = list.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (list[middle].t_s <= t) low = middle + 1; else high = middle;
    }
    return low > 0 ? list[low - 1] : null;
  }

  liveAt(t) {
    return Flight.at(this.live, t) || this.live[0] || null;
  }

  whatIfAt(t) {
    return Flight.at(this.whatIf, t);
  }

  decisionAt(t) {
    return Flight.at(this.decisions, t);
  }
}

const percent = (fraction, digits = 0) =>
  fraction === null || fraction === undefined ? "unknown" : `${(100 * fraction).toFixed(digits)} %`;
const number = (value, digits = 1, unit = "") =>
  value === null || value === undefined ? "unknown" : `${value.toFixed(digits)}${unit}`;
const clock = (t) => `${Math.floor(t / 60)}:${String(Math.floor(t % 60)).padStart(2, "0")}`;
const byId = (id) => document.getElementById(id);

// An element with attributes and children; text children are text, never markup.
function element(name, attributes = {}, ...children) {
  return build(document.createElement(name), attributes, children);
}

function shape(name, attributes = {}, ...children) {
  return build(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

function build(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
