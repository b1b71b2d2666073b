// Elements and charts.

const SVG = "http://www.w3.org/2000/svg";

function build(node, properties, children) {
  for (const [key, value] of Object.entries(properties || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

const h = (tag, properties, ...children) => build(document.createElement(tag), properties, children);
const svg = (tag, properties, ...children) => build(document.createElementNS(SVG, tag), properties, children);

const minus = (text) => text.replace("-", "−");
const fixed = (v, digits = 3) => (Number.isFinite(v) ? minus(v.toFixed(digits)) : "–");

// A number with three significant digits and no more zeros than it needs.
function short(v) {
  if (!Number.isFinite(v)) return "–";
  if (v === 0) return "0";
  const size = Math.abs(v);
  return minus(size >= 1e8 || size < 1e-3 ? v.toExponential(2) : Number(v.toPrecision(3)).toLocaleString("en"));
}

function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
  const out = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) out.push(Number(v.toPrecision(12)));
  return out;
}

// Lines over a common axis. Each of `series` has a name, a class of colour, points and perhaps half widths of a band;
// `marks` are points by themselves. `pick` is told the number of the point that is pointed at.
function chart({ title, series, x, y, width: wide = 720, height = 300, pick, from = 0 }) {
  // On a phone letters keep their size, and there is less between them.
  const width = Math.min(wide, matchMedia("(max-width: 560px)").matches ? 380 : wide);
  const left = 54, right = 14, top = 30, bottom = 40;
  const all = series.flatMap((s) => s.points);
  const lastX = Math.max(...all.map((p) => p[0]), from + 1);
  const topY = y.most ?? 1.06 * Math.max(...all.map((p) => p[1]), 1e-6);
  const atX = (v) => left + ((v - from) / (lastX - from)) * (width - left - right);
  const atY = (v) => height - bottom - (Math.min(v, topY) / topY) * (height - top - bottom);
  const path = (points) => points.map((p, i) => `${i ? "L" : "M"}${atX(p[0]).toFixed(1)} ${atY(p[1]).toFixed(1)}`).join("");
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title, class: "chart" });
  const grid = svg("g", { class: "grid", "aria-hidden": "true" });
  for (const v of ticks(0, topY, 5)) grid.append(svg("line", { x1: left, x2: width - right, y1: atY(v), y2: atY(v) }), svg("text", { x: left - 8, y: atY(v) + 4, "text-anchor": "end" }, y.format ? y.format(v) : String(v)));
  for (const v of ticks(from, lastX, width < 500 ? 4 : 6)) grid.append(svg("text", { x: atX(v), y: height - bottom + 18, "text-anchor": "middle" }, x.format ? x.format(v) : String(v)));
  grid.append(svg("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, x.label), svg("text", { x: 2, y: 14 }, y.label));
  root.append(grid);
  for (const s of series) {
    if (s.band) {
      const up = s.points.map((p, i) => [p[0], p[1] + s.band[i]]), down = s.points.map((p, i) => [p[0], Math.max(p[1] - s.band[i], 0)]).reverse();
      root.append(svg("path", { d: `${path([...up, ...down])}Z`, class: `band ${s.class}` }));
    }
    if (s.area) root.append(svg("path", { d: `${path([[s.points[0][0], 0], ...s.points, [s.points[s.points.length - 1][0], 0]])}Z`, class: `area ${s.class}` }));
    if (!s.bare) root.append(svg("path", { d: path(s.points), class: `line ${s.class}` }));
    if (s.dots) s.points.forEach((p) => root.append(svg("circle", { cx: atX(p[0]), cy: atY(p[1]), r: 2.6, class: `dot ${s.class}` })));
  }
  const cursor = svg("line", { y1: top, y2: height - bottom, class: "cursor", visibility: "hidden" });
  root.append(cursor);
  root.point = (v) => {
    cursor.setAttribute("visibility", "visible");
    cursor.setAttribute("x1", atX(v));
    cursor.setAttribute("x2", atX(v));
  };
  if (pick) {
    root.addEventListener("pointermove", (event) => {
      const box = root.getBoundingClientRect(), at = ((event.clientX - box.left) / box.width) * width;
      pick(from + ((at - left) / (width - left - right)) * (lastX - from));
    });
  }
  return root;
}

function legend(entries) {
  return h("ul", { class: "legend" }, entries.map(([name, cls]) => h("li", {}, h("span", { class: `swatch ${cls}`, "aria-hidden": "true" }), name)));
}

// Where a value stands between `least` and `most`: a dot, the target as a tick, and the range within reach as a band.
function gauge({ value, before, target, reach, least = 0, most = 1 }) {
  const at = (v) => `${(100 * Math.min(Math.max((v - least) / (most - least), 0), 1)).toFixed(2)}%`;
  const track = h("span", { class: "gauge", "aria-hidden": "true" });
  if (reach) track.append(h("span", { class: "gauge-reach", style: `left:${at(reach.least)};right:calc(100% - ${at(reach.largest)})` }));
  if (before !== undefined) track.append(h("span", { class: "gauge-before", style: `left:${at(before)}` }));
  track.append(h("span", { class: "gauge-target", style: `left:${at(target)}` }));
  const dot = h("span", { class: "gauge-dot", style: `left:${at(value)}` });
  track.append(dot);
  track.move = (v) => { dot.style.left = at(v); };
  return track;
}
