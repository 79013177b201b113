// node live.mjs FOLDER ADDRESS: pages of `pcc view --live`, several at a time; then says "watching", and sees controller and daemon go and
// come back.
import { SIZES, inOrder, keep, launch, open, step, tell } from "./driver.mjs";
import { operateLive, pause, shown, until } from "./live_controls.mjs";

const MOST_FRAMES_S = 50;
const FRAMES_S = 4;
const PATIENCE_MS = 90000;
const [folder, address] = process.argv.slice(2);

// What the server tells, event by event.
async function* events() {
  const stop = new AbortController();
  const response = await fetch(`${address}live`, { signal: stop.signal });
  const decoder = new TextDecoder();
  let rest = "";
  try {
    for await (const bytes of response.body) {
      const parts = (rest + decoder.decode(bytes, { stream: true })).split("\n\n");
      rest = parts.pop();
      yield* parts;
    }
  } finally {
    stop.abort();
  }
}

const isFrame = (event) => event.startsWith("event: frame\n");

// Frames that the server tells; a ball is there all the time.
async function checkFrames() {
  let begun = 0, count = 0, without = 0;
  for await (const event of events()) {
    if (!isFrame(event)) continue;
    begun ||= performance.now();
    count++;
    if (JSON.parse(event.split("data: ")[1]).clearances.includes(null)) without++;
    if (performance.now() > begun + 1000 * FRAMES_S) break;
  }
  // The time begins with the first one.
  const rate = (1000 * (count - 1)) / (performance.now() - begun);
  tell("live: frames a second", rate.toFixed(1), `> 20, <= ${MOST_FRAMES_S}`, rate > 20 && rate <= MOST_FRAMES_S);
  tell("live: frames without a clearance though a ball is there", without, `none of ${count}`, without === 0);
}

const goesOn = async (page) => {
  const before = await shown(page);
  await until(page, "does not go on", (now) => now.follows && now.now_s > before.until_s + 0.5, PATIENCE_MS);
};
const follow = async (page) => (await shown(page)).follows || page.locator("#live").click();
const isReady = (page) => page.waitForSelector("body[data-ready]", { timeout: PATIENCE_MS });
const says = (page, holds, text = "") => page.waitForFunction(holds, text, { timeout: PATIENCE_MS, polling: 200 });

// A page whose connection ends, as where the server lets go of it: it joins anew, and is told the whole state again.
async function checkConnection(browser) {
  const told = [];
  for await (const event of events()) {
    told.push(`${event}\n\n`);
    if (isFrame(event)) break;
  }
  let connections = 0;
  const first = { contentType: "text/event-stream", body: `retry: 200\n\n${told.join("")}` };
  const cut = (route) => (connections++ === 0 ? route.fulfill(first) : route.continue());
  const { page, context } = await open(browser, SIZES[0], address, (page) => page.route("**/live", cut));
  await isReady(page);
  await goesOn(page);
  const names = (await shown(page)).motions.map((motion) => motion.name);
  const twice = names.filter((name, index) => names.indexOf(name) !== index);
  tell("live: connections of a page whose first one ends", connections, "2", connections === 2);
  tell("live: motions that it then shows twice", twice.join(", ") || "none", `none of ${names.length}`, twice.length === 0 && names.length > 2);
  await context.close();
}

async function checkPage({ page, size }) {
  await follow(page);
  await page.waitForTimeout(3000);
  await keep(page, folder, `live-${size}`);
  await inOrder(page, `live, ${size}`, size === "phone");
  await operateLive(page, `live, ${size}`);
}

async function checkAway(opened) {
  const [{ page: first }] = opened;
  const seen = [];
  for (const name of ["controller", "planner-daemon"]) {
    await says(first, (wanted) => document.getElementById("state").textContent.includes(wanted), `${name}: not there`);
    seen.push(name);
  }
  await keep(first, folder, "live-away");
  for (const { page } of opened) {
    await says(page, () => !document.getElementById("state").textContent.includes("not there"));
    await follow(page);
    await goesOn(page);
  }
  tell("live: seen on the page to go, and to come back", seen.join(", "), "controller, planner-daemon", seen.length === 2);
}

const browser = await launch();
const opened = await step("live: pages that open", () => Promise.all(SIZES.map((size) => open(browser, size, address))));
for (const { page, size } of opened) {
  await step(`live, ${size}: what happens is shown`, async () => {
    await isReady(page);
    await goesOn(page);
  }, PATIENCE_MS);
}
tell("live: pages that show what happens at the same time", opened.length, ">= 2", opened.length >= 2);
// Several pictures that move are much for a machine without a graphics card.
for (const { page, size } of opened) await step(`live, ${size}: paused`, () => pause(page), PATIENCE_MS);
await step("live: frames", checkFrames, PATIENCE_MS);
await step("live: a connection that ends", () => checkConnection(browser), PATIENCE_MS);
for (const it of opened) await step(`live, ${it.size}: its checks`, () => checkPage(it));
const away = await fetch(new URL("/", address));
tell("live: the answer to who does not know the address", away.status, "404", away.status === 404);
console.log("watching");
await step("live: controller and daemon go and come back", () => checkAway(opened));
tell("live: errors and warnings on the console", opened.flatMap((it) => it.errors).join("; ") || "none", "no line", opened.every((it) => it.errors.length === 0));
await browser.close();
