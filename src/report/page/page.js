// The page: a section for each thing that a reader wants to know of a look.

const report = { data: JSON.parse(document.getElementById("data").textContent) };

function section(id, title, ...content) {
  return h("section", { id, "aria-labelledby": `${id}-title` }, h("h2", { id: `${id}-title` }, title), content);
}

function table(caption, head, rows, classes = []) {
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption }, h("table", {}, h("caption", { class: "hidden" }, caption),
    h("thead", {}, h("tr", {}, head.map((name, i) => h("th", { scope: "col", class: classes[i] }, name)))),
    h("tbody", {}, rows.map((row) => h("tr", {}, row.map((cell, i) => (i ? h("td", { class: classes[i] }, cell) : h("th", { scope: "row" }, cell))))))));
}

// Two pictures on top of each other, with a line between them that can be moved.
function compare(before, after, size) {
  const frame = h("div", { class: "compare", style: "--cut:50%" }, h("img", { src: after, alt: "The result", ...size }),
    h("div", { class: "compare-before" }, h("img", { src: before, alt: "The start", ...size })),
    h("span", { class: "compare-line", "aria-hidden": "true" }), h("span", { class: "tag left", "aria-hidden": "true" }, "start"), h("span", { class: "tag right", "aria-hidden": "true" }, "found"));
  const input = h("input", { type: "range", min: 0, max: 100, value: 50, step: 1, "aria-label": "Share of the picture that shows the start" });
  input.addEventListener("input", () => frame.style.setProperty("--cut", `${input.value}%`));
  frame.append(input);
  return frame;
}

function summary(look) {
  const { result } = look, final = result.f_q_final;
  const cards = [["at the start", result.f_q_initial, result.f_q_initial_error], ["found", result.f_q, result.f_q_error], ["in the final picture", final, result.f_q_final_error]];
  return h("div", { class: "summary" },
    h("p", { class: "lead" }, "Distance from the look, f", h("sub", {}, "q"), ": 0 where every wish is met."),
    h("dl", { class: "scores" }, cards.filter(([, v]) => v !== null && v !== undefined).map(([name, v, error], i) => h("div", { class: i === 1 ? "score-card main" : "score-card" }, h("dt", {}, name), h("dd", {}, fixed(v), error ? h("span", { class: "error" }, ` ± ${fixed(error)}`) : null)))),
    result.caution ? h("p", { class: "caution" }, result.caution) : null,
    (result.in_words || []).length ? h("ul", { class: "words" }, result.in_words.map((line) => h("li", {}, line))) : null,
    h("dl", { class: "brief" }, brief(look).map(([name, text]) => [h("dt", {}, name), h("dd", {}, text)])));
}

// What a client asks first: which lights, how bright, how long.
function brief(look) {
  const { result, options } = look, { radiance, size } = result.found;
  const lit = result.lights.map((facts, l) => [facts.name, watts(facts, radiance[l], size[l])]);
  const all = look.timing.find(([stage]) => stage === "all");
  const rows = lit.map(([name, w]) => [name, w > 0 ? `${short(w)} W, ${short(683 * w)} lm` : "dark"]);
  if (result.surroundings) rows.push(["surroundings", result.surroundings]);
  if (result.final_spp) rows.push(["picture", `${options.size.join(" × ")}, noise ${fixed(result.final_noise, 4)}`]);
  if (all) rows.push(["took", `${all[1].toFixed(0)} s`]);
  return rows;
}

function resultSection(look) {
  const { initial, final, found } = look.pictures;
  const shown = final || found;
  if (!shown) return section("result", "The result", summary(look));
  const size = { width: shown.width, height: shown.height };
  const picture = initial ? compare(initial.src, shown.src, size) : h("img", { class: "still", src: shown.src, alt: "The result", ...size });
  return section("result", "The result", h("div", { class: "hero" }, h("figure", {}, picture, h("figcaption", {}, final ? "The start and the result; drag the line." : "A small picture of the lights found; the large ones are being rendered.")), summary(look)));
}

function iterationsSection(look, live) {
  const { evaluations, iterations } = look;
  if (!evaluations.n.length) return null;
  const weighted = (term) => evaluations.f[term.name].map((f, i) => [evaluations.n[i], term.weight * f]);
  const terms = look.terms.filter((term) => term.weight > 0);
  const series = terms.map((term, i) => ({ class: `term-${i}`, points: weighted(term) }));
  series.push({ class: "f_q", points: evaluations.n.map((n, i) => [n, evaluations.f_q[i]]), band: evaluations.error, dots: evaluations.n.length < 60 });
  const caption = h("p", { class: "step-words", role: "status" });
  const picture = h("div", { class: "step-picture" });
  const canvas = live ? h("canvas", { width: live.basis.width, height: live.basis.height, class: "screen", role: "img", "aria-label": "Picture of this step" }) : null;
  if (canvas) picture.append(canvas);
  const input = h("input", { type: "range", min: 0, max: Math.max(iterations.length - 1, 0), step: 1, value: Math.max(iterations.length - 1, 0), "aria-label": "Step of the search" });
  const drawing = chart({ title: `f_q and the shares of its terms over ${evaluations.n.length} evaluations`, series, from: 0, x: { label: "evaluation" }, y: { label: "f_q, and what each term adds to it" },
    pick: (at) => { choose(nearest(at)); } });
  const nearest = (at) => iterations.reduce((best, it, i) => (Math.abs(it.evaluation - at) < Math.abs(iterations[best].evaluation - at) ? i : best), 0);
  const choose = (i) => {
    const it = iterations[i];
    if (!it) return;
    input.value = i;
    drawing.point(it.evaluation);
    caption.textContent = `Step ${i + 1} of ${iterations.length}: evaluation ${it.evaluation}, f_q ${fixed(it.f_q)}`;
    input.setAttribute("aria-valuetext", caption.textContent);
    if (canvas) canvas.getContext("2d").putImageData(new ImageData(live.measureOf(it.lighting).bytes, live.basis.width, live.basis.height), 0, 0);
    else if (it.image) picture.replaceChildren(h("img", { src: it.image, alt: caption.textContent, class: "screen" }));
  };
  input.addEventListener("input", () => choose(Number(input.value)));
  choose(iterations.length - 1);
  return section("search", "How it was found", h("p", {}, `${evaluations.n.length} evaluations led to the result`, look.starts ? `, from the best of ${look.starts.count} starts` : "", ". Each step that was better than all before has a picture."),
    h("div", { class: "steps" }, h("div", {}, drawing, legend([["f_q", "f_q"], ...terms.map((term, i) => [term.label, `term-${i}`])])), h("div", { class: "step" }, picture, input, caption)));
}

function termsSection(look) {
  const { result } = look, reach = result.attainable || {}, last = result.terms_final || result.terms, start = result.terms_initial;
  const words = (term) => {
    const r = reach[term.name];
    if (!r) return "not known";
    if (term.distance) return `at least ${fixed(r.floor)}`;
    const range = `from ${fixed(r.least, term.is_of_color ? 3 : 2)} to ${fixed(r.largest, term.is_of_color ? 3 : 2)}`;
    return r.floor > 0.001 ? `${range}; the target is out of reach` : `${range}; the target is within reach`;
  };
  const rows = look.terms.map((term) => {
    const now = last[term.name], was = start[term.name];
    return [h("span", {}, term.label, h("span", { class: "code" }, term.name)), gauge({ value: now.value, before: was.value, target: term.target, reach: reach[term.name], least: term.least, most: term.most }),
      fixed(was.value), fixed(now.value), term.distance ? "0" : fixed(term.target), fixed(term.weight, 2), fixed(term.weight * now.f), words(term)];
  });
  return section("terms", "What was wished, and what came of it", table("Terms against their targets", ["term", "where it stands", "start", "result", "target", "weight", "costs", "these lights can give"], rows, ["", "wide", "number", "number", "number", "number", "number", "long"]),
    h("p", { class: "hint" }, "The dot is the result, the ring the start, the bar the target; shaded is what these lights can give. Brightness is that of a display, from 0 to 1.", report.data.bases[look.basis]?.weights ? " Which pixels are the object’s is said by a picture of weights." : "", look.terms.some((term) => term.is_of_color) ? " Red–green and yellow–blue are a and b of Oklab: 0 is grey, 0.1 a strong colour." : ""));
}

function histogramSection(look, live) {
  const found = live ? live.measureOf(look.result.found).histogram : look.histogram?.final, start = live ? live.measureOf(look.result.start).histogram : look.histogram?.initial;
  if (!look.signature || !found || !start) return null;
  const points = (q) => Array.from(q, (v, i) => [(i + 1) / BINS, v]);
  // Sixteen codes a bar: single codes of a small picture are mostly noise.
  const density = (q) => Array.from({ length: 16 }, (_, i) => [(i + 0.5) / 16, q[16 * i + 15] - (i ? q[16 * i - 1] : 0)]);
  const axis = { label: "brightness", format: (v) => v.toFixed(1) };
  const draw = (title, of, now, most) => chart({ title, from: 0, x: axis, y: { most, label: title }, width: 540, height: 280, series: [{ class: "wanted", points: of(look.signature.cumulated), area: true }, { class: "before", points: of(start) }, { class: "f_q", points: of(found) }, ...(now ? [{ class: "now", points: of(now) }] : [])] });
  const slots = [h("div", {}), h("div", {})];
  const refresh = (now) => {
    slots[0].replaceChildren(draw("Share of pixels by brightness", density, now));
    slots[1].replaceChildren(draw("Share of pixels that are darker", points, now, 1));
  };
  refresh(null);
  if (live) live.watchers = [...(live.watchers || []), (panel) => { if (panel.state.past.length) refresh(panel.measured.histogram); }];
  return section("brightness", "Brightness", h("p", {}, `The histogram of the picture against the signature “${look.signature.name}” of the look; on the right, added up from black.`),
    h("div", { class: "pair" }, slots), legend([["signature", "wanted"], ["start", "before"], ["found", "f_q"], ...(live ? [["your lights", "now"]] : [])]));
}

function picksSection(look, live) {
  const { picks } = look;
  if (!picks?.each?.length) return null;
  const cards = [{ number: 1, f_q: look.result.f_q, image: look.pictures.found?.src, lighting: look.result.found, lights: "lights.toml", terms: look.result.terms }, ...picks.each].map((pick) => {
    const brightest = look.result.lights.map((facts, l) => [watts(facts, pick.lighting.radiance[l], pick.lighting.size[l]), facts.name, l]).filter(([w]) => w > 0).sort((a, b) => b[0] - a[0]);
    const words = brightest.slice(0, 3).map(([w, name, l]) => `${name} ${short(w)} W${pick.lighting.color?.length ? `, ${colorWords(pick.lighting.color[l], look.result.lights[l].color)}` : ""}`).join(" · ");
    const measured = look.terms.flatMap((term) => [h("span", {}, term.label), h("span", { class: "number" }, fixed(pick.terms[term.name].value, term.is_of_color ? 3 : 2))]);
    const inner = [pick.image ? h("img", { src: pick.image, alt: `Lighting ${pick.number}` }) : null, h("span", { class: "pick-title" }, `${pick.number}`, h("span", { class: "number" }, `f_q ${fixed(pick.f_q)}`)), h("span", { class: "pick-words" }, words), h("span", { class: "pick-terms" }, measured)];
    return h("li", {}, live ? h("button", { type: "button", class: "pick", onclick: () => { live.replace(pick.lighting); document.getElementById("live").scrollIntoView({ behavior: "smooth" }); } }, inner) : h("div", { class: "pick" }, inner));
  });
  return section("choose", "Lightings to choose from", h("p", {}, `${picks.each.length + 1} lightings whose f_q is within ${picks.within} of the best and that look different: their small pictures differ by ${picks.different} of white or more.`, live ? " Choose one to move its lights above." : ""), h("ol", { class: "picks" }, cards),
    h("p", { class: "hint" }, "Number 3 at full size: ", h("code", {}, `lightopt-embree render --pick 3 ${look.directory}`)));
}

// Fronts between two aims, which `scan --pareto` has written into the run's directory.
function frontsSection({ fronts, directory }) {
  if (!fronts?.length) return null;
  const each = fronts.map(({ aims, plot, pictures }) => h("div", { class: "front" },
    h("figure", {}, h("img", { src: plot.src, width: plot.width, height: plot.height, alt: `Front between ${aims.join(" and ")}` })),
    h("ol", { class: "picks" }, pictures.map(({ image, lights }) => h("li", {}, h("div", { class: "pick" }, h("img", { src: image, alt: `Picture of ${lights}` }), h("span", { class: "pick-title" }, lights)))))));
  return section("fronts", "Between two aims", h("p", {}, "Lightings of which none is better in one aim without being worse in the other, from end to end."), each,
    h("p", { class: "hint" }, "One at full size: ", h("code", {}, `lightopt-embree render --lights ${directory}/${fronts[0].pictures[0].lights} SCENE`)));
}

function lightsSection(look) {
  const { result } = look, place = (p) => (p ? p.map((v) => fixed(v, 2)).join(", ") : "–");
  const setup = new Map((result.lamps || []).map((lamp) => [lamp.name, lamp.setup]));
  const change = (before, after, say = short) => h("span", { class: "change" }, h("span", { class: "was" }, say(before)), " → ", say(after));
  const colored = (facts, l, lighting) => {
    const color = lighting.color?.[l] ?? "recorded", rgb = color === "recorded" ? facts.color : factorOf(color);
    return { words: colorWords(color, facts.color), swatch: h("span", { class: "colour", style: `background:${hexOf(rgb)}`, "aria-hidden": "true" }) };
  };
  const ties = report.data.bases[look.basis]?.ties || [];
  const rows = result.lights.map((facts, l) => {
    const [a, b] = [result.start, result.found], lamp = setup.get(facts.name);
    const [wa, wb] = [a, b].map((x) => watts(facts, x.radiance[l], x.size[l]));
    const size = (s) => [...new Set((facts.extent || []).map((e) => short(100 * e * s)))].join(" × ");
    const [was, is] = [a, b].map((x) => colored(facts, l, x));
    const colour = was.words === is.words ? [is.swatch, " ", is.words] : [was.swatch, h("span", { class: "was" }, ` ${was.words} → `), is.swatch, ` ${is.words}`];
    const stands = [facts.moved_from ? change(facts.moved_from, facts.position, place) : place(facts.position), lamp ? h("span", { class: "code" }, `${fixed(Math.abs(lamp.azimuth), 0)}° ${lamp.azimuth < 0 ? "left" : "right"}, ${fixed(lamp.elevation, 0)}° up, ${fixed(lamp.distance, 2)} m away`) : null];
    const tied = ties.filter((tie) => tie.light === l).map((tie) => `, follows ${result.lights[tie.leader].name}`);
    const kind = (facts.beam ? `${facts.type}, beam ${fixed(facts.beam, 0)}°` : facts.type) + tied.join("");
    return [h("span", {}, facts.name, h("span", { class: "code" }, kind)), h("span", { class: "colours" }, colour), change(a.radiance[l], b.radiance[l]), facts.extent ? change(a.size[l], b.size[l], size) : "–", change(wa, wb), change(683 * wa, 683 * wb), stands];
  });
  const [start, found] = [result.start, result.found];
  const rest = [result.has_background ? `Background: value ${fixed(start.value, 2)} → ${fixed(found.value, 2)}.` : "",
    start.exposure === found.exposure ? `Exposure ${short(found.exposure)}.` : `Exposure ${short(start.exposure)} → ${short(found.exposure)}.`,
    result.surroundings ? `Surroundings: ${result.surroundings}.` : ""];
  return section("lights", "The lights", table("Lights before and after", ["light", "colour", "radiance", "size, cm", "power, W", "flux, lm", "where it stands, m"], rows, ["", "", "number", "number", "number", "number", "number"]), h("p", {}, rest.filter(Boolean).join(" ")),
    h("p", { class: "hint" }, "Radiance in W·m⁻²·sr⁻¹ (a point: W·sr⁻¹; a distant light: W·m⁻²); lumens at 683 lm/W, as modelling programs count."),
    environmentsTable(look),
    look.plan ? h("figure", { class: "plan" }, h("img", { src: look.plan, alt: "Plan of the set from above and from the side" }), h("figcaption", {}, "The set from above and from the side, to scale.")) : null);
}

// The surroundings that were compared, best first.
function environmentsTable({ environments }) {
  if (!environments) return null;
  const [head, ...rows] = environments, column = (name) => head.indexOf(name);
  const at = (row, name, digits) => fixed(Number(row[column(name)]), digits);
  const cells = rows.map((row) => [row[column("environment")], `${at(row, "rotation", 0)}°`, short(Number(row[column("radiance")])), `${at(row, "f_q", 3)} ± ${at(row, "f_q_error", 3)}`]);
  return [h("h3", {}, "Surroundings that were tried"), table("Surroundings that were tried", ["picture", "turned by", "radiance", "f_q"], cells, ["", "number", "number", "number"])];
}

function madeSection(look) {
  const { result, program, options, scene } = look, copy = report.data.bases[look.basis];
  const facts = [
    ["f_q of the lights found", `${fixed(result.f_q, 4)} ± ${fixed(result.f_q_error, 4)}, measured with samples that chose nothing`],
    result.final_spp && ["Final picture", `${options.size.join(" × ")} pixels, ${result.final_spp} samples a pixel, noise ${fixed(result.final_noise, 4)} of white`],
    ["Search", `${result.evaluations} evaluations, ${result.renders} renders at ${options.work_size.join(" × ")} pixels; stopped because ${result.stop_reason}`],
    copy && ["Live picture", `${copy.copy.size.join(" × ")} pixels, ${copy.copy.samples} samples a pixel; differs from the program's own by ${fixed(copy.error.rms, 4)} (root mean square) and ${fixed(copy.error.largest, 3)} (worst pixel) at most in ${copy.error.lightings} lightings`],
    look.timing.length && ["Seconds", look.timing.map(([stage, s]) => `${stage} ${s < 10 ? s.toFixed(1) : s.toFixed(0)}`).join(", ")],
    ["Scene", `${scene.path}, ${scene.triangles.toLocaleString("en")} triangles, content ${scene.content}`],
    ["Program", `${program.name} ${program.version}, commit ${program.commit}, Embree ${program.embree} (${program.isa}), ${program.target}, ${program.rustc}`],
    ["View, integrator, seed", `${options.view}, ${options.integrator}, ${options.seed}`],
  ].filter(Boolean);
  return section("made", "How it was made", h("dl", { class: "facts" }, facts.map(([name, text]) => [h("dt", {}, name), h("dd", {}, text)])),
    look.command ? h("div", { class: "command" }, h("p", { id: "command-name" }, "The same again:"), h("pre", { tabindex: 0, role: "region", "aria-labelledby": "command-name" }, h("code", {}, look.command))) : null);
}

// The basis of a look and its view, made once; null where it has none.
async function open(look) {
  const data = report.data.bases[look.basis];
  if (!data || typeof DecompressionStream === "undefined") return null;
  report.opened ||= [];
  report.opened[look.basis] ||= Promise.all([Basis.open(data), View.open(data.view, data.luminance)]);
  const [basis, view] = await report.opened[look.basis];
  return { basis, view };
}

// Shows a look; its live panel shows what the address says.
async function show(look, hash) {
  const main = document.getElementById("main"), opened = await open(look);
  const live = opened && new Live(opened.basis, opened.view, look);
  report.live = live;
  report.look = look;
  document.querySelectorAll("#looks button").forEach((button) => button.setAttribute("aria-current", String(button.dataset.look === look.name)));
  if (live) live.begin(hash || "");
  const first = [resultSection(look), live ? section("live", "Move the lights", h("p", {}, "Every slider makes the picture anew from the light that the run has computed; nothing is rendered, and nothing leaves this page."), live.node) : null, picksSection(look, live)];
  main.replaceChildren(...first.filter(Boolean));
  // The rest follows when the pictures are seen.
  await new Promise((resolve) => setTimeout(resolve));
  report.firstPicture ??= performance.now();
  if (report.look !== look) return;
  const rest = [termsSection(look), histogramSection(look, live), iterationsSection(look, live), frontsSection(look), lightsSection(look), madeSection(look)];
  main.append(...rest.filter(Boolean));
}

async function start() {
  const { data } = report;
  if (data.bases.length && typeof DecompressionStream === "undefined") {
    document.getElementById("main").before(h("p", { class: "caution" }, "This browser is too old to move the lights; everything else is shown."));
  }
  const hash = location.hash.slice(1), wanted = new URLSearchParams(hash).get("look");
  const looks = document.getElementById("looks");
  if (data.looks.length > 1) {
    data.looks.forEach((look) => looks.append(h("button", { type: "button", "data-look": look.name, onclick: () => { history.replaceState(null, "", `#look=${encodeURIComponent(look.name)}`); show(look); } }, look.name)));
  }
  await show(data.looks.find((look) => look.name === wanted) || data.looks[0], hash);
  document.addEventListener("keydown", (event) => {
    if (!report.live || !(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
    event.preventDefault();
    if (event.shiftKey) report.live.state.redo(); else report.live.state.undo();
  });
  window.addEventListener("hashchange", () => {
    const now = location.hash.slice(1), name = new URLSearchParams(now).get("look");
    const look = data.looks.find((other) => other.name === name);
    if (look) show(look, now);
  });
  document.documentElement.dataset.ready = "true";
  // The page of a run that goes on loads itself anew, unless its reader is at work in it.
  if (data.running) setInterval(() => { if (!report.live?.state.past.length) location.reload(); }, 5000);
}

window.lightopt = report;
start();
