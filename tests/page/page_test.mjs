// node page_test.mjs PAGE.html OUTDIR
// Drives a report page in a headless Chromium as a reader would, and checks what the page claims to have: the model,
// its tetrahedra, pockets, comparisons, tables. Screenshots go to OUTDIR. Exit code 1 and a line for each failure.
// Environment: VDBGEO_PAGE_MODULES is a node_modules folder with playwright-core; CHROMIUM is the browser;
// VDBGEO_PAGE_DUST is set for a model whose pieces have but a pixel or two: edges and ranges may not show on these.
import {mkdirSync, readFileSync, statSync, writeFileSync} from "node:fs";
import {createRequire} from "node:module";
import {resolve} from "node:path";
import {pathToFileURL} from "node:url";

import {colours, difference, read_png} from "./png.mjs";

const [page_file, out] = process.argv.slice(2);
if (!page_file || !out) {
  console.error("usage: node page_test.mjs PAGE.html OUTDIR");
  process.exit(2);
}
const modules = process.env.VDBGEO_PAGE_MODULES ?? resolve("node_modules");
const {chromium} = createRequire(`${modules}/`)("playwright-core");
mkdirSync(out, {recursive: true});
const address = pathToFileURL(resolve(page_file)).href;

let failures = 0;
function check(good, what) {
  if (good) return;
  ++failures;
  console.error(`page test: FAILED: ${what}`);
}

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
         "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});

async function open(settings = {}, file = address, prepare = null) {
  const context = await browser.newContext({viewport: {width: 1280, height: 900}, reducedMotion: "reduce", ...settings});
  context.setDefaultTimeout(10000);
  const page = await context.newPage();
  page.on("console", (message) => {
    // Reading pixels back for a screenshot is what Chromium calls slow; that is the test's doing.
    if (["error", "warning"].includes(message.type()) && !message.text().includes("GPU stall due to ReadPixels"))
      check(false, `the console has a message: ${message.text()}`);
  });
  page.on("pageerror", (error) => check(false, `uncaught: ${error.stack ?? error}`));
  page.on("request", (request) => check(/^(file|data|blob):/.test(request.url()), `the page asks the network for ${request.url()}`));
  if (prepare) await page.addInitScript(prepare);
  await page.goto(file);
  return page;
}

const control = (page, label) => page.locator("#viewer .controls").getByLabel(label, {exact: true});
const shot = (page, name) => page.screenshot({path: `${out}/${name}.png`});
const claims = (page) => page.evaluate(() => {
  const element = document.getElementById("vdbgeo-data");
  const data = element ? JSON.parse(element.textContent) : {};
  const count = (what) => document.querySelectorAll(what).length;
  return {surface: Boolean(data.surface), tets: Boolean(data.tets), viewer: count("#viewer") > 0 && Boolean(data.surface || data.tets),
          properties: (data.surface?.properties ?? []).map((p) => [p.key, p.kind, p.range && p.range[0] < p.range[1]]), pockets: count("#pockets tr[data-pocket]"),
          compares: count("div.compare"), copies: count("button.copy")};
});

// The picture when all is at rest.
async function picture(page) {
  await page.evaluate(() => window.vdbgeo.settled());
  return read_png(await page.locator("#viewer .stage > canvas").first().screenshot());
}

async function changes(page, what, action) {
  const least = process.env.VDBGEO_PAGE_DUST && /^edges|^another range/.test(what) ? 0 : 0.002;
  const before = await picture(page);
  await action();
  const after = await picture(page);
  const share = difference(before, after);
  check(share >= least, `${what} changes the picture (${(100 * share).toFixed(2)} % of the pixels differ)`);
  return after;
}

async function ready(page) {
  const done = await page.waitForSelector('#viewer[data-ready="true"]', {timeout: 60000}).then(() => true, () => false);
  const note = await page.locator("#viewer .viewer-note").allTextContents();
  check(done, `the viewer is ready within a minute ${note.join(" ")}`);
  return done;
}

async function check_gestures(page) {
  const canvas = page.locator("#viewer .stage > canvas").first();
  await canvas.scrollIntoViewIfNeeded();
  const box = await canvas.boundingBox();
  const x = box.x + box.width / 2, y = box.y + box.height / 2;
  await changes(page, "dragging", async () => {
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 90, y + 40, {steps: 4});
    await page.mouse.up();
  });
  await changes(page, "the wheel", () => page.mouse.wheel(0, -240));
  await page.keyboard.press("Home");
  await changes(page, "an arrow key", () => page.keyboard.press("ArrowLeft"));
  await changes(page, "Shift and an arrow key", () => page.keyboard.press("Shift+ArrowUp"));
  await changes(page, "the key +", () => page.keyboard.press("+"));
  const home = await page.evaluate(() => window.vdbgeo.camera());
  await page.keyboard.press("Home");
  await page.evaluate(() => window.vdbgeo.settled());
  check(JSON.stringify(await page.evaluate(() => window.vdbgeo.camera())) !== JSON.stringify(home), "Home moves the camera");
  for (const name of ["front", "side", "top"])
    await changes(page, `the view from ${name}`, () => page.getByRole("button", {name: new RegExp(`View from the ${name}`)}).click());
  await page.getByRole("button", {name: "Reset the view"}).click();
}

async function check_colours(page, properties) {
  for (const [key, kind, wide] of properties) {
    const now = await changes(page, `colouring by ${key}`, () => control(page, "Colour by").selectOption(key));
    check(await page.locator("#viewer .key").isVisible(), `there is a colour key for ${key}`);
    if (kind === "category" || !wide) continue;
    const high = control(page, "to"), value = Number(await high.inputValue());
    const low = Number(await control(page, "From").inputValue());
    await changes(page, `another range for ${key}`, () => high.fill(String(low + 0.1 * (value - low))));
    await page.getByRole("button", {name: "Reset range"}).click();
    check(difference(now, await picture(page)) < 0.001, `the reset of the range of ${key} brings back the picture`);
    await high.fill(String(low - 1));
    check(await high.getAttribute("aria-invalid") === "true", `an impossible range for ${key} is refused`);
    await page.getByRole("button", {name: "Reset range"}).click();
  }
}

async function check_section(page, what) {
  await page.getByRole("button", {name: "Reset the view"}).click();
  await changes(page, `a section through the ${what}`, () => control(page, "Cut open").check());
  await changes(page, `moving the section of the ${what}`, () => control(page, "At").press("PageUp"));
  await changes(page, `the other side of the ${what}`, () => control(page, "Other side").check());
  await control(page, "Other side").uncheck();
  await changes(page, `a section across y through the ${what}`, () => control(page, "Across").selectOption("1"));
  await page.evaluate(() => window.vdbgeo.settled());
  await shot(page, `clip_${what}`);
  await control(page, "Cut open").uncheck();
}

async function check_pocket(page) {
  const before = await page.evaluate(() => window.vdbgeo.camera());
  const row = page.locator('#pockets tr[data-pocket][tabindex="0"]').first();
  check(await row.count() > 0, "rows of pockets can be chosen");
  if (!await row.count()) return;
  await row.focus();
  await page.keyboard.press("Enter");
  await page.evaluate(() => window.vdbgeo.settled());
  const after = await page.evaluate(() => window.vdbgeo.camera());
  check(JSON.stringify(before) !== JSON.stringify(after), "a row of the pockets moves the camera");
  check(await row.getAttribute("aria-selected") === "true", "the chosen row is marked");
  await shot(page, "pocket");
  await page.keyboard.press("Escape");
  check(await row.getAttribute("aria-selected") === "false", "Escape leaves the pocket");
  await page.evaluate(() => window.vdbgeo.settled());
}

async function check_viewer(page, has) {
  if (!await ready(page)) return;
  const time = await page.evaluate(() => performance.getEntriesByName("vdbgeo-first-picture")[0]?.startTime);
  console.log(`first picture after ${Math.round(time)} ms`);
  await shot(page, "light");
  check(colours(await picture(page)) > 20, "the canvas shows a model, not one colour");
  await check_gestures(page);
  if (has.surface) await check_colours(page, has.properties);
  await changes(page, "edges", () => control(page, "Edges of the mesh").check());
  await shot(page, "edges");
  await control(page, "Edges of the mesh").uncheck();
  if (has.surface) await check_section(page, "surface");
  if (has.pockets && has.surface) await check_pocket(page);
  if (has.tets) {
    if (has.surface) await changes(page, "showing tetrahedra", () => control(page, "Show").selectOption("tets"));
    await check_section(page, "tetrahedra");
  }
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", {name: "Save picture"}).click()]);
  await download.saveAs(`${out}/saved.png`);
  check(statSync(`${out}/saved.png`).size > 5000, "the saved picture is not empty");
}

async function check_page(page, has) {
  if (has.compares) {
    const block = page.locator("div.compare").first();
    const split = () => block.locator(".stack").evaluate((e) => getComputedStyle(e).getPropertyValue("--split"));
    await block.scrollIntoViewIfNeeded();
    const before = await split();
    await block.locator("input[type=range]").press("ArrowRight");
    check(before !== await split(), "the slider between before and after moves");
    await shot(page, "compare");
  }
  if (has.copies) {
    const button = page.locator("button.copy").first();
    await button.click();
    await page.waitForFunction(() => /Copied|Not copied/.test(document.querySelector("button.copy").textContent));
    check(await button.textContent() === "Copied", "the copy button copies");
    const text = await page.evaluate(() => navigator.clipboard.readText());
    const table = await page.evaluate(() => document.getElementById(document.querySelector("button.copy").dataset.copy).tagName === "TABLE");
    check(text.length > 0 && (!table || text.includes("\t")), `a table is copied with tabs: ${text.slice(0, 60)}`);
  }
}

const wide_elements = () => [...document.querySelectorAll("body *")].filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
    .slice(0, 5).map((e) => e.tagName + (e.className ? `.${e.className}` : "")).join(" ");

// One finger turns, two zoom.
async function check_touch(page) {
  const canvas = page.locator("#viewer .stage > canvas").first();
  await canvas.scrollIntoViewIfNeeded();
  const box = await canvas.boundingBox(), x = box.x + box.width / 2, y = box.y + box.height / 2;
  const client = await page.context().newCDPSession(page);
  const touch = (type, ...points) => client.send("Input.dispatchTouchEvent", {type, touchPoints: points.map(([px, py], id) => ({x: px, y: py, id}))});
  await changes(page, "a finger", async () => {
    await touch("touchStart", [x, y]);
    await touch("touchMove", [x + 60, y + 10]);
    await touch("touchEnd");
  });
  const before = await page.evaluate(() => window.vdbgeo.camera().half_height);
  await touch("touchStart", [x - 30, y], [x + 30, y]);
  await touch("touchMove", [x - 60, y], [x + 60, y]);
  await touch("touchEnd");
  await page.evaluate(() => window.vdbgeo.settled());
  const after = await page.evaluate(() => window.vdbgeo.camera().half_height);
  check(after < 0.8 * before, `two fingers apart enlarge the picture (half of its height from ${before} to ${after})`);
}

// Where motion is welcome the camera flies, and arrives.
async function check_flight(page) {
  const camera = () => page.evaluate(() => window.vdbgeo.settled().then(() => window.vdbgeo.camera()));
  const home = await camera();
  await page.getByRole("button", {name: "View from the top"}).click();
  const top = await camera();
  await page.getByRole("button", {name: "Reset the view"}).click();
  const back = await camera();
  const apart = (a, b) => Math.hypot(...a.position.map((p, i) => p - b.position[i])) / home.half_height;
  check(apart(home, top) > 0.1, "the camera flies to the top");
  check(apart(home, back) < 0.001, "the camera flies back");
}

async function check_narrow() {
  for (const width of [400, 360]) {
    const page = await open({viewport: {width, height: 800}, hasTouch: true});
    const has = await claims(page);
    if (has.viewer && !await ready(page)) return;
    const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    check(over <= 0, `no sideways scrolling at ${width} pixels (${over} too many: ${await page.evaluate(wide_elements)})`);
    if (has.viewer && width === 400) await check_touch(page);
    await page.screenshot({path: `${out}/narrow_${width}.png`, fullPage: true});
    await page.context().close();
  }
}

async function check_dark() {
  const page = await open({colorScheme: "dark", reducedMotion: "no-preference"});
  const has = await claims(page);
  if (has.viewer && await ready(page)) await check_flight(page);
  const luminance = await page.evaluate(() => getComputedStyle(document.body).backgroundColor.match(/\d+/g).slice(0, 3).reduce((a, b) => a + Number(b), 0) / 3);
  check(luminance < 80, "the page is dark where the reader wants it");
  await page.screenshot({path: `${out}/dark.png`, fullPage: true});
  await page.context().close();
}

// Where the model cannot be shown the poster stays and a line says why; nothing is thrown.
async function check_without(what, prepare, file = address) {
  const page = await open({}, file, prepare);
  await page.waitForSelector("#viewer .viewer-note", {timeout: 20000}).catch(() => check(false, `a line says why ${what} is trouble`));
  const poster = page.locator("#viewer .poster");
  check(await poster.count() === 0 || await poster.isVisible(), `the poster stays with ${what}`);
  check(await page.locator("#viewer .stage").count() === 0 || !await page.locator("#viewer .stage").isVisible(), `no empty canvas with ${what}`);
  await page.context().close();
}

async function check_poster() {
  await check_without("no WebGL", () => {
    const real = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind === "2d" ? real.call(this, kind, ...rest) : null; };
  });
  await check_without("no DecompressionStream", () => { delete window.DecompressionStream; });
  const damaged = resolve(out, "damaged.html");
  writeFileSync(damaged, readFileSync(page_file, "utf8").replace(/("data":\s*")[^"]{12}/g, "$1AAAAAAAAAAAA"));
  await check_without("damaged data", () => {}, pathToFileURL(damaged).href);
}

try {
  const page = await open({permissions: ["clipboard-read", "clipboard-write"]});
  const has = await claims(page);
  if (has.viewer) await check_viewer(page, has);
  await check_page(page, has);
  const pdf = await page.pdf({format: "A4", printBackground: true});
  check(pdf.length > 5000, "the page prints");
  writeFileSync(`${out}/page.pdf`, pdf);
  await page.screenshot({path: `${out}/whole.png`, fullPage: true});
  await page.context().close();
  await check_dark();
  await check_narrow();
  if (has.viewer) await check_poster();
} catch (error) {
  check(false, error.stack);
} finally {
  await browser.close();
}
if (!failures) console.log("page test: all good");
process.exit(failures ? 1 : 0);
