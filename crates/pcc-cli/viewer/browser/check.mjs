// node check.mjs FOLDER PAGE…: opens each page of a file at both sizes, takes pictures of it, and operates every control of it.
import { basename } from "node:path";
import { pathToFileURL } from "node:url";
import { SIZES, controls, inOrder, keep, launch, look, open, step, tell } from "./driver.mjs";
import { operateAll } from "./view_controls.mjs";

// Longest time from the navigation until the first picture is drawn, ms.
const LOADED_MS = 2000;
// Length of the page of a record, s: a recorder's first and last messages lie within what it recorded.
const RECORDED_S = 60;

// When the graphics card, or what stands for it, has drawn all that the page has asked it for, ms from the navigation.
const drawnAt = (page) => page.evaluate(() => {
  const gl = document.getElementById("scene").getContext("webgl2");
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  return new Promise((drawn) => {
    const look = () => (gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED ? drawn(performance.now()) : setTimeout(look, 1));
    look();
  });
});

async function checkView({ page, size }, title, folder, name) {
  await page.waitForSelector("body[data-ready]", { timeout: 60000 });
  const drawn = await drawnAt(page);
  const length = await page.evaluate(() => document.getElementById("now").textContent.split(" of ")[1]);
  tell(`${title}: from navigation to the first picture, of ${length}`, `${drawn.toFixed(0)} ms`, `< ${LOADED_MS} ms`, drawn < LOADED_MS);
  if (name === "record") tell(`${title}: length`, length, `>= ${RECORDED_S} s`, parseFloat(length) >= RECORDED_S);
  await keep(page, folder, `${name}-${size}-first`);
  await inOrder(page, title, size === "phone");
  await operateAll(page, title);
  await page.locator("#all").click();
  await keep(page, folder, `${name}-${size}-last`);
}

// Whether a link within the page leads to something that is seen then.
async function leadsSomewhere(page, link) {
  await link.click();
  return link.evaluate((it) => {
    const place = document.getElementById(it.getAttribute("href").slice(1))?.getBoundingClientRect();
    return place !== undefined && place.bottom > 0 && place.top < innerHeight;
  });
}

// A page of another kind: links lead to their places, whatever else can be pressed changes something.
async function checkOther({ page, size }, title, folder, name) {
  await page.waitForLoadState("load");
  await keep(page, folder, `${name}-${size}`);
  await inOrder(page, title, false);
  const all = await controls(page);
  const still = [];
  for (const { control, kind, name: called } of all) {
    if (kind === "a") {
      if (!(await leadsSomewhere(page, control))) still.push(called);
      continue;
    }
    const before = await look(page);
    await (kind === "select" ? control.selectOption({ index: await control.evaluate((it) => it.options.length - 1) }) : control.click());
    if (before === (await look(page))) still.push(called);
  }
  // A page of figures has a list of them; a page of one comparison has no control.
  const least = Math.min(1, await page.locator("figure").count());
  tell(`${title}: links that lead nowhere, other controls that change nothing`, still.join("; ") || "none", `none of ${all.length}, which are ${least} at least`, still.length === 0 && all.length >= least);
}

const [folder, ...pages] = process.argv.slice(2);
const browser = await launch();
for (const file of pages) {
  for (const size of SIZES) {
    const name = basename(file, ".html"), title = `${name}, ${size.name}`;
    const opened = await open(browser, size, pathToFileURL(file).href);
    const isView = (await opened.page.waitForLoadState("domcontentloaded"), await opened.page.locator("#scene").count()) > 0;
    await step(`${title}: its checks`, () => (isView ? checkView : checkOther)(opened, title, folder, name));
    tell(`${title}: errors and warnings on the console`, opened.errors.join("; ") || "none", "no line", opened.errors.length === 0);
    await opened.context.close();
  }
}
await browser.close();
