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
const CONTROLS = "button, input, select, textarea, a[href], summary, canvas, [onclick], [role=button]";

export function tell(name, figure, bar, passed) {
  console.log(JSON.stringify({ name, figure: String(figure), bar, passed }));
}

export function launch() {
  const executablePath = process.env.CHROMIUM;
  if (!executablePath) throw new Error("the variable CHROMIUM names no browser");
  return chromium.launch({ executablePath, args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
}

// A page of a size; `errors` collects what it says on its console and does not catch.
export async function open(browser, size, address) {
  const { name: _, ...options } = size;
  const context = await browser.newContext(options);
  const page = await context.newPage();
  const errors = [];
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type())) errors.push(message.text());
  });
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("requestfailed", (request) => errors.push(`${request.url().slice(0, 100)}: ${request.failure()?.errorText}`));
  await page.goto(address, { waitUntil: "commit" });
  return { page, errors, size: size.name, context };
}

export const hash = (bytes) => createHash("sha256").update(bytes).digest("hex");

// What a part of the page looks like, once what was changed is drawn.
export async function look(page, selector = "body") {
  await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
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
        name: (it.getAttribute("aria-label") || box.innerText || it.textContent || "").trim().split("\n")[0],
        left: rect.left, right: rect.right, height: rect.height,
      };
    });
    seen.push({ control, ...told });
  }
  return seen;
}

// The page fits its width, and its controls have names, lie within it and are large enough for a finger.
export async function inOrder(page, title, isTouched) {
  const wide = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  tell(`${title}: width of the page, of the window`, wide.join(", "), "not wider", wide[0] <= wide[1]);
  const bad = [];
  for (const it of await controls(page)) {
    const called = `${it.kind} ${it.id || it.name}`;
    if (!it.name) bad.push(`${called} has no name`);
    if (it.left < -0.5 || it.right > wide[1] + 0.5) bad.push(`${called} leaves the page`);
    if (isTouched && it.height < TOUCHED_PX) bad.push(`${called} is ${it.height.toFixed(0)} px high`);
  }
  tell(`${title}: controls without a name, outside the page or too small to touch`, bad.join("; ") || "none", "no control", bad.length === 0);
}
