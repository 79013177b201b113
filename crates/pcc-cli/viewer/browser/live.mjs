// node live.mjs FOLDER ADDRESS: pages of `pcc view --live`, several at a time; then says "watching", and sees controller and daemon go and
// come back.
import { SIZES, inOrder, keep, launch, open, tell } from "./driver.mjs";
import { operateAll } from "./view_controls.mjs";

const MOST_FRAMES_S = 50;
const PATIENCE_MS = 90000;
const [folder, address] = process.argv.slice(2);

// Frames a second that the server tells, over some seconds.
async function frames(seconds) {
  const stop = new AbortController();
  const response = await fetch(`${address}live`, { signal: stop.signal });
  const decoder = new TextDecoder();
  const begun = performance.now();
  let count = 0, rest = "";
  for await (const bytes of response.body) {
    rest += decoder.decode(bytes, { stream: true });
    const events = rest.split("\n\n");
    rest = events.pop();
    count += events.filter((event) => event.startsWith("event: frame")).length;
    if (performance.now() > begun + 1000 * seconds) break;
  }
  const elapsed = (performance.now() - begun) / 1000;
  stop.abort();
  return count / elapsed;
}

const until = async (page) => parseFloat((await page.locator("#now").textContent()).split(" of ")[1]);
const state = (page, text) => page.waitForFunction((wanted) => document.getElementById("state").textContent.includes(wanted), text, { timeout: PATIENCE_MS });

async function goesOn(page) {
  const before = await until(page);
  await page.waitForFunction((time) => parseFloat(document.getElementById("now").textContent.split(" of ")[1]) > time + 0.5, before, { timeout: PATIENCE_MS });
}

const browser = await launch();
const opened = [];
for (const size of SIZES) opened.push(await open(browser, size, address));
for (const { page } of opened) await page.waitForSelector("body[data-ready]", { timeout: PATIENCE_MS });
for (const { page } of opened) await goesOn(page);
tell("live: pages that show what happens at the same time", opened.length, ">= 2", opened.length >= 2);
const rate = await frames(4);
tell("live: frames a second", rate.toFixed(1), `> 20, <= ${MOST_FRAMES_S}`, rate > 20 && rate <= MOST_FRAMES_S);
for (const { page, size } of opened) {
  await page.waitForTimeout(3000);
  await keep(page, folder, `live-${size}`);
  await inOrder(page, `live, ${size}`, size === "phone");
  await page.locator("#play").click();
  await operateAll(page, `live, ${size}`);
  await page.locator("#live").click({ force: true });
  await goesOn(page);
}
const away = await fetch(new URL("/", address));
tell("live: the answer to who does not know the address", away.status, "404", away.status === 404);
tell("live: errors and warnings on the console", opened.flatMap((it) => it.errors).join("; ") || "none", "no line", opened.every((it) => it.errors.length === 0));
console.log("watching");
const seen = [];
for (const name of ["controller", "planner-daemon"]) {
  await state(opened[0].page, `${name}: not there`);
  seen.push(name);
}
await keep(opened[0].page, folder, "live-away");
for (const { page } of opened) {
  await page.waitForFunction(() => !document.getElementById("state").textContent.includes("not there"), null, { timeout: PATIENCE_MS });
  await goesOn(page);
}
tell("live: seen on the page to go, and to come back", seen.join(", "), "controller, planner-daemon", seen.length === 2);
await browser.close();
