// Headless Chromium by its DevTools protocol: pages at a desktop's and a phone's size, and what is said of them, a line of JSON a check.
import { createHash } from "node:crypto";
import { join } from "node:path";
import { chromium } from "playwright-core";

export const SIZES = [
  { name: "desktop", viewport: { width: 1280, height: 800 } },
  { name: "phone", viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 },
];
// Least side of what is touched, pixels.
const TOUCHED_PX = 24;
// Longest single step of the browser; longest time that a control is operated, and that a page is checked, ms.
const STEP_MS = 15000;
const CONTROL_MS = 40000;
export const PAGE_MS = 300000;
const CONTROLS = "button, input, select, textarea, a[href], summary, canvas, [onclick], [role=button]";

export function tell(name, figure, bar, passed) {
  console.log(JSON.stringify({ name, figure: String(figure), bar, passed }));
}

// What comes of something, within a time.
export async function bounded(doing, ms) {
  let timer;
  const late = new Promise((_, fail) => {
    timer = setTimeout(() => fail(new Error(`does not come to an end within ${ms / 1000} s`)), ms);
  });
  return Promise.race([doing, late]).finally(() => clearTimeout(timer));
}

// Does something; tells of it by its name where it fails, or takes too long.
export async function step(name, act, ms = PAGE_MS) {
  try {
    return await bounded(act(), ms);
  } catch (error) {
    tell(name, firstLine(error), `an end within ${ms / 1000} s`, false);
    throw error;
  }
}

const firstLine = (error) => error.message.split("\n")[0];

export function launch() {
  const executablePath = process.env.CHROMIUM;
  if (!executablePath) throw new Error("the variable CHROMIUM names no browser");
  return chromium.launch({ executablePath, args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
}

// A page of a size; `errors` collects what it says on its console and does not catch. `prepare` is done before it goes to its address.
export async function open(browser, size, address, prepare = async () => {}) {
  const { name: _, ...options } = size;
  const context = await browser.newContext(options);
  context.setDefaultTimeout(STEP_MS);
  const page = await context.newPage();
  const errors = [];
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type())) errors.push(message.text());
  });
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("requestfailed", (request) => errors.push(`${request.url().slice(0, 100)}: ${request.failure()?.errorText}`));
  await prepare(page);
  await page.goto(address, { waitUntil: "commit" });
  return { page, errors, size: size.name, context };
}

export const hash = (bytes) => createHash("sha256").update(bytes).digest("hex");

// Waits until what was changed is drawn.
export const redrawn = (page) => page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));

// What a part of the page looks like, once what was changed is drawn.
export async function look(page, selector = "body") {
  await redrawn(page);
  return hash(await page.locator(selector).screenshot());
}

export async function keep(page, folder, name) {
  await page.evaluate(() => scrollTo(0, 0));
  await page.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
}

// Every control that is seen, with what it is.
export async function controls(page) {
  const all = await page.$$(CONTROLS);
  const seen = [];
  for (const control of all) {
    if (!(await control.isVisible())) continue;
    const told = await control.evaluate((it) => {
      const box = it.closest("label") ?? it;
      const rect = box.getBoundingClientRect();
      return {
        kind: it.tagName.toLowerCase(),
        type: it.type ?? "",
        id: it.id,
        part: it.closest("#layers, #views, #motions")?.id ?? "",
        name: (it.getAttribute("aria-label") || box.innerText || it.textContent || "").trim().split("\n")[0],
        left: rect.left, right: rect.right, height: rect.height,
      };
    });
    seen.push({ control, ...told });
  }
  return seen;
}

// Operates each control that is seen, and tells of those that do not do what they are for: `operate` returns, or throws, what is wrong.
export async function operateEach(page, title, operate) {
  const all = await controls(page);
  const wrong = [];
  for (const it of all) {
    const isGone = () => it.control.evaluate((control) => !control.isConnected);
    // Live, motions of the past go.
    if (await isGone()) continue;
    const fault = await bounded(operate(page, it), CONTROL_MS).catch(firstLine);
    if (fault && !(await isGone())) wrong.push(`${it.kind} ${it.id || it.name} ${fault}`);
  }
  tell(`${title}: controls that do not do what they are for`, wrong.join("; ") || "none", `none of ${all.length}`, wrong.length === 0 && all.length > 0);
}

// The page fits its width, and its controls have names, lie within it and are large enough for a finger.
export async function inOrder(page, title, isTouched) {
  // A phone's window grows with a page that is too wide: the screen does not.
  const wide = [await page.evaluate(() => document.documentElement.scrollWidth), page.viewportSize().width];
  tell(`${title}: width of the page, of the screen`, wide.join(", "), "not wider", wide[0] <= wide[1]);
  const bad = [];
  for (const it of await controls(page)) {
    const called = `${it.kind} ${it.id || it.name}`;
    if (!it.name) bad.push(`${called} has no name`);
    if (it.left < -0.5 || it.right > wide[1] + 0.5) bad.push(`${called} leaves the page`);
    if (isTouched && it.height < TOUCHED_PX) bad.push(`${called} is ${it.height.toFixed(0)} px high`);
  }
  tell(`${title}: controls without a name, outside the page or too small to touch`, bad.join("; ") || "none", "no control", bad.length === 0);
}
