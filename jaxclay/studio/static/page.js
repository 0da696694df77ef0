/* anywidget's model behind a WebSocket: the page of `jaxclay studio`. */
import widget from "/studio.js";

const WAITS = [300, 600, 1200, 2000];

class Model {
  constructor() {
    this.state = {};
    this.changed = {};
    this.handlers = new Map();
    this.waiting = [];
    this.tries = 0;
    this.connect();
  }

  connect() {
    this.open = false;
    this.socket = new WebSocket(`ws://${location.host}/socket`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = ({ data }) => this.receive(data);
    this.socket.onclose = () => {
      if (this.open) this.emit("msg:custom", { type: "lost" }, []);
      this.open = false;
      setTimeout(() => this.connect(), WAITS[Math.min(this.tries++, WAITS.length - 1)]);
    };
  }

  receive(frame) {
    const length = new DataView(frame).getUint32(0, true);
    const data = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length)));
    let at = 4 + length;
    const buffers = data.sizes.map((size) => new DataView(frame, (at += size) - size, size));
    if (data.method === "custom") this.emit("msg:custom", data.content, buffers);
    else if (data.method === "open") this.opened(data.state);
    else this.take(data.state);
  }

  opened(state) {
    this.take(state);
    this.open = true;
    this.tries = 0;
    for (const frame of this.waiting.splice(0)) this.socket.send(frame);
    if (this.known) this.emit("msg:custom", { type: "back" }, []);
    this.known = true;
  }

  take(state) {
    for (const [name, value] of Object.entries(state ?? {})) {
      if (JSON.stringify(this.state[name]) === JSON.stringify(value)) continue;
      this.state[name] = value;
      this.emit(`change:${name}`);
    }
  }

  post(data, buffers = []) {
    const bytes = buffers.map((buffer) => new Uint8Array(buffer));
    const text = new TextEncoder().encode(JSON.stringify({ ...data, sizes: bytes.map((b) => b.length) }));
    const frame = new Uint8Array(4 + text.length + bytes.reduce((sum, b) => sum + b.length, 0));
    new DataView(frame.buffer).setUint32(0, text.length, true);
    frame.set(text, 4);
    let at = 4 + text.length;
    for (const b of bytes) { frame.set(b, at); at += b.length; }
    if (this.open) this.socket.send(frame);
    else if (!this.known) this.waiting.push(frame); // what was asked before Python was there
  }

  get(name) { return this.state[name]; }

  set(name, value) { this.state[name] = this.changed[name] = value; }

  save_changes() {
    this.post({ method: "update", state: this.changed });
    this.changed = {};
  }

  send(content, _callbacks, buffers) { this.post({ method: "custom", content }, buffers); }

  on(name, act) { this.handlers.set(name, [...(this.handlers.get(name) ?? []), act]); }

  off(name, act) { this.handlers.set(name, (this.handlers.get(name) ?? []).filter((one) => one !== act)); }

  emit(name, ...values) { for (const act of this.handlers.get(name) ?? []) act(...values); }
}

widget.render({ model: new Model(), el: document.getElementById("studio") });
