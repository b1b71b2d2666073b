// Drives the page of a run in a browser and compares it with what the command line says of the same lights.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";

import { Browser } from "./browser.mjs";
import { writeScene } from "./scene.mjs";

const [program, work, axe, screenshots] = process.argv.slice(2);
// What the page may differ by from `relight`, in display luminance, and from `evaluate`, in f_q.
const LUMINANCE = 1e-2, F_Q = 5e-3;

const command = (...args) => execFileSync(program, args, { cwd: work, encoding: "utf8", stdio: ["ignore", "pipe", "ignore"], maxBuffer: 1 << 26 });
const say = (text) => console.log(text);

// Display luminance of every pixel of a PNG, decoded in the page.
async function luminanceOf(page, file) {
  const url = `data:image/png;base64,${readFileSync(file).toString("base64")}`;
  return page.run(`(async () => {
    const image = new Image(); image.src = ${JSON.stringify(url)}; await image.decode();
    const canvas = document.createElement("canvas"); canvas.width = image.width; canvas.height = image.height;
    const context = canvas.getContext("2d"); context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    return ${shown("data")};
  })()`);
}

// Display luminance of bytes as a display shows them, as an expression.
const shown = (bytes) => `Array.from({ length: ${bytes}.length / 4 }, (_, p) => encode([0, 1, 2].reduce((sum, c) => sum + LUMINANCE[c] * decode(${bytes}[4 * p + c] / 255), 0)))`;

// Display luminance of the page's picture before it is rounded to bytes.
const unrounded = `(() => {
  const { view, basis, state } = lightopt.live, [R, G, B] = basis.picture(state.x), e = state.now.exposure, codes = [0, 0, 0], light = [0, 0, 0];
  return Array.from(R, (_, p) => {
    view.display([e * R[p], e * G[p], e * B[p]], codes, light);
    return encode(codes.reduce((sum, code, c) => sum + LUMINANCE[c] * decode(code), 0));
  });
})()`;

// The lights of the page now, against `relight` and `evaluate`.
async function compare(page, run, target, view, what, more = []) {
  const toml = await page.run("lightopt.live.toml()");
  writeFileSync(join(work, "now.toml"), toml);
  const basis = join(run, "transport.basis");
  command("relight", "--lights", "now.toml", basis, "-o", "now.exr");
  command("relight", "--lights", "now.toml", basis, "-o", "now.png");
  const wanted = JSON.parse(command("evaluate", "--json", "--target", target, ...more, "now.exr"));
  const measured = await page.run("({ f_q: lightopt.live.measured.f_q, terms: lightopt.live.measured.terms })");
  const off = Math.abs(measured.f_q - wanted.f_q);
  assert.ok(off <= F_Q, `${what}: f_q ${measured.f_q}, evaluate says ${wanted.f_q}`);
  for (const [name, { value }] of Object.entries(wanted.terms)) {
    const here = measured.terms[name].value;
    assert.ok(Math.abs(here - value) <= 2 * LUMINANCE, `${what}: ${name} ${here}, evaluate says ${value}`);
  }
  // The one as numbers, the other as bytes, of which half a one is the error.
  const [a, b] = [await page.run(unrounded), await luminanceOf(page, join(work, "now.png"))];
  assert.equal(a.length, b.length);
  const differences = a.map((l, p) => Math.abs(l - b[p])).sort((x, y) => x - y);
  const largest = differences[differences.length - 1], rms = Math.sqrt(differences.reduce((s, d) => s + d * d, 0) / differences.length);
  assert.ok(largest <= LUMINANCE + 0.5 / 255, `${what}: a pixel is off by ${largest}`);
  say(`${what} (${view}): f_q off by ${off.toFixed(5)}; display luminance by ${rms.toFixed(5)} rms, ${largest.toFixed(5)} at most`);
}

// Moves a slider as a hand does.
const slide = (label, value) => `(() => {
  const input = [...document.querySelectorAll("#live input")].find((i) => i.getAttribute("aria-label") === ${JSON.stringify(label)});
  input.value = ${value};
  input.dispatchEvent(new Event("input", { bubbles: true }));
  input.dispatchEvent(new Event("change", { bubbles: true }));
  lightopt.live.draw();
})()`;
const sum = "lightopt.live.image.data.reduce((a, b) => a + b, 0)";

async function checkNumbers(browser) {
  const scene = writeScene(work, "room", 3);
  for (const view of ["srgb", "agx", "filmic", "pbr-neutral", "linear"]) {
    const out = join(work, `run-${view}`);
    command("run", scene, "--view", view, "--work-size", "48x36", "--size", "48x36", "--final-spp", "4", "--keep-basis", "--tolerance", "0.05", "--targets", "high-key,low-key", "--out", out);
    const page = await browser.page();
    await page.open(join(out, "report.html"));
    await compare(page, out, "high-key", view, "as found");
    await page.run("lightopt.live.replace(lightopt.look.result.start)");
    await page.run("lightopt.live.draw()");
    await compare(page, out, "high-key", view, "start");
    await page.run(slide("light 1: radiance in stops", 1.5));
    await page.run(slide("light 2: size", "-1.2"));
    await page.run(slide("Value of the background", 0.6));
    await page.run(slide("Exposure in stops", 0.5));
    await compare(page, out, "high-key", view, "moved");
    await page.run("lightopt.live.state.edit((x) => { x.off[2] = true; }); lightopt.live.state.settle(); lightopt.live.draw()");
    await compare(page, out, "high-key", view, "one off");
    const hash = await page.run("location.hash"), before = await page.run(sum);
    await page.open(join(out, "report.html"), hash);
    // Its nine digits may round a byte the other way.
    assert.ok(Math.abs((await page.run(sum)) - before) <= 4, "the address holds the lighting");
    assert.deepEqual(page.complaints, []);
  }
}

// Colours of lights and of looks, weights, ties, lamps and surroundings: the page measures them as the program does.
async function checkSeams(browser) {
  const scene = join(work, "room.obj");
  const page = await browser.page();
  await page.visit("about:blank");
  // Weights that rise to the right.
  const url = await page.run(`(() => { const c = document.createElement("canvas"); c.width = 8; c.height = 6; const x = c.getContext("2d"); for (let i = 0; i < 8; i++) { x.fillStyle = "rgb(" + [36 * i, 36 * i, 36 * i] + ")"; x.fillRect(i, 0, 1, 6); } return c.toDataURL(); })()`);
  writeFileSync(join(work, "weights.png"), Buffer.from(url.split(",")[1], "base64"));
  const seams = [
    ["golden-hour", ["--target", "golden-hour", "--free", "radiance,size,background,color"]],
    ["neon", ["--target", "neon", "--free", "radiance,color_rgb", "--view", "agx"]],
    ["high-key", ["--weights", "weights.png"], ["--weights", "weights.png"]],
    ["high-key", ["--tie", "light 2=light 1*0.5", "--ratio", "light 3=light 1/4"]],
    ["moonlight", ["--lamps", "2", "--target", "moonlight", "--free", "radiance,size,color,exposure"]],
  ];
  for (const [i, [target, options, more]] of seams.entries()) {
    const out = join(work, `seam-${i}`), what = options.filter((option) => option.startsWith("--")).join(" ");
    command("run", scene, "--work-size", "48x36", "--size", "48x36", "--final-spp", "4", "--keep-basis", "--tolerance", "0.05", ...options, "--out", out);
    await page.open(join(out, "report.html"));
    await compare(page, out, target, "as found", what, more);
    await page.run("lightopt.live.replace(lightopt.look.result.start); lightopt.live.draw()");
    await compare(page, out, target, "start", what, more);
    const ratio = "lightopt.live.state.now.radiance[1] / lightopt.live.state.now.radiance[0]", before = await page.run(ratio);
    await page.run(`lightopt.live.replace(lightopt.look.result.found); lightopt.live.state.setStops(0, 0.7); if (lightopt.live.basis.lights[0].knots) lightopt.live.state.setSize(0, 0.8 * lightopt.live.basis.lights[0].size); ${
      ["golden-hour", "moonlight"].includes(target) ? "lightopt.live.state.edit((x) => { x.color[0] = { temperature: { kelvin: 3300, tint: 0.01 } }; });" : ""} lightopt.live.state.settle(); lightopt.live.draw()`);
    await compare(page, out, target, "moved", what, more);
    if (options.includes("--tie")) {
      assert.ok(Math.abs((await page.run(ratio)) / before - 1) < 1e-9, "a tied light follows");
      await page.run("lightopt.live.state.setStops(1, -1); lightopt.live.state.settle(); lightopt.live.draw()");
      assert.ok(Math.abs((await page.run(ratio)) / before - 1) < 1e-9, "and takes along the one that it follows");
      await compare(page, out, target, "by a tied light", what, more);
      assert.match(await page.run("document.querySelector('.tied').textContent"), /Tied to light/);
    }
    if (options.includes("--free") && !options.includes("--lamps")) {
      const words = await page.run("[...document.querySelectorAll('#lights .colours')].map((cell) => cell.textContent)");
      assert.ok(words.length === 3 && words.every((text) => /→.*(K|#\w{6})$/.test(text)), words.join("; "));
    }
    if (options.includes("--lamps")) {
      assert.ok(await page.run("document.querySelector('.plan img').naturalWidth > 0"), "the plan is shown");
    }
    // The address brings the colours back.
    const hash = await page.run("location.hash"), shown = await page.run(sum);
    await page.open(join(out, "report.html"), hash);
    assert.ok(Math.abs((await page.run(sum)) - shown) <= 8, "the address holds the lighting");
    assert.deepEqual(page.complaints, []);
  }
}

// What a hand and a keyboard do, and that nothing leaves the page.
async function checkUse(browser) {
  const page = await browser.page(), file = join(work, "run-srgb", "report.html");
  await page.open(file);
  const first = await page.run("lightopt.firstPicture");
  const found = await page.run(sum);
  await page.run(slide("light 1: radiance in stops", -3));
  const darker = await page.run(sum);
  assert.notEqual(darker, found, "a slider moves the picture");
  await page.run("lightopt.live.undoButton.click(); lightopt.live.draw()");
  assert.equal(await page.run(sum), found, "undo brings it back");
  await page.run("lightopt.live.redoButton.click(); lightopt.live.draw()");
  assert.equal(await page.run(sum), darker, "redo takes it away again");
  await page.run(slide("light 1: colour temperature", 2500));
  assert.notEqual(await page.run(sum), darker, "colour is seen");
  await page.run("[...document.querySelectorAll('#live .toggle')].find((b) => b.textContent === 'Solo').click(); lightopt.live.draw()");
  await page.run("lightopt.live.stage.focus()");
  for (const key of ["ArrowLeft", "ArrowUp"]) {
    for (const type of ["keyDown", "keyUp"]) await page.send("Input.dispatchKeyEvent", { type, key, code: key });
  }
  const shares = await page.run("[...document.querySelectorAll('.who li')].map((li) => li.textContent)");
  assert.equal(shares.length, 1, "one light is alone");
  assert.match(shares[0], /light 1.*100/);
  const looks = await page.run("[...document.querySelectorAll('#looks button')].map((b) => b.textContent)");
  assert.deepEqual(looks, ["high-key", "low-key"]);
  await page.run("document.querySelectorAll('#looks button')[1].click()");
  await page.run("new Promise((resolve) => setTimeout(resolve, 300))");
  assert.equal(await page.run("lightopt.look.name"), "low-key");
  assert.deepEqual(page.complaints, []);
  const outside = page.requests.filter((url) => !url.startsWith("data:") && !url.startsWith("blob:") && url.split("#")[0] !== `file://${file}` && url !== "about:blank");
  assert.deepEqual(outside, [], "no request leaves the page");
  say(`first picture after ${first.toFixed(0)} ms; the page has ${(statSync(file).size / 1e6).toFixed(2)} MB`);
}

// Paper mode has no basis: all but the lights to be moved is shown.
async function checkPaperMode(browser) {
  const out = join(work, "run-fd");
  command("run", join(work, "room.obj"), "--gradient", "fd", "--work-size", "24x18", "--size", "48x36", "--spp", "4", "--final-spp", "4", "--max-evaluations", "3", "--out", out);
  const page = await browser.page();
  await page.open(join(out, "report.html"));
  assert.deepEqual(page.complaints, []);
  const titles = await page.run("[...document.querySelectorAll('h2')].map((title) => title.textContent)");
  assert.ok(titles.includes("The lights") && !titles.includes("Move the lights"), titles.join(", "));
}

async function checkAccess(browser) {
  const page = await browser.page(), source = existsSync(axe) ? readFileSync(axe, "utf8") : null;
  for (const [width, dark] of [[1400, false], [1400, true], [800, false], [390, false], [390, true]]) {
    await page.seenAs({ width, dark });
    await page.open(join(work, "run-srgb", "report.html"));
    const wide = await page.run("document.documentElement.scrollWidth");
    assert.ok(wide <= width, `at ${width} pixels the page is ${wide} wide`);
    if (source) {
      await page.run(`${source}; true`);
      const { violations } = await page.run("axe.run(document, { resultTypes: ['violations'] }).then(({ violations }) => ({ violations: violations.map(({ id, impact, nodes }) => ({ id, impact, nodes: nodes.slice(0, 3).map((n) => n.html.slice(0, 160)) })) }))");
      const serious = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
      assert.deepEqual(serious, [], `axe at ${width}, ${dark ? "dark" : "light"}`);
      say(`axe at ${width} pixels, ${dark ? "dark" : "light"}: nothing serious, ${violations.length} of less`);
    }
    if (screenshots) {
      mkdirSync(screenshots, { recursive: true });
      const height = await page.run("document.documentElement.scrollHeight");
      writeFileSync(join(screenshots, `${width}-${dark ? "dark" : "light"}.png`), await page.picture({ x: 0, y: 0, width, height }));
    }
  }
}

// How long a step of a slider takes with twelve lights: said, and left to the reader, as it hangs on the machine.
async function tellTimes(browser) {
  const scene = writeScene(work, "hall", 12), out = join(work, "run-hall");
  command("run", scene, "--work-size", "160x120", "--size", "160x120", "--spp", "8", "--final-spp", "4", "--tolerance", "0.2", "--out", out);
  const page = await browser.page(), file = join(out, "report.html");
  await page.open(file);
  const first = await page.run("lightopt.firstPicture");
  const step = (change) => page.run(`(() => {
    const times = [];
    for (let i = 0; i < 21; i++) {
      const begun = performance.now();
      lightopt.live.state.edit((x) => { ${change}; });
      lightopt.live.draw();
      times.push(performance.now() - begun);
    }
    return times.sort((a, b) => a - b)[10];
  })()`);
  const radiance = await step("x.radiance[i % 12] = 0.1 * (i + 1)"), size = await step("x.size[i % 12] *= 0.97"), value = await step("x.value = 0.05 * (i + 1)");
  say(`160 x 120 pixels, 12 lights: first picture after ${first.toFixed(0)} ms, page of ${(statSync(file).size / 1e6).toFixed(2)} MB; a step of radiance takes ${radiance.toFixed(1)} ms, of size ${size.toFixed(1)} ms, of the background's value ${value.toFixed(1)} ms`);
  assert.deepEqual(page.complaints, []);
}

const browser = await Browser.start();
try {
  await checkNumbers(browser);
  await checkSeams(browser);
  await checkUse(browser);
  await checkPaperMode(browser);
  await checkAccess(browser);
  await tellTimes(browser);
} finally {
  await browser.end();
}
