/* The front end of jaxclay's modeller: one ES module in anywidget's form, nothing fetched.

   Body: WebGL2, written out here, or a 2D canvas where there is none. Over it a 2D canvas with the
   tool, which follows the pointer at once, the contour, the zone that moves and the target.
   Lengths are over l, the height of the piece when it first became clay. */

const TILT = 0.19; // radians that the eye looks down
const [COS, SIN] = [Math.cos(TILT), Math.sin(TILT)];
const SEGMENTS = 128;
const MOST_RINGS = 288;
const LITE_RINGS = 110; // where no GPU helps, about
const CORNER = 6; // rings of a foot or a lip: its middle, and five around it
const IN_FLIGHT = [[0, 1], [12, 2], [25, 3]]; // requests, from so many ms under way without the solve
const APART_MS = 12; // from one request to the next: a screen shows no more
const THINNEST = 0.02;
const NUDGE = 0.01;
const FINEST = 0.001; // of the tool's way, that is told
const CALM_MS = 160; // without a move: the tool rests
const READ_MS = 100; // between two readings while the tool moves: laying the page out takes time
const KEYS_MS = 700; // without an arrow: the stroke of the keyboard is done
const PATIENCE_MS = 5000;
const KEPT = "jaxclay-studio-piece";

const SLIDERS = {
  k: ["Stiffness k", "against a change of thickness", 0.05, 20],
  mu: ["Friction μ", "against a shift of the clay", 0.02, 20],
  alpha: ["Tension α", "smoothness of first order, in snake units", 0.1, 1000],
  beta: ["Bending β", "smoothness of second order, in snake units", 0.1, 100000],
};
const CHOICES = {
  method: ["Method", ["newton", "lbfgs-preconditioned", "greedy", "greedy-refined"]],
  scheme: ["Scheme", ["slices", "paper"]],
  slices: ["Resolution", [[0, "as the tolerance needs"], [64, "64 slices"], [128, "128 slices"],
    [256, "256 slices"]]],
};
const STARTS = ["cylinder", "cone", "ball", "teapot", "amphora"];

const CSS = `
.jc { --ink:#2b2420; --soft:#766a61; --line:#e3dad0; --card:#fffdfa; --paper:#f5efe7;
  --accent:#b4532f; --on-accent:#fff; --zone:#2f6f8f; --glow:#fdf9f3; --shade:#dccfc0; --good:#3f7d4e;
  --warn:#a65a00; color:var(--ink); background:var(--paper); font:14px/1.45 system-ui,-apple-system,
  "Segoe UI",Roboto,sans-serif; display:grid; grid-template-columns:minmax(0,1fr) 304px; gap:14px;
  padding:14px; border-radius:16px; box-sizing:border-box; align-items:start; }
.jc.dark { --ink:#efe6dc; --soft:#a99c90; --line:#3d352f; --card:#26211d; --paper:#1b1714;
  --accent:#dd7c53; --on-accent:#1b1210; --zone:#7fc0de; --glow:#4a3f37; --shade:#1d1815;
  --good:#7fc48f; --warn:#f0b056; }
.jc *, .jc *::before { box-sizing:border-box; }
.jc .stage { position:sticky; top:14px; height:max(470px, var(--tall, 640px)); border-radius:14px; overflow:hidden;
  border:1px solid var(--line); touch-action:none; cursor:grab; user-select:none; -webkit-user-select:none;
  background:radial-gradient(ellipse 75% 70% at 46% 42%, var(--glow), var(--shade)); }
.jc .stage.drag { cursor:grabbing; }

.jc .stage { outline:none; }
.jc .stage.keys:focus { outline:3px solid var(--accent); outline-offset:2px; }
.jc canvas { position:absolute; display:block; pointer-events:none; }
.jc .top { position:absolute; left:12px; right:12px; top:12px; display:flex; gap:8px; align-items:center;
  flex-wrap:wrap; pointer-events:none; }
.jc .top > * { pointer-events:auto; }
.jc .pill { display:inline-flex; gap:7px; align-items:center; padding:5px 11px; border-radius:99px;
  background:color-mix(in srgb, var(--card) 84%, transparent); border:1px solid var(--line);
  font-size:12.5px; color:var(--soft); }
.jc .pill::before { content:""; width:8px; height:8px; border-radius:50%; background:var(--warn); }
.jc .pill.good::before { background:var(--good); }
.jc .grow { flex:1; }
.jc .hint { position:absolute; left:50%; bottom:14px; transform:translateX(-50%); width:max-content;
  max-width:calc(100% - 28px); text-align:center; padding:8px 16px; border-radius:12px; font-size:14px;
  background:color-mix(in srgb, var(--card) 90%, transparent); border:1px solid var(--line);
  pointer-events:none; transition:opacity .6s; }
.jc .hint.gone { opacity:0; }
.jc .note { position:absolute; left:50%; top:58px; transform:translateX(-50%); max-width:calc(100% - 28px);
  padding:8px 14px; border-radius:10px; background:var(--card); border:1px solid var(--warn);
  color:var(--ink); font-size:13.5px; box-shadow:0 4px 18px #0002; }
.jc .note[hidden] { display:none; }
.jc .note button { margin-left:10px; }
.jc button, .jc select, .jc .file { font:inherit; color:var(--ink); background:var(--card);
  border:1px solid var(--line); border-radius:9px; padding:6px 11px; cursor:pointer; min-height:34px; }
.jc button:hover:not(:disabled) { border-color:var(--accent); }
.jc button:disabled { opacity:.42; cursor:default; }
.jc button.main { background:var(--accent); color:var(--on-accent); border-color:var(--accent); }
.jc button[aria-pressed=true] { background:var(--accent); color:var(--on-accent); border-color:var(--accent); }
.jc :is(button,select,input,summary):focus-visible { outline:2px solid var(--accent); outline-offset:2px; }
.jc .side { display:flex; flex-direction:column; gap:10px; min-width:0; }
.jc .card { background:var(--card); border:1px solid var(--line); border-radius:12px; padding:10px 13px; }
.jc summary { font-weight:600; cursor:pointer; list-style:none; display:flex; align-items:center; }
.jc summary::-webkit-details-marker { display:none; }
.jc summary::after { content:"›"; margin-left:auto; transform:rotate(90deg); color:var(--soft); }
.jc details[open] > summary { margin-bottom:8px; }
.jc details[open] > summary::after { transform:rotate(-90deg); }
.jc .row { display:flex; gap:8px; align-items:center; margin:6px 0; flex-wrap:wrap; }
.jc .row > select, .jc .row > button { flex:1 1 auto; min-width:0; }
.jc label.slide { display:grid; grid-template-columns:1fr auto; gap:0 8px; margin:6px 0; font-size:13px; }
.jc label.slide output { color:var(--soft); font-variant-numeric:tabular-nums; }
.jc label.slide input { grid-column:1/3; width:100%; accent-color:var(--accent); margin:2px 0; height:20px; }
.jc label.pick { display:grid; grid-template-columns:86px 1fr; align-items:center; gap:8px; margin:6px 0;
  font-size:13px; }
.jc label.pick input[type=number] { font:inherit; color:inherit; background:transparent;
  border:1px solid var(--line); border-radius:9px; padding:5px 8px; width:100%; min-height:34px; }
.jc dl { display:grid; grid-template-columns:max-content 1fr; gap:3px 12px; margin:0; font-size:13px; width:auto; }
.jc dl > dt { color:var(--soft); font-weight:400; width:auto; float:none; margin:0; }
.jc dl > dd { margin:0; width:auto; float:none; text-align:right; font-variant-numeric:tabular-nums; }
.jc .bar { grid-column:1/3; display:flex; height:7px; border-radius:4px; overflow:hidden; margin:3px 0 5px;
  background:var(--line); }
.jc .bar i { display:block; height:100%; }
.jc .status { font-size:13px; margin-top:7px; min-height:1.4em; color:var(--soft); }
.jc .status.warn { color:var(--warn); font-weight:600; }
.jc .sr { position:absolute; width:1px; height:1px; overflow:hidden; clip-path:inset(50%); }
.jc.narrow { grid-template-columns:minmax(0,1fr); }
.jc.narrow .stage { position:relative; top:0; height:clamp(400px, 62vh, 620px); }
.jc.narrow .side { display:grid; grid-template-columns:repeat(auto-fill,minmax(min(100%,258px),1fr));
  align-items:start; }
@media (prefers-reduced-motion:reduce) { .jc .hint { transition:none; } }
`;

/* Each program is HEAD, LIGHT where it asks for light, and its own text. With a GPU every pixel is lit,
   its normal roughened by noise. Without one (LITE) only vertices are, and grooves and noise, a picture
   of it, tint the pixels between: a frame then takes half the time. */
const HEAD = `#version 300 es
precision highp float;
precision highp int;
uniform vec2 tilt; // cos, sin of the angle that the eye looks down
uniform vec2 turn; uniform int wheel; uniform vec3 colour; uniform vec2 foot; uniform float dark;
`;
const LIGHT = `
const vec3 KEY = normalize(vec3(-0.62, 0.62, 0.62));
vec3 light(vec3 n) {
  vec3 eye = vec3(0.0, tilt.y, tilt.x);
  vec3 fill = normalize(vec3(0.85, 0.12, 0.45));
  vec3 back = normalize(vec3(0.55, 0.42, -0.72));
  float k = max((dot(n, KEY) + 0.22) / 1.22, 0.0), f = max((dot(n, fill) + 0.3) / 1.3, 0.0);
  vec3 all = vec3(1.0, 0.95, 0.88) * k * k * 1.32 + vec3(0.62, 0.74, 0.92) * f * 0.26;
  all += mix(vec3(0.30, 0.25, 0.21), vec3(0.46, 0.47, 0.50), n.y * 0.5 + 0.5) * mix(0.72, 0.5, dark);
  float edge = pow(1.0 - max(dot(n, eye), 0.0), 3.0);
  return all + vec3(1.0, 0.86, 0.72) * edge * max(dot(n, back) + 0.35, 0.0) * 0.55;
}
float shine(vec3 n) {
  float glance = max(dot(n, normalize(KEY + vec3(0.0, tilt.y, tilt.x))), 0.0);
  return (pow(glance, 26.0) + 0.35 * pow(glance, 6.0)) * (wheel == 0 ? 0.16 : 0.05);
}
float shadow(vec3 place, vec3 n) {
  if (wheel == 0) return mix(0.62, 1.0, smoothstep(-0.02, 0.16, place.y));
  if (n.y <= 0.7) return 1.0;
  float contact = smoothstep(foot.x * 0.82, foot.x + 0.16, length(place.xz));
  float thrown = smoothstep(0.72, 1.35, length((place.xz - vec2(0.2, -0.12)) / max(foot.y, 0.05)));
  return mix(0.42, 1.0, contact) * mix(0.7, 1.0, thrown);
}
`;

const VERTEX = `
layout(location=0) in vec2 grid;
uniform highp sampler2D profile;
uniform vec4 eye; // pixels to clip: scale x, scale y, middle, foot
out vec3 place; out vec3 normal; out float open;
out vec3 lit; out vec2 lean; out vec3 skin;
void main() {
  int ring = int(grid.x);
  vec4 q = texelFetch(profile, ivec2(ring, 0), 0);
  vec4 more = texelFetch(profile, ivec2(ring, 1), 0); // openness, and how far along the contour
  open = more.x;
  vec2 a = vec2(cos(grid.y), sin(grid.y));
  place = vec3(q.x * a.x, q.y, q.x * a.y);
  normal = vec3(q.z * a.x, q.w, q.z * a.y);
  float up = place.y * tilt.x - place.z * tilt.y;
  float near = place.y * tilt.y + place.z * tilt.x;
  gl_Position = vec4(place.x * eye.x + eye.z, up * eye.y + eye.w, -near * 0.08, 1.0);
#ifdef LITE
  vec3 n = normalize(normal);
  float shade = open * shadow(place, n);
  vec3 dim = light(n);
  lit = dim * shade;
  lean = vec2(dot(light(normalize(n + vec3(0.0, 0.06, 0.0))) - dim, vec3(0.33)), shine(n)) * shade;
  skin = vec3((grid.y - atan(turn.y, turn.x)) / 6.2831853, place.y, more.y);
#endif
}`;

const FRAGMENT = `
in vec3 place; in vec3 normal; in float open;
out vec4 shown;
float hash(vec3 p) { p = fract(p * 0.3183099 + 0.1); p *= 17.0;
  return fract(p.x * p.y * p.z * (p.x + p.y + p.z)); }
float noise(vec3 x) { vec3 i = floor(x), f = fract(x); f = f * f * (3.0 - 2.0 * f);
  return mix(mix(mix(hash(i), hash(i + vec3(1,0,0)), f.x),
    mix(hash(i + vec3(0,1,0)), hash(i + vec3(1,1,0)), f.x), f.y),
    mix(mix(hash(i + vec3(0,0,1)), hash(i + vec3(1,0,1)), f.x),
    mix(hash(i + vec3(0,1,1)), hash(i + vec3(1,1,1)), f.x), f.y), f.z); }
float groove(float x, float k) { float w = fwidth(x) * k; return cos(x * k) * (1.0 - smoothstep(0.9, 2.6, w)); }
void main() {
  vec3 n = normalize(normal);
  vec3 own = vec3(place.x * turn.x + place.z * turn.y, place.y, place.z * turn.x - place.x * turn.y);
  float around = length(place.xz), shade = open * shadow(place, n);
  float lay = noise(own * 5.0), fine = noise(own * 38.0), grain = noise(own * 95.0);
  vec3 base = colour;
  if (wheel == 0) {
    float along = abs(n.y) > 0.75 ? around : place.y;
    float g = 0.055 * groove(along + 0.006 * lay, 170.0) + 0.035 * groove(along + 0.01 * lay, 410.0);
    g += 0.05 * (lay - 0.5);
    if (abs(n.y) > 0.75) n = normalize(n + vec3(place.x, 0.0, place.z) / max(around, 1e-4) * g);
    else n = normalize(n + vec3(0.0, g, 0.0));
    n = normalize(n + 0.05 * (vec3(fine, grain, fine) - 0.5));
    base *= 0.88 + 0.16 * lay + 0.10 * grain;
    base = mix(base, base * vec3(0.78, 0.74, 0.72), smoothstep(0.72, 0.9, fine) * 0.5);
  } else base *= 0.96 + 0.04 * groove(around, 95.0) + 0.07 * lay;
  vec3 seen = base * light(n) * shade + shine(n) * shade * vec3(1.0, 0.96, 0.9);
  seen = seen / (1.0 + 0.18 * seen);
  shown = vec4(pow(clamp(seen, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}`;

const LITE_FRAGMENT = `
in vec3 lit; in vec2 lean; in vec3 skin;
uniform sampler2D grains;
out vec4 shown;
void main() {
  float lay = texture(grains, skin.xy * vec2(0.125, 0.08)).x, grain = texture(grains, skin.xy * vec2(2.0, 1.2)).x;
  vec3 base = colour, seen = lit;
  if (wheel == 0) {
    seen += lean.x * (cos((skin.z + 0.006 * lay) * 170.0) + lay - 0.5);
    base *= 0.86 + 0.16 * lay + 0.14 * grain;
  } else base *= 0.96 + 0.04 * cos(skin.z * 95.0) + 0.07 * lay;
  seen = base * seen + lean.y;
  shown = vec4(sqrt(seen / (1.0 + 0.18 * seen)), 1.0);
}`;

/* ---------------------------------------------------------------- small things */

function make(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "class") node.className = value;
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value != null) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const figure = (x, digits = 4) => (x == null || !isFinite(x) ? "–" : Number(x.toPrecision(digits)).toString());

function floats(buffer) {
  const { buffer: all, byteOffset, byteLength } =
    buffer instanceof ArrayBuffer ? new Uint8Array(buffer) : buffer;
  return new Float32Array(all.slice(byteOffset, byteOffset + byteLength));
}

const pairs = (values) => Array.from({ length: values.length / 2 }, (_, i) => [values[2 * i], values[2 * i + 1]]);

/* Where a canvas has something to show, since composing a page costs by the pixel, and the layout as
   seen from there. Places are of few sizes, so that one is rarely made anew. */
function framed(layout, ratio, [left, top, right, bottom]) {
  const to = (round, value, most) => clamp(round(value / 32) * 32, 0, most);
  const x = to(Math.floor, left, layout.width - 1), y = to(Math.floor, top, layout.height - 1);
  const width = Math.max(to(Math.ceil, right, layout.width) - x, 1);
  const height = Math.max(to(Math.ceil, bottom, layout.height) - y, 1);
  return { ...layout, x: layout.x - x, y: layout.y - y, width, height,
    place: `left:${x}px;top:${y}px;width:${width}px;height:${height}px`,
    pixels: [Math.round(width * ratio), Math.round(height * ratio)] };
}

function fit(canvas, { place, pixels: [wide, tall] }) {
  if (canvas.place !== place) canvas.style.cssText = canvas.place = place;
  if (canvas.width !== wide || canvas.height !== tall) { canvas.width = wide; canvas.height = tall; }
}

/* The half contour as rings with normals and openness to light; lip and foot are rounded. */
function ringsOf(points) {
  const outline = pairs(points), n = outline.length;
  const tall = outline[n - 1][1];
  const widest = outline.reduce((m, p) => Math.max(m, p[0]), 0);
  const rounded = [];
  const corner = (p, up) => {
    const b = Math.min(0.014, p[0] * 0.3, tall * 0.1), arc = [];
    const wall = outline[up ? "findLast" : "find"](([, y]) => Math.abs(y - p[1]) > b) ?? p;
    const lean = Math.atan2(wall[0] - p[0], Math.abs(wall[1] - p[1]) || 1); // shaded as the wall is there
    for (let i = 0; i <= 4; i++) {
      const a = (i / 4) * Math.PI / 2, turned = lean + (i / 4) * (Math.PI / 2 - lean);
      arc.push([p[0] - b + b * Math.cos(a), p[1] + (up ? -1 : 1) * (b - b * Math.sin(a)),
        Math.cos(turned), (up ? 1 : -1) * Math.sin(turned)]);
    }
    return { arc: up ? arc : arc.reverse(), b };
  };
  const foot = corner(outline[0], false), lip = corner(outline[n - 1], true);
  const inner = outline.filter((p) => p[1] > foot.b && p[1] < tall - lip.b);
  const rings = [[0, 0, 0, -1], ...foot.arc];
  const wall = [[outline[0][0], foot.b], ...inner, [outline[n - 1][0], tall - lip.b]];
  inner.forEach((p, i) => {
    const [a, b] = [wall[i], wall[i + 2]];
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const length = Math.hypot(dx, dy) || 1;
    rings.push([p[0], p[1], dy / length, -dx / length]);
  });
  rings.push(...lip.arc, [0, tall, 0, 1]);
  // What the front of clay above hides of the contour, which lies in the plane of the axis.
  const drawn = rings.slice(1, -1);
  const hidden = drawn.map(([r, y], i) => drawn.slice(i + 1).some(([wide, high]) =>
    wide > r && (high - y) * COS < Math.sqrt(wide * wide - r * r) * SIN));
  const open = rings.map(([r, y]) => {
    let hidden = 0;
    for (let i = 0; i < n; i += 2) {
      const d = Math.abs(outline[i][1] - y);
      if (d < 0.22) hidden = Math.max(hidden, (outline[i][0] - r) / (0.05 + d) * (1 - d / 0.22));
    }
    return 1 / (1 + 0.55 * Math.max(hidden, 0));
  });
  open[open.length - 1] = 1;
  return { rings: rings.slice(0, MOST_RINGS), open, outline, drawn, hidden, tall, widest, foot: outline[0][0] };
}

function wheelRings(radius) {
  const r = radius, t = 0.035;
  const top = Array.from({ length: 9 }, (_, i) => [(i / 9) * (r - 0.01), 0, 0, 1]);
  return [...top, [r - 0.01, 0, 0, 1], [r, -0.004, 0.7, 0.7], [r, -0.004, 1, 0],
    [r, -t, 1, 0], [r - 0.05, -t - 0.01, 0.3, -1], [0.16, -t - 0.01, 0, -1], [0.16, -t - 0.01, 1, 0],
    [0.14, -0.4, 1, 0]].map(([a, b, c, d]) => [a, b - 0.001, c, d]).reverse();
}

/* ---------------------------------------------------------------- the body, by WebGL2 or 2D */

function isSoftware() {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) return null;
  const info = probe.getExtension("WEBGL_debug_renderer_info");
  const name = info ? probe.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/* Without a GPU WebGL draws aside, and its pixels are fetched when they are there: nothing waits. */
class Body {
  constructor(canvas) {
    this.canvas = canvas;
    this.software = isSoftware();
    const deep = this.software ? document.createElement("canvas") : canvas;
    const options = { antialias: !this.software, alpha: true, premultipliedAlpha: true,
      preserveDrawingBuffer: false };
    this.gl = this.software === null ? null : deep.getContext("webgl2", options);
    if (!this.gl || this.software) this.flat = canvas.getContext("2d");
    if (this.gl) {
      deep.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.ready = false; });
      deep.addEventListener("webglcontextrestored", () => { this.build(); this.shape && this.take(this.shape); });
      this.build();
    }
  }

  build() {
    const gl = this.gl;
    const program = gl.createProgram();
    const pixels = this.software ? LITE_FRAGMENT : LIGHT + FRAGMENT;
    for (const [kind, text] of [[gl.VERTEX_SHADER, LIGHT + VERTEX], [gl.FRAGMENT_SHADER, pixels]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, HEAD + (this.software ? "#define LITE\n" : "") + text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.at = {};
    for (const name of ["profile", "eye", "tilt", "turn", "wheel", "colour", "foot", "dark", "grains"])
      this.at[name] = gl.getUniformLocation(program, name);
    this.sides = this.software ? 36 : SEGMENTS;
    const grid = new Float32Array(MOST_RINGS * (this.sides + 1) * 2);
    const index = new Uint32Array((MOST_RINGS - 1) * this.sides * 6);
    let at = 0;
    for (let i = 0; i < MOST_RINGS; i++)
      for (let j = 0; j <= this.sides; j++) { grid[at++] = i; grid[at++] = (2 * Math.PI * j) / this.sides; }
    at = 0;
    for (let i = 0; i < MOST_RINGS - 1; i++)
      for (let j = 0; j < this.sides; j++) {
        const a = i * (this.sides + 1) + j, b = a + this.sides + 1;
        for (const v of [a, b, a + 1, a + 1, b, b + 1]) index[at++] = v;
      }
    gl.bindVertexArray(gl.createVertexArray());
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, grid, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
    this.clay = this.texture();
    this.wheel = this.texture();
    if (this.software) this.grains();
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.cullFace(this.software ? gl.FRONT : gl.BACK); // fetched rows come from below: drawn upside down
    this.fetched = this.software && gl.createBuffer();
    this.fence = null;
    this.ready = true;
    this.wheelRadius = 0;
  }

  texture() {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, MOST_RINGS, 2);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    return texture;
  }

  /* Noise as a picture, in the second unit of textures. */
  grains() {
    const gl = this.gl, side = 64, bytes = Uint8Array.from({ length: side * side }, () => 256 * Math.random());
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, side, side, 0, gl.RED, gl.UNSIGNED_BYTE, bytes);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    gl.uniform1i(this.at.grains, 1);
    gl.activeTexture(gl.TEXTURE0);
  }

  upload(texture, rings, open) {
    const gl = this.gl, data = new Float32Array(MOST_RINGS * 8);
    let along = 0;
    rings.forEach((ring, i) => {
      if (i) along += Math.hypot(ring[0] - rings[i - 1][0], ring[1] - rings[i - 1][1]);
      data.set(ring, 4 * i);
      data.set([open ? open[i] : 1, along], 4 * (MOST_RINGS + i));
    });
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, MOST_RINGS, 2, gl.RGBA, gl.FLOAT, data);
  }

  take(shape) {
    this.shape = shape;
    const apart = this.software ? Math.ceil(shape.rings.length / LITE_RINGS) : 1;
    const kept = (ring, i) => i % apart === 0 || Math.min(i, shape.rings.length - 1 - i) < CORNER;
    this.rings = shape.rings.filter(kept);
    if (this.gl && this.ready) this.upload(this.clay, this.rings, shape.open.filter(kept));
  }

  draw(view, turn, dark) {
    if (!this.shape) return;
    if (!this.software) fit(this.canvas, view);
    if (!this.gl) this.drawFlat(view, dark);
    else if (this.ready && !this.fence) {
      this.drawDeep(view, turn, dark);
      if (this.software) this.fetch(view);
    }
  }

  fetch(view) {
    const gl = this.gl, [width, height] = view.pixels;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.fetched);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, 4 * width * height, gl.STREAM_READ);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.fetching = view;
    gl.flush();
  }

  /* What has been fetched, if it is there. */
  show() {
    const gl = this.gl;
    if (!this.fence || !this.ready || gl.clientWaitSync(this.fence, 0, 0) === gl.TIMEOUT_EXPIRED) return;
    const view = this.fetching, [width, height] = view.pixels, picture = new ImageData(width, height);
    gl.deleteSync(this.fence);
    this.fence = null;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.fetched);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, picture.data);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    fit(this.canvas, view);
    this.flat.putImageData(picture, 0, 0);
  }

  drawDeep(view, turn, dark) {
    const gl = this.gl, [width, height] = view.pixels, { shape, at } = this, flip = this.software ? -1 : 1;
    if (this.software && (gl.canvas.width !== width || gl.canvas.height !== height))
      [gl.canvas.width, gl.canvas.height] = [width, height];
    if (Math.abs(view.wheel - this.wheelRadius) > 1e-4) {
      this.wheelRings = wheelRings(view.wheel);
      this.upload(this.wheel, this.wheelRings);
      this.wheelRadius = view.wheel;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniform4f(at.eye, (2 * view.scale) / view.width, (2 * flip * view.scale) / view.height,
      (2 * view.x) / view.width - 1, flip * (1 - (2 * view.y) / view.height));
    gl.uniform2f(at.tilt, COS, SIN);
    gl.uniform2f(at.turn, Math.cos(turn), Math.sin(turn));
    gl.uniform2f(at.foot, shape.foot, Math.min(shape.widest, 0.8));
    gl.uniform1f(at.dark, dark ? 1 : 0);
    const draw = (texture, count, wheel, colour) => {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(at.wheel, wheel);
      gl.uniform3fv(at.colour, colour);
      gl.drawElements(gl.TRIANGLES, (count - 1) * this.sides * 6, gl.UNSIGNED_INT, 0);
    };
    draw(this.clay, this.rings.length, 0, [0.56, 0.235, 0.125]);
    draw(this.wheel, this.wheelRings.length, 1, dark ? [0.075, 0.068, 0.064] : [0.48, 0.44, 0.40]);
  }

  drawFlat(view, dark) {
    const c = this.flat, { outline } = this.shape, ratio = this.canvas.width / view.width;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, view.width, view.height);
    c.fillStyle = dark ? "#3a332e" : "#b8aca0";
    c.beginPath();
    c.ellipse(view.x, view.y, view.wheel * view.scale, view.wheel * view.scale * SIN, 0, 0, 7);
    c.fill();
    const at = (r, y) => [view.x + r * view.scale, view.y - y * COS * view.scale];
    const wide = this.shape.widest * view.scale;
    const paint = c.createLinearGradient(view.x - wide, 0, view.x + wide, 0);
    [[0, "#8c4a30"], [0.28, "#d98d67"], [0.45, "#cb7d58"], [0.8, "#8f4a30"], [1, "#6b3521"]].forEach((s) => paint.addColorStop(...s));
    c.fillStyle = paint;
    c.beginPath();
    outline.forEach(([r, y], i) => c[i ? "lineTo" : "moveTo"](...at(r, y)));
    [...outline].reverse().forEach(([r, y]) => c.lineTo(...at(-r, y)));
    c.fill();
    const [r, y] = outline[outline.length - 1], [, top] = at(0, y);
    c.fillStyle = "#c98a69";
    c.beginPath();
    c.ellipse(view.x, top, r * view.scale, r * view.scale * SIN, 0, 0, 7);
    c.fill();
  }
}

/* ---------------------------------------------------------------- the whole */

class Studio {
  constructor(model, el) {
    this.model = model;
    this.view = Math.random().toString(36).slice(2);
    this.id = 0;
    this.pending = new Map();
    this.apart = 0; // ms of a request beside its solve
    this.tool = { side: 1, radius: 0.56, height: 0.56, size: 0.3, face: 0.12 };
    this.shape = ringsOf(new Float32Array([0.36, 0, 0.36, 1]));
    this.info = { undo: 0, redo: 0 };
    this.scale = 0;
    this.turn = 0;
    this.still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.stops = [];
    this.build(el);
    this.body = new Body(this.canvas);
    this.body.take(this.shape);
    this.listen();
    this.theme();
    this.prepared();
    this.send({ type: "hello" });
    this.frame = requestAnimationFrame((now) => this.tick(now));
  }

  dispose() {
    cancelAnimationFrame(this.frame);
    this.stops.forEach((stop) => stop());
  }

  /* -------- the page */

  build(el) {
    const button = (text, label, act, props = {}) =>
      make("button", { type: "button", "aria-label": label, title: label, onclick: act, ...props }, text);
    this.root = make("div", { class: "jc" }, make("style", {}, CSS));
    this.canvas = make("canvas", { "aria-hidden": "true" });
    this.over = make("canvas", { "aria-hidden": "true" });
    this.pill = make("span", { class: "pill" }, "connecting");
    this.undo = button("↶ Undo", "Undo the last stroke (Ctrl+Z)", () => this.act("undo"));
    this.redo = button("↷ Redo", "Redo (Ctrl+Shift+Z)", () => this.act("redo"));
    this.reset = button("Reset", "Back to the start", () => this.act("reset"));
    this.hint = make("div", { class: "hint" }, "");
    this.note = make("div", { class: "note", role: "alert", hidden: true });
    this.stage = make("div", { class: "stage", tabindex: "0", role: "application",
      "aria-label": "Clay on a turntable and a pentagonal tool. Arrow keys move the tool, Shift with them " +
      "smooths, S changes the side, Escape cancels, Control Z takes the last stroke back." },
      this.canvas, this.over, make("div", { class: "top" }, this.pill, make("span", { class: "grow" }),
        this.undo, this.redo, this.reset), this.note, this.hint);
    this.said = make("div", { class: "sr", "aria-live": "polite", role: "status" });
    this.side = make("div", { class: "side" }, this.readoutCard(), this.toolCard(button), this.clayCard(),
      this.pieceCard(button), this.targetCard(button), this.solverCard());
    this.root.append(this.stage, this.side, this.said);
    el.append(this.root);
  }

  card(title, open, ...children) {
    return make("details", { class: "card", open }, make("summary", {}, title), ...children);
  }

  readoutCard() {
    this.out = {};
    const list = make("dl");
    for (const [name, text] of [["height", "Height"], ["diameter", "Widest diameter"], ["volume", "Volume"],
      ["energy", "Energy"]]) {
      this.out[name] = make("dd", {}, "–");
      list.append(make("dt", {}, text), this.out[name]);
    }
    this.bar = make("div", { class: "bar", role: "img", "aria-label": "energy by term" });
    list.append(this.bar);
    for (const [name, text] of [["reach", "Reach u₁"], ["solve", "Solved in"], ["match", "Match"]]) {
      this.out[name] = make("dd", {}, "–");
      list.append(make("dt", {}, text), this.out[name]);
    }
    this.status = make("div", { class: "status" }, "");
    return this.card("Reading", true, list, this.status);
  }

  slider(text, hint, { low, high, value, log, act, show = (x) => figure(x, 3) }) {
    const to = log ? Math.log : (x) => x, from = log ? Math.exp : (x) => x;
    const output = make("output", {}, show(value));
    const input = make("input", { type: "range", min: to(low), max: to(high), step: (to(high) - to(low)) / 200,
      value: to(value), "aria-label": `${text}, ${hint}`, "aria-valuetext": show(value) });
    const label = (x) => { output.textContent = show(x); input.setAttribute("aria-valuetext", show(x)); };
    input.addEventListener("input", () => { const x = Number(from(Number(input.value)).toPrecision(4)); label(x); act(x); });
    const node = make("label", { class: "slide", title: hint }, make("span", {}, text), output, input);
    node.show = (x) => { input.value = to(Math.max(x, low)); label(x); };
    return node;
  }

  toolCard(button) {
    const percent = (x) => `${Math.round(100 * x)}%`;
    const size = this.slider("Size", "height of the tool over the first height of the piece",
      { low: 0.08, high: 0.6, value: this.tool.size, show: percent, act: (x) => {
        this.tool.size = x; this.tool.face = Math.min(this.tool.face, x); face.show(this.tool.face); } });
    const face = this.slider("Face", "height of the flat face, which presses",
      { low: 0.03, high: 0.5, value: this.tool.face, show: percent, act: (x) => {
        this.tool.face = Math.min(x, this.tool.size); face.show(this.tool.face); } });
    this.sideButton = button("From the right", "Side that the tool comes from (S)", () => this.flip());
    this.smoothButton = button("Smooth", "Smooth instead of pressing, as Shift does", () => {
      this.smoothing = !this.smoothing;
      this.smoothButton.setAttribute("aria-pressed", String(this.smoothing));
    }, { "aria-pressed": "false" });
    return this.card("Tool", true, size, face, make("div", { class: "row" }, this.sideButton, this.smoothButton));
  }

  clayCard() {
    this.sliders = {};
    const rows = Object.entries(SLIDERS).map(([name, [text, hint, low, high]]) => {
      this.sliders[name] = this.slider(text, hint, { low, high, value: this.model.get(name) ?? 1, log: true,
        act: (x) => this.set(name, x) });
      return this.sliders[name];
    });
    return this.card("Clay", true, ...rows);
  }

  pieceCard(button) {
    const pick = (accept, act) => {
      const input = make("input", { type: "file", accept, style: "display:none", "aria-hidden": "true", tabindex: "-1" });
      input.addEventListener("change", async () => {
        const file = input.files[0];
        input.value = "";
        if (!file) return;
        if (file.size > 8 * 2 ** 20) this.refused("that file is larger than 8 MiB");
        else act(file);
      });
      this.root.append(input);
      return () => input.click();
    };
    this.pick = pick;
    this.start = make("select", { "aria-label": "Shape to start from", onchange: () => {
      if (this.start.value) this.act("start", { name: this.start.value });
      this.start.value = ""; } },
      make("option", { value: "" }, "New piece…"), ...STARTS.map((name) => make("option", { value: name }, name)));
    const csv = pick(".csv,.txt,.tsv,text/*", async (file) => this.act("profile", {}, await file.arrayBuffer()));
    const open = pick(".json,application/json", async (file) => this.act("open", { text: await file.text() }));
    this.kind = make("select", { "aria-label": "Format to export" }, ...["stl", "obj", "glb", "svg", "csv"].map(
      (kind) => make("option", { value: kind }, kind.toUpperCase())));
    const number = (value, label, low) => make("input", { type: "number", value, min: low, step: "any", "aria-label": label });
    this.millimetres = number(100, "Millimetres for one unit of length", 0.001);
    this.wall = number("", "Wall thickness in millimetres, empty for a solid body", 0);
    this.wall.placeholder = "solid";
    return this.card("Piece", true,
      make("div", { class: "row" }, this.start, button("From CSV…", "Start from a profile, height and radius", csv)),
      make("div", { class: "row" }, button("Save", "Save the piece with its strokes", () => this.act("save")),
        button("Open…", "Open a saved piece", open), button("Replay", "Play the strokes again", () => this.act("replay"))),
      make("div", { class: "row" }, this.kind, button("Export", "Export contour or body", () => this.export_(), { class: "main" })),
      make("label", { class: "pick" }, "mm a unit", this.millimetres),
      make("label", { class: "pick" }, "Wall, mm", this.wall));
  }

  targetCard(button) {
    const load = this.pick(".csv,.txt,.tsv,text/*", async (file) => this.act("target", {}, await file.arrayBuffer()));
    return this.card("Target outline", false, make("div", { class: "row" },
      button("From CSV…", "Draw the outline of a profile behind the clay", load),
      button("Remove", "Remove the target", () => this.act("target"))));
  }

  solverCard() {
    this.choices = {};
    const rows = Object.entries(CHOICES).map(([name, [text, values]]) => {
      const select = make("select", { "aria-label": text, onchange: () => this.set(name,
        name === "slices" ? Number(select.value) : select.value) },
        ...values.map((v) => { const [value, shown] = Array.isArray(v) ? v : [v, v]; return make("option", { value }, shown); }));
      select.value = String(this.model.get(name) ?? values[0]);
      this.choices[name] = select;
      return make("label", { class: "pick" }, text, select);
    });
    return this.card("Solver", false, ...rows);
  }

  /* -------- messages */

  send(content, points) {
    const id = ++this.id;
    this.pending.set(id, performance.now());
    this.stage.setAttribute("aria-busy", "true");
    const buffers = points ? [points instanceof ArrayBuffer ? points : new Float32Array(points).buffer] : [];
    try { this.model.send({ ...content, view: this.view, id }, undefined, buffers); } catch { this.late(true); }
    return id; // Jupyter cannot send where a kernel has ended
  }

  act(type, more = {}, bytes) {
    if (this.drag) this.let_go();
    this.send({ type, ...more }, bytes);
  }

  set(name, value) {
    this.model.set(name, value);
    clearTimeout(this.saving);
    this.saving = setTimeout(() => this.model.save_changes(), 60);
  }

  export_() {
    const wall = Number(this.wall.value) || 0;
    this.act("export", { kind: this.kind.value, millimetres: Number(this.millimetres.value) || 100, ...(wall > 0 ? { wall } : {}) });
  }

  receive(message, buffers) {
    if (message.type === "lost") return this.lost();
    if (message.type === "back") return this.back();
    const mine = message.view === this.view, sent = this.pending.get(message.id);
    const first = mine && sent !== undefined;
    if (first) {
      this.pending.delete(message.id);
      if (!this.pending.size) this.stage.setAttribute("aria-busy", "false");
      this.late(false);
    }
    if (message.type === "shape") this.shapeTold(message, floats(buffers[0]), mine, first ? performance.now() - sent : null);
    else if (message.type === "target") this.target = buffers[0] ? pairs(floats(buffers[0])) : null;
    else if (message.type === "state") this.session = message.session;
    else if (message.type === "kept") this.keep(message.text);
    else if (message.type === "refused" && (mine || !message.view)) this.refused(message.message);
    else if (message.type === "said" && mine && message.message) this.tell(message.message);
    else if (message.type === "file" && mine) this.download(message, buffers[0]);
    else if (message.type === "replay" && mine) this.play(buffers.map(floats), message.exact);
    if (first) this.pump();
  }

  shapeTold(message, points, mine, ms) {
    if (!this.playing) { this.shape = ringsOf(points); this.body.take(this.shape); }
    this.points = points;
    this.info = this.unread = message;
    if (message.done || message.message) this.read();
    if (ms !== null) this.apart += 0.2 * (clamp(ms - message.solve, 0, 200) - this.apart);
    if (ms !== null) this.root.dispatchEvent(new CustomEvent("jaxclay-shape", { bubbles: true, composed: true,
      detail: { ms, solve: message.solve, type: message.type, certified: message.certified } }));
    if (message.done && message.millimetres !== this.unit) this.millimetres.value = this.unit = message.millimetres;
    if (mine && message.strokes > 0) this.hint.classList.add("gone");
  }

  read() {
    const m = this.unread;
    this.unread = null;
    this.readAt = performance.now();
    this.out.height.textContent = figure(m.height);
    this.out.diameter.textContent = figure(m.diameter);
    this.out.volume.textContent = figure(m.volume, 6);
    this.out.reach.textContent = m.reach == null ? "–" : figure(m.reach, 3);
    this.out.solve.textContent = m.solve ? `${m.solve.toFixed(1)} ms, ${m.slices} slices` : `${m.slices} slices`;
    if ("match" in m) this.out.match.textContent = m.match == null ? "no target" : `${(100 * Math.max(0, 1 - m.match)).toFixed(1)}%`;
    if (m.energy) {
      const colours = { strain: "#b4532f", friction: "#8a6f5a", tension: "#2f6f8f", bending: "#6b8f5a" };
      const total = Object.values(m.energy).reduce((a, b) => a + b, 0);
      this.out.energy.textContent = figure(total, 4);
      const parts = Object.entries(m.energy);
      this.bar.replaceChildren(...parts.map(([name, value]) => make("i", { title: `${name} ${figure(value, 3)}`,
        style: `width:${(100 * value) / (total || 1)}%;background:${colours[name]}` })));
      this.bar.setAttribute("aria-label", "energy by term: " + parts.map(([n, v]) => `${n} ${figure(v, 3)}`).join(", "));
    }
    let text = m.message, warn = Boolean(text);
    if (!text && m.floored) [text, warn] = ["the lower bound of thickness is active in the rough shape", true];
    if (!text && "slumps" in m) this.slumps = m.slumps;
    if (!text && this.slumps) [text, warn] = ["this material slumps: less α, or more μ", true];
    if (!text) text = m.error != null ? `certified, contour within ${figure(m.error, 2)} l` : "certified";
    this.status.textContent = text;
    this.status.classList.toggle("warn", warn);
    this.undo.disabled = !m.undo;
    this.redo.disabled = !m.redo;
    this.reset.disabled = !m.strokes;
    if (m.done) this.said.textContent = `Height ${figure(m.height, 3)}, widest diameter ${figure(m.diameter, 3)}. ${text}.`;
  }

  refused(text) {
    if (this.drag) this.drag.refused = true;
    this.tell(text);
    this.said.textContent = text;
  }

  tell(text, action) {
    clearTimeout(this.telling);
    this.note.replaceChildren(text, ...(action ? [action] : []));
    this.note.hidden = !text;
    if (text && !action && !this.away) this.telling = setTimeout(() => { this.note.hidden = true; }, 6000);
  }

  download({ name, mime }, buffer) {
    const link = make("a", { href: URL.createObjectURL(new Blob([buffer], { type: mime })), download: name, style: "display:none" });
    this.root.append(link);
    link.click();
    setTimeout(() => { URL.revokeObjectURL(link.href); link.remove(); }, 1000);
  }

  play(frames, exact) {
    let i = 0;
    clearInterval(this.playing);
    this.playing = setInterval(() => {
      const done = i >= frames.length;
      this.shape = ringsOf(done ? this.points : frames[i++]);
      this.body.take(this.shape);
      if (!done) return;
      clearInterval(this.playing);
      this.playing = null;
      this.tell(`Replayed ${frames.length - 1} strokes: ${exact ? "the same contour, bit for bit" : "another contour"}`);
    }, 240);
  }

  keep(text) {
    this.kept = { text, session: this.session };
    try { localStorage.setItem(KEPT, JSON.stringify(this.kept)); } catch { /* private mode: memory alone */ }
  }

  lost() {
    this.away = true;
    this.pending.clear();
    this.drag = null;
    this.stage.classList.remove("drag");
    this.pill.classList.remove("good");
    this.pill.textContent = "connection lost";
    this.tell("Connection lost. The piece is kept; connecting again…");
  }

  back() {
    const before = this.session;
    this.away = false;
    this.session = this.model.get("prepared")?.session;
    this.tell("");
    this.prepared();
    // Another process knows nothing of the piece: it gets what was kept of it here.
    if (before && before !== this.session && this.kept) this.act("open", { text: this.kept.text });
    this.send({ type: "hello" });
  }

  late(is) {
    if (is === Boolean(this.isLate) || this.away) return;
    this.isLate = is;
    this.tell(is ? "No answer: Python is busy, or its kernel has ended. The last shape is kept here; when the cell " +
      "has run again, it can be restored." : "");
  }

  prepared() {
    const p = this.model.get("prepared") ?? {};
    const known = "session" in p;
    if (known) this.session ??= p.session;
    this.ready = Boolean(p.ready);
    this.pill.classList.toggle("good", this.ready);
    this.pill.textContent = !known ? "starting Python" : !this.ready ? "preparing the solver" :
      p.all ? "ready" : `ready, finer ones follow (${p.most} slices)`;
    this.hint.textContent = this.ready ? "Drag the tool against the clay.  Shift smooths, Ctrl+Z takes back." :
      "One moment: Python prepares the solver. The tool works as soon as it is ready.";
    if (known && !this.offered) {
      this.offered = true;
      let old = null;
      try { old = JSON.parse(localStorage.getItem(KEPT)); } catch { /* none */ }
      if (old?.text && old.session !== this.session && !this.info.strokes)
        this.tell("", null), this.offer(old.text);
    }
  }

  offer(text) {
    const restore = make("button", { type: "button", onclick: () => { this.act("open", { text }); this.tell(""); } }, "Restore it");
    const no = make("button", { type: "button", "aria-label": "Dismiss", onclick: () => this.tell("") }, "✕");
    const both = make("span", {}, restore, no);
    this.tell("A piece of an earlier session is kept here.", both);
  }

  /* -------- the pointer and the keys */

  listen() {
    const on = (target, name, act, options) => {
      target.addEventListener(name, act, options);
      this.stops.push(() => target.removeEventListener(name, act, options));
    };
    const told = (message, buffers) => this.receive(message, buffers);
    this.model.on("msg:custom", told);
    this.stops.push(() => this.model.off("msg:custom", told));
    const changes = { prepared: () => this.prepared() };
    for (const name of Object.keys(SLIDERS)) changes[name] = () => this.sliders[name].show(this.model.get(name));
    for (const name of Object.keys(CHOICES)) changes[name] = () => { this.choices[name].value = String(this.model.get(name)); };
    for (const [name, act] of Object.entries(changes)) {
      this.model.on(`change:${name}`, act);
      this.stops.push(() => this.model.off(`change:${name}`, act));
    }
    on(this.stage, "pointerdown", (event) => this.down(event));
    // As moves come, where a page may ask for that, and not with the next frame, whose drawing an answer waits for.
    on(this.stage, "onpointerrawupdate" in this.stage ? "pointerrawupdate" : "pointermove", (event) => this.moved(event));
    on(this.stage, "pointerup", () => this.let_go());
    on(this.stage, "pointercancel", () => this.let_go());
    on(this.root, "keydown", (event) => this.key(event));
    on(this.stage, "focus", () => this.stage.classList.toggle("keys", this.stage.matches(":focus-visible")));
    on(this.stage, "blur", () => { if (this.drag?.keys) this.let_go(); });
    const dark = matchMedia("(prefers-color-scheme: dark)");
    on(dark, "change", () => this.theme());
    const watch = new MutationObserver(() => this.theme());
    for (const node of [document.body, document.documentElement])
      watch.observe(node, { attributes: true, attributeFilter: ["class", "data-jp-theme-light"] });
    const size = new ResizeObserver(() => this.root.classList.toggle("narrow", this.root.clientWidth < 820));
    size.observe(this.root);
    this.stops.push(() => watch.disconnect(), () => size.disconnect());
  }

  theme() {
    const jupyter = document.body.dataset.jpThemeLight;
    const classes = document.documentElement.classList;
    this.dark = jupyter ? jupyter === "false" : classes.contains("dark") ||
      (!classes.contains("light") && matchMedia("(prefers-color-scheme: dark)").matches);
    this.root.classList.toggle("dark", this.dark);
    const style = getComputedStyle(this.root);
    this.colours = { zone: style.getPropertyValue("--zone").trim(), accent: style.getPropertyValue("--accent").trim() };
  }

  down(event) {
    if (event.button !== 0 || event.target.closest("button") || !this.layout) return;
    event.preventDefault();
    this.stage.focus({ preventScroll: true });
    this.stage.classList.remove("keys");
    this.stage.setPointerCapture(event.pointerId);
    if (this.drag) this.let_go();
    const at = this.placeOf(event);
    this.drag = { kind: this.kindOf(event), points: [this.tool.height, this.tool.radius], begun: false, moved: false,
      off: [this.tool.height - at.height, this.tool.radius - at.radius], inFlight: new Set() };
    this.stage.classList.add("drag");
  }

  moved(event) {
    if (!this.drag || this.drag.keys) return;
    const events = event.getCoalescedEvents?.() ?? [];
    for (const one of events.length ? events : [event]) {
      const at = this.placeOf(one);
      this.go(at.height + this.drag.off[0], at.radius + this.drag.off[1]);
    }
    this.pump();
  }

  key(event) {
    const target = event.target, typing = target.matches?.("input[type=number], select, input[type=range]");
    const command = event.ctrlKey || event.metaKey, name = event.key.toLowerCase();
    if (target.matches?.("input[type=number]")) return;
    if (command && name === "z") { event.preventDefault(); return this.act(event.shiftKey ? "redo" : "undo"); }
    if (command && name === "y") { event.preventDefault(); return this.act("redo"); }
    if (typing || target !== this.stage) return;
    this.stage.classList.add("keys");
    if (name === "escape") return this.cancel();
    if (name === "enter") return this.drag?.keys && this.let_go();
    if (name === "s" && !command) return this.flip();
    const step = { arrowup: [1, 0], arrowdown: [-1, 0], arrowleft: [0, -this.tool.side], arrowright: [0, this.tool.side] }[name];
    if (!step) return;
    event.preventDefault();
    const kind = this.kindOf(event);
    if (this.drag && (!this.drag.keys || this.drag.kind !== kind)) this.let_go();
    this.drag ??= { kind, keys: true, points: [this.tool.height, this.tool.radius], begun: false, inFlight: new Set() };
    this.go(this.tool.height + NUDGE * step[0], this.tool.radius + NUDGE * step[1]);
    this.pump();
    clearTimeout(this.keyTimer);
    this.keyTimer = setTimeout(() => { if (this.drag?.keys) this.let_go(); }, KEYS_MS);
  }

  kindOf(event) { return event.shiftKey || this.smoothing ? "smooth" : "press"; }

  flip() {
    if (this.drag) this.let_go();
    this.tool.side = -this.tool.side;
    this.sideButton.textContent = this.tool.side > 0 ? "From the right" : "From the left";
  }

  placeOf(event) {
    const box = this.stage.getBoundingClientRect(), v = this.layout;
    return { height: (v.y - (event.clientY - box.top)) / (v.scale * COS),
      radius: (this.tool.side * (event.clientX - box.left - v.x)) / v.scale };
  }

  go(height, radius) {
    const { tool, drag } = this;
    tool.height = clamp(height, -0.3, Math.max(this.shape.tall, 1) + 1);
    tool.radius = clamp(radius, THINNEST, 4);
    const [h, r] = drag.last ?? [Infinity, 0];
    if (Math.hypot(tool.height - h, tool.radius - r) > FINEST) this.mark();
    drag.moved = true;
    drag.calm = performance.now() + CALM_MS;
    drag.rested = false;
  }

  /* The tool's place is part of its way. */
  mark() {
    const { tool, drag } = this;
    drag.points.push(tool.height, tool.radius);
    drag.last = [tool.height, tool.radius];
  }

  /* Send what the tool has gone since, if not too much is under way; nothing of its way is lost. */
  pump() {
    const drag = this.drag, most = IN_FLIGHT.findLast(([ms]) => this.apart >= ms)[1];
    if (!drag?.moved || drag.refused || this.pendingMoves() >= most) return;
    if (performance.now() - (drag.sentAt ?? 0) < APART_MS) return;
    const points = drag.points.splice(0, 8000);
    if (!drag.begun) {
      drag.begun = true;
      const { side, size, face } = this.tool;
      this.sendMove({ type: "begin", side: side > 0 ? "right" : "left", size, face, kind: drag.kind }, points);
    } else if (points.length) this.sendMove({ type: "move" }, points);
  }

  sendMove(content, points) {
    this.drag.sentAt = performance.now();
    this.drag.inFlight.add(this.send(content, points));
  }

  pendingMoves() {
    for (const id of this.drag.inFlight) if (!this.pending.has(id)) this.drag.inFlight.delete(id);
    return this.drag.inFlight.size;
  }

  let_go() {
    const drag = this.drag;
    clearTimeout(this.keyTimer);
    if (!drag) return;
    if (drag.moved && drag.last && (drag.last[0] !== this.tool.height || drag.last[1] !== this.tool.radius)) this.mark();
    drag.sentAt = 0;
    if (drag.moved && !drag.begun && !drag.refused) this.pump();
    if (drag.begun && !drag.refused) this.send({ type: "end" }, drag.points.length ? drag.points : undefined);
    else if (drag.begun) this.send({ type: "hello" });
    this.drag = null;
    this.stage.classList.remove("drag");
  }

  cancel() {
    const drag = this.drag;
    this.drag = null;
    this.stage.classList.remove("drag");
    if (drag?.begun) this.send({ type: "cancel" });
  }

  /* -------- drawing */

  tick(now) {
    this.frame = requestAnimationFrame((next) => this.tick(next));
    const drag = this.drag;
    if (drag?.begun && !drag.refused && !drag.rested && !drag.points.length && now > drag.calm && !this.pendingMoves()) {
      drag.rested = true;
      this.sendMove({ type: "rest" });
    }
    const oldest = this.pending.values().next().value;
    if (oldest !== undefined && now - oldest > PATIENCE_MS) this.late(true);
    if (this.unread && now - (this.readAt ?? 0) > READ_MS) this.read();
    const step = Math.min(now - (this.before ?? now - 200), 200);
    this.body.show();
    this.pump();
    if (drag && this.layout) this.drawOver();
    if (this.body.software && step < (drag ? 140 : 45)) return; // Python needs the processors too
    this.before = now;
    if (!this.still) this.turn = (this.turn + step * 0.0011) % (2 * Math.PI);
    if (!this.fit(step)) return;
    this.drawBody();
    if (!drag) this.drawOver();
  }

  fit(step) {
    const width = this.stage.clientWidth, height = this.stage.clientHeight;
    if (!width || !height) return false;
    const wheel = Math.max(0.62, this.shape.widest * 1.12, this.shape.foot * 1.2);
    const tall = Math.max(this.shape.tall, 0.9);
    const below = wheel * SIN + 0.09;
    const wanted = Math.min((height - 150) / (tall * COS + this.shape.outline.at(-1)[0] * SIN + below + 0.08), 
      width / (2 * Math.max(wheel + 0.08, Math.min(this.tool.radius, 0.75) + 1.05 * this.tool.size + 0.05)));
    if (!this.scale || this.still) this.scale = wanted;
    else if (!this.drag || this.drag.keys) this.scale += (wanted - this.scale) * Math.min(1, step / 180);
    if (this.size !== `${width} ${height}`) { this.size = `${width} ${height}`; this.scale = wanted; }
    const used = this.scale * (tall * COS + below);
    this.wheel = this.wheel && !this.still ? this.wheel + (wheel - this.wheel) * Math.min(1, step / 180) : wheel;
    this.layout = { width, height, scale: this.scale, wheel: this.wheel, x: width / 2,
      y: Math.min(height - 66 - this.scale * below, (height + used) / 2 + 6 - this.scale * below) };
    return true;
  }

  drawBody() {
    const { scale, wheel, x, y, height } = this.layout, { tall, widest } = this.shape;
    const coarse = this.drag?.begun && !this.drag.rested;
    const ratio = this.body.software ? (coarse ? 0.45 : 1) : Math.min(devicePixelRatio || 1, 2);
    const wide = (Math.max(wheel, widest) + 0.01) * scale, high = (tall * COS + widest * SIN + 0.01) * scale;
    const view = framed(this.layout, ratio, [x - wide, y - high, x + wide, height]);
    this.body.draw(view, this.turn, this.dark);
  }

  drawOver() {
    // Only where something has changed: composing a page costs more than drawing it.
    const { side, radius, height, size, face } = this.tool, { scale, x, y } = this.layout;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const seen = [side, radius, height, size, face, scale, x, y, this.layout.width, this.layout.height, ratio, this.dark,
      this.smoothing, this.drag?.kind, this.drag?.begun && this.info.zone].join();
    if (seen === this.seen && this.shape === this.outlined && this.target === this.outlinedTarget) return;
    [this.seen, this.outlined, this.outlinedTarget] = [seen, this.shape, this.target];
    const v = framed(this.layout, ratio, this.reach()), c = this.over.getContext("2d");
    fit(this.over, v);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, v.width, v.height);
    const line = (points, joined = () => true) => {
      c.beginPath();
      for (const way of [v.scale, -v.scale])
        points.forEach(([r, h], i) => {
          if (i && joined(i)) c.lineTo(v.x + way * r, v.y - h * COS * v.scale);
          else c.moveTo(v.x + way * r, v.y - h * COS * v.scale);
        });
      c.stroke();
    };
    c.lineJoin = "round";
    c.lineWidth = 1.1;
    const { drawn, hidden } = this.shape;
    for (const faint of [false, true]) {
      c.strokeStyle = `rgba(${this.dark ? "20,12,8" : "70,32,18"},${faint ? 0.16 : 0.5})`;
      line(drawn, (i) => hidden[i] === faint && hidden[i - 1] === faint);
    }
    if (this.target) {
      c.lineWidth = 1.6;
      c.setLineDash([6, 5]);
      c.strokeStyle = this.colours.zone;
      line([[0, this.target[0][1]], ...this.target, [0, this.target.at(-1)[1]]]);
      c.setLineDash([]);
    }
    this.drawZone(c, line, this.colours.zone);
    const { picture, foot } = this.painted(ratio);
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.drawImage(picture, Math.round((v.x + side * radius * v.scale - foot[0]) * ratio),
      Math.round((v.y - height * COS * v.scale - foot[1]) * ratio));
  }

  /* The tool as a picture, painted anew only where it looks different, and its place in that. */
  painted(ratio) {
    const { side, radius, height, size, face } = this.tool, { scale } = this.layout, { accent } = this.colours, edge = 16;
    const look = [side, size, face, scale, ratio, accent, Boolean(this.drag), this.drag?.kind ?? this.smoothing].join();
    if (this.tooled?.look === look) return this.tooled;
    const picture = document.createElement("canvas"), c = picture.getContext("2d");
    const wide = 1.02 * size * scale + 2 * edge, tall = size * COS * scale + 2 * edge;
    [picture.width, picture.height] = [Math.ceil(wide * ratio), Math.ceil(tall * ratio)];
    const foot = [side > 0 ? edge : wide - edge, tall / 2];
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawTool(c, (r, h) => [foot[0] + side * (r - radius) * scale, foot[1] - (h - height) * COS * scale], accent);
    return (this.tooled = { look, picture, foot });
  }

  /* What all that is drawn over the body lies within; while dragging all that it has come to. */
  reach() {
    const { scale, x, y } = this.layout, corners = this.corners(), target = this.target ?? [[0, 0]];
    const wide = Math.max(this.shape.widest, ...target.map(([r]) => r));
    const tall = Math.max(this.shape.tall, ...target.map(([, h]) => h));
    const across = [-wide, wide, ...corners.map(([r]) => this.tool.side * r)].map((r) => x + r * scale);
    const down = [0, tall, ...corners.map(([, h]) => h)].map((h) => y - h * COS * scale);
    const lines = 4, shadow = 14;
    let box = [Math.min(...across) - lines, Math.min(...down) - lines, Math.max(...across) + lines, Math.max(...down) + shadow];
    if (this.drag && this.reached) box = box.map((value, i) => Math[i < 2 ? "min" : "max"](value, this.reached[i]));
    return (this.reached = box);
  }

  /* The tool's outline, radius and height, from the foot of its face. */
  corners() {
    const { radius, height, size, face } = this.tool;
    return [[radius, height - face / 2], [radius, height + face / 2], [radius + 0.34 * size, height + size / 2],
      [radius + 1.02 * size, height], [radius + 0.34 * size, height - size / 2]];
  }

  drawZone(c, line, colour) {
    const zone = this.drag?.begun && this.info.zone;
    if (!zone) return;
    const inside = this.shape.outline.filter(([, y]) => y >= zone[0] && y <= zone[1]);
    c.strokeStyle = colour;
    c.globalAlpha = 0.75;
    c.lineWidth = 2.2;
    if (inside.length > 1) line(inside);
    c.globalAlpha = 1;
  }

  drawTool(c, at, accent) {
    const { radius, height, size } = this.tool;
    const smooth = this.drag ? this.drag.kind === "smooth" : this.smoothing;
    const shape = this.corners().map(([r, y]) => at(r, y));
    const path = () => { c.beginPath(); shape.forEach((p, i) => c[i ? "lineTo" : "moveTo"](...p)); c.closePath(); };
    const [x0] = shape[0], [x1] = shape[3];
    const wood = c.createLinearGradient(0, shape[2][1], 0, shape[4][1]);
    (smooth ? [[0, "#a9cdd3"], [0.45, "#7fb0b8"], [1, "#4d7f88"]] : [[0, "#f2d9ae"], [0.45, "#dcb67c"], [1, "#a87c46"]])
      .forEach((stop) => wood.addColorStop(...stop));
    // A shadow in steps: a blurred one costs a software renderer more than all the rest.
    for (const [down, alpha] of [[9, 0.05], [6, 0.08], [3, 0.1]]) {
      c.fillStyle = `rgba(0,0,0,${alpha})`;
      c.save();
      c.translate(0, down);
      path();
      c.restore();
      c.fill();
    }
    c.fillStyle = wood;
    path();
    c.fill();
    c.save();
    path();
    c.clip();
    c.strokeStyle = smooth ? "rgba(20,70,80,.16)" : "rgba(110,70,25,.18)";
    c.lineWidth = 1;
    const top = shape[2][1], span = shape[4][1] - top;
    for (let i = 1; i < 9; i++) {
      const y = top + (span * i) / 9;
      c.beginPath();
      c.moveTo(x0, y);
      c.bezierCurveTo(x0 + (x1 - x0) * 0.3, y + 3 * Math.sin(i * 2.1), x0 + (x1 - x0) * 0.7, y - 3 * Math.cos(i), x1, (y + at(0, height)[1]) / 2);
      c.stroke();
    }
    c.restore();
    c.lineWidth = 1.2;
    c.strokeStyle = smooth ? "#34616a" : "#7d5627";
    path();
    c.stroke();
    c.lineWidth = 3.2;
    c.lineCap = "round";
    c.strokeStyle = this.drag ? accent : smooth ? "#34616a" : "#7d5627";
    c.beginPath();
    c.moveTo(...shape[0]);
    c.lineTo(...shape[1]);
    c.stroke();
    c.fillStyle = smooth ? "#34616a" : "#8a6230";
    c.beginPath();
    c.arc(...at(radius + 0.62 * size, height), Math.max(2.5, 0.032 * size * this.layout.scale), 0, 7);
    c.fill();
  }
}

export default {
  render({ model, el }) {
    const studio = new Studio(model, el);
    return () => studio.dispose();
  },
};
