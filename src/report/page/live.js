// The panel in which lights are moved: the picture, its terms, and a card of sliders for each light.

class Live {
  constructor(basis, view, look) {
    Object.assign(this, { basis, view, look, pixel: null, queued: false });
    this.l = new Float32Array(basis.pixels);
    this.planes = this.chromaPlanes();
    this.image = new ImageData(basis.width, basis.height);
    this.state = new State(basis, look.result.lights);
    this.state.refer(look.result.found, look.result.start, look.result.authored);
    this.state.now = lightingState(look.result.found);
    this.node = this.panel();
    this.state.listeners.push((settled) => this.changed(settled));
  }

  // Room for the chroma of a picture; null where the look asks for no colours.
  chromaPlanes() {
    const isOfColor = this.look.terms.some((term) => term.is_of_color);
    return isOfColor ? [new Float32Array(this.basis.pixels), new Float32Array(this.basis.pixels)] : null;
  }

  // Shows what the address says, or else the lights found.
  begin(hash) {
    const wanted = new URLSearchParams(hash);
    const found = lightingState(this.look.result.found);
    this.state.now = wanted.get("look") === this.look.name && wanted.has("r") ? this.state.fromHash(hash, found) : found;
    this.controls();
    this.draw();
    this.sharpen();
  }

  // Takes the detail of the final picture, as soon as it is decoded.
  async sharpen() {
    const { final, found } = this.look.pictures, picture = final || found;
    if (!picture) return;
    const live = this.measureOf(this.look.result.found).bytes;
    this.detail = await Detail.open(picture.src, live, this.basis.width, this.basis.height);
    this.detailButton.hidden = false;
    this.paint();
  }

  toggleDetail() {
    const on = this.detailButton.getAttribute("aria-pressed") !== "true";
    this.detailButton.setAttribute("aria-pressed", String(on));
    this.paint();
  }

  // Shows the picture, with the detail of the final one where that is wished.
  paint() {
    const fine = this.detail && this.detailButton.getAttribute("aria-pressed") === "true";
    const image = fine ? this.detail.over(this.image.data) : this.image;
    if (this.canvas.width !== image.width) Object.assign(this.canvas, { width: image.width, height: image.height });
    this.canvas.getContext("2d").putImageData(image, 0, 0);
  }

  panel() {
    const { width, height } = this.basis;
    this.canvas = h("canvas", { width, height, class: "screen" });
    this.cross = h("span", { class: "cross", hidden: true, "aria-hidden": "true" });
    this.stage = h("div", { class: "stage", tabindex: 0, role: "application", "aria-roledescription": "picture", "aria-label": "Picture under these lights. Arrow keys move a point, and the lights that shine on it are listed below." }, this.canvas, this.cross);
    this.stage.addEventListener("pointermove", (event) => this.pointAt(event));
    this.stage.addEventListener("pointerdown", (event) => this.pointAt(event));
    this.stage.addEventListener("keydown", (event) => this.moveBy(event));
    this.detailButton = h("button", { type: "button", class: "toggle", hidden: true, "aria-pressed": "true", onclick: () => this.toggleDetail() }, "Fine detail");
    this.score = h("output", { class: "score" });
    this.scoreNote = h("p", { class: "score-note" });
    this.terms = h("div", { class: "term-list" });
    this.who = h("div", { class: "who" }, h("p", { class: "hint" }, "Point at the picture to see who lights it. Numbers are of the live picture; fine detail, taken from the final one, is for the eye."));
    this.cards = h("div", { class: "cards" });
    const bar = h("div", { class: "presets", role: "group", "aria-label": "Lightings to begin from" }, this.presets());
    this.undoButton = h("button", { type: "button", onclick: () => this.state.undo() }, "Undo");
    this.redoButton = h("button", { type: "button", onclick: () => this.state.redo() }, "Redo");
    this.said = h("p", { class: "said", role: "status" });
    const tools = h("div", { class: "tools", role: "group", "aria-label": "What to do with this lighting" },
      this.undoButton, this.redoButton,
      h("button", { type: "button", onclick: () => this.copy(this.toml(), "lights.toml copied: render --lights FILE renders it") }, "Copy lights.toml"),
      h("button", { type: "button", onclick: () => this.save(new Blob([this.toml()], { type: "text/plain" }), "lights.toml") }, "Save lights.toml"),
      h("button", { type: "button", onclick: () => this.canvas.toBlob((blob) => this.save(blob, "relit.png")) }, "Save PNG"),
      h("button", { type: "button", onclick: () => this.copy(location.href, "Link copied: it holds this lighting") }, "Copy link"));
    const left = h("div", { class: "live-left" }, this.stage, h("div", { class: "live-score" }, this.score, this.scoreNote, this.detailButton), this.terms, this.who);
    const right = h("div", { class: "live-right" }, bar, this.cards, tools, this.said);
    return h("div", { class: "live" }, left, right);
  }

  presets() {
    const { result } = this.look;
    const button = (name, lighting) => h("button", { type: "button", onclick: () => this.replace(lighting) }, name);
    const others = report.data.looks.filter((look) => look !== this.look && look.basis === this.look.basis);
    return [button("As found", result.found), button("Start", result.start), button("As the scene has it", this.within(result.authored)),
      others.map((look) => button(look.name, look.result.found))];
  }

  // A lighting with sizes that the basis has.
  within(lighting) {
    const size = lighting.size.map((size, l) => (this.basis.lights[l].knots ? Math.min(size, this.basis.lights[l].size) : size));
    return { ...lighting, size };
  }

  replace(lighting) {
    this.state.replace(lighting);
    this.controls();
  }

  // A slider with its name and its number; `read` and `write` are in the slider's own unit.
  slider({ name, label, least, most, step, read, write, say }) {
    const output = h("output", {}), input = h("input", { type: "range", min: least, max: most, step, "aria-label": label });
    const show = () => {
      input.value = read();
      output.value = say();
      input.setAttribute("aria-valuetext", output.value);
      input.style.setProperty("--at", `${(100 * (input.value - least)) / (most - least)}%`);
    };
    input.addEventListener("input", () => { write(Number(input.value)); });
    input.addEventListener("change", () => this.state.settle());
    this.shown.push(show);
    return h("label", { class: "slider" }, h("span", { class: "slider-name" }, name), input, output);
  }

  controls() {
    this.shown = [];
    const { state, basis } = this, { result } = this.look;
    const cards = basis.names.map((name, l) => this.card(name, l, result.lights[l] || {}));
    const nodes = basis.data.copy.nodes, rows = [];
    if (nodes.length > 1) {
      rows.push(this.slider({ name: "Value", label: "Value of the background", least: 0, most: Math.max(...nodes), step: 0.001,
        read: () => state.now.value, write: (v) => state.edit((x) => { x.value = v; }), say: () => `× ${fixed(state.now.value, 2)}` }));
    }
    rows.push(this.slider({ name: "Exposure", label: "Exposure in stops", least: -6, most: 6, step: 0.05,
      read: () => Math.log2(state.now.exposure / result.found.exposure), write: (v) => state.edit((x) => { x.exposure = result.found.exposure * 2 ** v; }),
      say: () => this.signed(Math.log2(state.now.exposure / result.found.exposure)) }));
    const title = nodes.length > 1 ? "Background and camera" : "Camera";
    this.cards.replaceChildren(...cards, h("fieldset", { class: "card" }, h("legend", {}, title), rows));
    this.shown.forEach((show) => show());
  }

  signed(stops) {
    const rounded = Math.abs(stops) < 0.005 ? 0 : stops;
    return `${rounded > 0 ? "+" : rounded < 0 ? "−" : "±"}${Math.abs(rounded).toFixed(1)} stops`;
  }

  card(name, l, facts) {
    const { state, basis } = this, sizes = basis.lights[l];
    const toggle = (text, label, is, flip) => {
      const button = h("button", { type: "button", class: "toggle", "aria-label": label }, text);
      button.addEventListener("click", () => { state.edit(flip); state.settle(); });
      this.shown.push(() => button.setAttribute("aria-pressed", String(is())));
      return button;
    };
    const mute = toggle("Off", `Off: ${name}`, () => state.now.off[l], (x) => { x.off[l] = !x.off[l]; });
    const solo = toggle("Solo", `Solo: ${name}`, () => state.now.solo === l, (x) => { x.solo = x.solo === l ? null : l; });
    const rows = [this.slider({ name: "Radiance", label: `${name}: radiance in stops`, least: OFF, most: MOST, step: 0.05,
      read: () => state.stops(l), write: (v) => state.setStops(l, v),
      say: () => (state.now.radiance[l] > 0 ? this.signed(Math.log2(state.now.radiance[l] / state.reference[l])) : "dark") })];
    if (sizes.knots) {
      const least = Math.log2(sizes.size / 20), most = Math.log2(sizes.size);
      rows.push(this.slider({ name: "Size", label: `${name}: size`, least, most, step: 0.01,
        read: () => Math.log2(state.now.size[l]), write: (v) => state.setSize(l, Math.min(2 ** v, sizes.size)),
        say: () => this.extent(facts, state.now.size[l]) }));
    }
    rows.push(this.temperature(name, l), this.gel(name, l));
    const power = h("span", { class: "power" }), mates = state.mates(l).map((mate) => basis.names[mate]);
    this.shown.push(() => { power.textContent = this.power(facts, l); });
    return h("fieldset", { class: `card light-${l % 8}` }, h("legend", {}, h("span", { class: "swatch", "aria-hidden": "true" }), name),
      h("div", { class: "card-head" }, power, h("span", { class: "toggles" }, solo, mute)), rows,
      mates.length ? h("p", { class: "tied" }, `Tied to ${mates.join(", ")}: their radiances move together.`) : null);
  }

  // The slider of a light's colour temperature. A light whose own colour is not known as one begins with that.
  temperature(name, l) {
    const { state, basis } = this, own = basis.data.white[l] ? null : 1750;
    const at = () => (state.isOwn(l) && own ? own : temperatureOf(state.rgb(l))[0]);
    const row = this.slider({ name: "Colour", label: `${name}: colour temperature`, least: own ?? 1800, most: 12000, step: 50, read: at,
      write: (v) => state.edit((x) => { x.color[l] = v === own ? "recorded" : { temperature: { kelvin: v, tint: 0 } }; }),
      say: () => (state.isOwn(l) && own ? "its own" : colorWords(state.now.color[l], state.rgb(l))) });
    const seen = h("span", { class: "colour small", "aria-hidden": "true" });
    this.shown.push(() => { seen.style.background = hexOf(state.rgb(l)); });
    row.lastChild.before(seen);
    row.classList.add("with-colour");
    return row;
  }

  // The colour of a light as of a gel, for lights whose red, green and blue the run has varied.
  gel(name, l) {
    const { state, basis } = this;
    if (!basis.data.variables.includes(`${name}.red`) && !this.look.result.found.color?.[l]?.rgb) return null;
    const input = h("input", { type: "color", "aria-label": `${name}: colour of the gel` }), output = h("output", {});
    input.addEventListener("input", () => state.edit((x) => { x.color[l] = { rgb: [1, 3, 5].map((i) => Math.max(decode(parseInt(input.value.slice(i, i + 2), 16) / 255), 1e-3)) }; }));
    input.addEventListener("change", () => state.settle());
    this.shown.push(() => {
      const seen = hexOf(state.rgb(l));
      // What is picked may be darker than the same colour at its brightest, and stays as it is.
      if (document.activeElement !== input) input.value = seen;
      output.value = seen;
    });
    return h("label", { class: "slider" }, h("span", { class: "slider-name" }, "Gel"), input, output);
  }

  extent(facts, size) {
    if (!facts.extent) return `× ${fixed(size, 2)}`;
    const [a, b] = facts.extent.map((e) => short(Number((100 * e * size).toPrecision(2))));
    return a === b ? `${a} cm` : `${a} × ${b} cm`;
  }

  power(facts, l) {
    if (!facts.power) return "";
    const { radiance, size } = this.state.now, lit = watts(facts, radiance[l], size[l]);
    return `${short(lit)} W · ${short(683 * lit)} lm`;
  }

  changed(settled) {
    if (!this.queued) {
      this.queued = true;
      requestAnimationFrame(() => { this.queued = false; this.draw(); });
    }
    this.shown.forEach((show) => show());
    if (settled) history.replaceState(null, "", `#${this.state.toHash(this.look.name)}`);
  }

  // Makes the picture and measures it.
  draw() {
    const begun = performance.now();
    this.view.show(this.basis.picture(this.state.x), this.state.now.exposure, this.image.data, this.l, this.planes);
    this.measured = measure(this.l, this.planes, this.basis, this.look);
    this.paint();
    this.score.value = fixed(this.measured.f_q);
    const found = this.foundScore ?? (this.foundScore = this.measureOf(this.look.result.found).f_q);
    const away = this.measured.f_q - found;
    this.scoreNote.textContent = Math.abs(away) < 0.0005 ? "f_q of this picture, noise included: as found" : `f_q of this picture, noise included: ${fixed(Math.abs(away))} ${away > 0 ? "worse" : "better"} than as found`;
    this.drawTerms();
    this.drawWho();
    this.undoButton.disabled = !this.state.past.length;
    this.redoButton.disabled = !this.state.future.length;
    // Other drawings follow when the lights rest.
    clearTimeout(this.resting);
    this.resting = setTimeout(() => (this.watchers || []).forEach((watch) => watch(this)), 150);
    this.milliseconds = performance.now() - begun;
  }

  // What a lighting measures, without showing it.
  measureOf(lighting) {
    const l = new Float32Array(this.basis.pixels), bytes = new Uint8ClampedArray(4 * this.basis.pixels), planes = this.chromaPlanes();
    const state = lightingState(lighting), x = { ...state, factor: colorFactors(state.color, this.basis, this.look.result.lights) };
    this.view.show(this.basis.picture(x), lighting.exposure, bytes, l, planes);
    return { ...measure(l, planes, this.basis, this.look), l, bytes };
  }

  drawTerms() {
    const reach = this.look.result.attainable || {};
    if (!this.rows) {
      this.rows = this.look.terms.map((term) => {
        const track = gauge({ value: 0, target: term.target, reach: reach[term.name], least: term.least, most: term.most });
        const value = h("output", { class: "number" });
        this.terms.append(h("div", { class: "term-row" }, h("span", { class: "term-name" }, term.label), track, value));
        return { term, track, value };
      });
    }
    for (const { term, track, value } of this.rows) {
      const measured = this.measured.terms[term.name].value;
      track.move(measured);
      value.value = term.distance ? fixed(measured) : `${fixed(measured)} → ${fixed(term.target, term.is_of_color ? 3 : 2)}`;
    }
  }

  pointAt(event) {
    const box = this.canvas.getBoundingClientRect();
    const place = (at, size, n) => Math.min(Math.max(Math.floor((at / size) * n), 0), n - 1);
    this.pixel = [place(event.clientX - box.left, box.width, this.basis.width), place(event.clientY - box.top, box.height, this.basis.height)];
    this.drawWho();
  }

  moveBy(event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step) return;
    event.preventDefault();
    const [x, y] = this.pixel || [this.basis.width >> 1, this.basis.height >> 1], by = event.shiftKey ? 8 : 1;
    this.pixel = [Math.min(Math.max(x + by * step[0], 0), this.basis.width - 1), Math.min(Math.max(y + by * step[1], 0), this.basis.height - 1)];
    this.drawWho();
  }

  // The share of each light in the light of the pixel that is pointed at.
  drawWho() {
    if (!this.pixel) return;
    const [x, y] = this.pixel, p = y * this.basis.width + x;
    this.cross.hidden = false;
    this.cross.style.left = `${(100 * (x + 0.5)) / this.basis.width}%`;
    this.cross.style.top = `${(100 * (y + 0.5)) / this.basis.height}%`;
    const shares = this.basis.shares(this.state.x, p), sum = shares.reduce((a, b) => a + b, 0);
    const order = shares.map((share, l) => [share, l]).sort((a, b) => b[0] - a[0]).filter(([share]) => share > 0);
    const rows = order.map(([share, l]) => h("li", { class: `light-${l % 8}` }, h("span", { class: "who-name" }, this.basis.names[l]),
      h("span", { class: "who-bar", "aria-hidden": "true" }, h("span", { style: `width:${(100 * share) / sum}%` })), h("span", { class: "number" }, `${((100 * share) / sum).toFixed(0)} %`)));
    const where = this.basis.mask[p] ? "on the object" : "on the background";
    this.who.replaceChildren(h("p", { class: "who-title" }, `Who lights this point ${where}: brightness ${fixed(this.l[p], 2)}`),
      sum > 0 ? h("ul", {}, rows) : h("p", { class: "hint" }, "No light reaches it."));
  }

  toml() {
    return this.state.toToml(this.look.lights_toml);
  }

  async copy(text, said) {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = h("textarea", {}, text);
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    this.said.textContent = said;
  }

  save(blob, name) {
    const link = h("a", { href: URL.createObjectURL(blob), download: name });
    link.click();
    URL.revokeObjectURL(link.href);
    this.said.textContent = `${name} saved`;
  }
}

// Power of a light, W: that of a surface grows as the square of its size.
function watts(facts, radiance, size) {
  return facts.power * radiance * (facts.has_size ? size * size : 1);
}
