// Every control of the page that `pcc view --live` serves, operated while the page is paused: what a control sets is read from what the
// page says that its newest picture shows, since a live picture moves by itself.
import { operateEach, redrawn } from "./driver.mjs";
import { comeNearer, press, pressAt, setTime, timesOf, turn } from "./gestures.mjs";

// Longest wait for what an operation is for, ms.
const WAIT_MS = 8000;
// Time that a page has to show before its speeds are looked at, s, and the longest wait for it, ms.
const ENOUGH_S = 15;
const ENOUGH_MS = 30000;
// Error of a place that is pressed on a bar, and of a speed, as a share.
const PLACE = 0.1;
const SPEED = 0.1;

export const shown = (page) => page.evaluate(() => window.pccView.shown());

// Waits until the page shows what is wanted.
export async function until(page, wrong, holds, ms = WAIT_MS) {
  const end = performance.now() + ms;
  for (;;) {
    const now = await shown(page);
    if (holds(now)) return now;
    if (performance.now() > end) throw new Error(`${wrong} within ${ms / 1000} s`);
    await page.waitForTimeout(50);
  }
}

// Does something, and waits for a newer picture that shows what is wanted.
async function leads(page, act, wrong, holds) {
  // What was changed before has its own picture.
  await redrawn(page);
  const before = await shown(page);
  await act();
  return until(page, wrong, (now) => now.pictures > before.pictures && holds(now, before));
}

const isPaused = (now) => !now.follows && !now.isPlaying;

export async function pause(page) {
  if (!isPaused(await shown(page))) await press(page, "#play");
  await until(page, "is not paused", isPaused);
  await redrawn(page);
  return shown(page);
}

const count = (now, part) => now.motions.filter((motion) => motion[part]).length;
const LAYERS = {
  Obstacles: (now) => now.obstacles,
  Bodies: (now) => count(now, "body"),
  "Tip paths": (now) => count(now, "tipPath"),
  Ground: (now) => Number(now.ground),
};

// Where the camera is as seen from the robot, a unit vector in the base frame.
function direction({ camera }) {
  const distance = Math.hypot(...camera);
  return camera.map((it) => it / distance);
}
const VIEWS = {
  Front: ([x, y, z]) => x > 0.1 && y < -0.1 && z > 0.1,
  Side: ([, y]) => y < -0.99,
  Top: ([, , z]) => z > 0.99,
};

const isAt = (now, share) => Math.abs((now.now_s - now.from_s) / (now.until_s - now.from_s) - share) < PLACE;

// How many seconds of motion are played in one.
async function rate(page, speed) {
  await page.locator("#speed").selectOption(speed);
  await setTime(page, { share: 0.1 });
  // Both of one picture: the page asks for its next one before this does.
  const read = (drawn) => requestAnimationFrame((stamp) => drawn([1e-3 * stamp, window.pccView.shown().now_s]));
  const clock = () => page.evaluate(`new Promise(${read})`);
  await leads(page, () => press(page, "#play"), "does not begin to play", (now) => now.isPlaying);
  const [begun, from] = await clock();
  await page.waitForTimeout(1000);
  const [ended, to] = await clock();
  await pause(page);
  return (to - from) / (ended - begun);
}

// By the part of the page, the id or the kind of a control: operates it; throws what is wrong.
const OPERATE = {
  async layers(page, { control, name }) {
    const hasAll = (now, but) => Object.entries(LAYERS).every(([layer, of]) => (of(now) > 0) === (layer !== but));
    await setTime(page, { share: 0.5 });
    await leads(page, () => press(page, "#all"), "is shown with other layers, not all of which are there", (now) => hasAll(now));
    await leads(page, () => control.click(), "does not go, or not alone, when it is switched off", (now) => hasAll(now, name));
    await leads(page, () => control.click(), "does not come back when it is switched on", (now) => hasAll(now));
  },
  async motions(page, { control, name }) {
    const of = (now) => now.motions.find((motion) => motion.name === name) ?? {};
    const times = timesOf(name);
    await setTime(page, times ? { at: times[0] + 0.05 } : { share: 0.5 });
    const isNone = (now) => !of(now).tipPath && !of(now).body;
    const { now_s } = await leads(page, () => press(page, "#none"), "is there though all are switched off", isNone);
    const isThere = !times || (now_s >= times[0] && now_s <= times[1]);
    const isWhole = (now) => of(now).tipPath && of(now).body === isThere;
    await leads(page, () => control.click(), "is not there when it is switched on", isWhole);
    await leads(page, () => control.click(), "is there when it is switched off", isNone);
  },
  async all(page) {
    await press(page, "#none");
    const areOn = (now) => now.motions.length > 0 && now.motions.every((motion) => motion.tipPath);
    await leads(page, () => press(page, "#all"), "leaves motions off", areOn);
  },
  async none(page) {
    await press(page, "#all");
    // Those that come meanwhile are on.
    const areOff = (now, before) => before.motions.every(({ name }) => !now.motions.find((motion) => motion.name === name)?.tipPath);
    await leads(page, () => press(page, "#none"), "leaves motions on", areOff);
  },
  async views(page, { control, name }) {
    await page.getByRole("button", { name: name === "Top" ? "Side" : "Top", exact: true }).click();
    await leads(page, () => control.click(), `does not look from ${name}`, (now) => VIEWS[name](direction(now)));
  },
  async colour(page) {
    await press(page, "#all");
    await setTime(page, { share: 0.5 });
    for (const [colour, isOwn] of [["clearance", false], ["motion", true]]) {
      const isColoured = ({ motions }) => {
        const bodies = motions.filter((motion) => motion.body);
        return bodies.length > 0 && bodies.every((motion) => (motion.colour === motion.hue) === isOwn);
      };
      await leads(page, () => page.locator("#colour").selectOption(colour), `does not colour bodies by ${colour}`, isColoured);
    }
  },
  async play(page) {
    await page.locator("#speed").selectOption("1");
    await setTime(page, { share: 0.25 });
    const goesOn = (now, before) => now.isPlaying && now.now_s > before.now_s + 0.2;
    await leads(page, () => press(page, "#play"), "does not go on", goesOn);
    const still = await pause(page);
    const later = await until(page, "does not hear what happens while it is paused", (now) => now.until_s > still.until_s + 0.3);
    if (later.now_s !== still.now_s || later.pictures !== still.pictures) throw new Error("does not rest while it is paused");
  },
  async live(page) {
    await setTime(page, { share: 0.25 });
    const isNow = (now, before) => now.follows && now.now_s === now.until_s && now.now_s > before.until_s;
    const then = await leads(page, () => press(page, "#live"), "does not come to what is now", isNow);
    await until(page, "does not go on with what is now", (now) => isNow(now, then));
    await pause(page);
  },
  async speed(page) {
    await until(page, "has not enough to show", (now) => now.until_s - now.from_s > ENOUGH_S, ENOUGH_MS);
    for (const speed of ["0.1", "0.25", "1", "4"]) {
      const played = await rate(page, speed);
      if (!(Math.abs(played / speed - 1) < SPEED)) throw new Error(`plays ${played.toFixed(2)} s a second at ${speed}`);
    }
  },
  async time(page) {
    for (const share of [0.8, 0.3]) {
      await setTime(page, { share: 0.5 });
      await leads(page, () => pressAt(page, "#time", share), `does not go to ${share} of the time`, (now) => isAt(now, share));
    }
  },
  async curves(page) {
    const options = await page.locator("#curves option").allTextContents();
    if (options.length < 2) throw new Error("has nothing to choose");
    await page.locator("#curves").selectOption({ index: 0 });
    for (const [index, option] of [...options.entries()].reverse()) {
      const act = () => page.locator("#curves").selectOption({ index });
      await leads(page, act, `does not draw ${option}`, (now) => option.startsWith(`${now.curves}, `));
    }
  },
  async plot(page) {
    await setTime(page, { share: 0.9 });
    await leads(page, () => pressAt(page, "#plot", 0.5), "does not go where it is clicked", (now) => isAt(now, 0.5));
  },
  async scene(page) {
    const along = (now, before) => direction(now).reduce((sum, it, axis) => sum + it * direction(before)[axis], 0);
    await leads(page, () => turn(page), "is not turned", (now, before) => along(now, before) < Math.cos(0.05));
    const isNearer = (now, before) => Math.hypot(...now.camera) < 0.97 * Math.hypot(...before.camera);
    await leads(page, () => comeNearer(page), "does not come nearer", isNearer);
  },
};

async function operate(page, it) {
  const act = OPERATE[it.part] ?? OPERATE[it.id];
  if (!act) return "is not known to this test";
  await pause(page);
  return act(page, it);
}

export const operateLive = (page, title) => operateEach(page, title, operate);
