// Every control of the page that `pcc view` writes or serves, operated, and what it is for seen to happen.
import { controls, look, tell } from "./driver.mjs";

const text = (page, selector) => page.locator(selector).textContent();
// The time that is shown, s.
const now = async (page) => parseFloat(await text(page, "#now"));
const pause = (page, ms) => page.waitForTimeout(ms);

async function changes(page, selector, act) {
  const before = await look(page, selector);
  await act();
  return before !== (await look(page, selector));
}

async function press(page, selector) {
  await page.locator(selector).click();
}

// Goes to a share of the time that the page has, or to a time in s.
async function setTime(page, { share, at }) {
  await page.locator("#time").evaluate((bar, { share, at }) => {
    bar.value = at ?? Number(bar.min) + share * (bar.max - bar.min);
    bar.dispatchEvent(new Event("input", { bubbles: true }));
  }, { share, at });
}

// How far the time goes in a while at a speed.
async function played(page, speed) {
  await setTime(page, { share: 0.25 });
  await page.locator("#speed").selectOption(speed);
  const before = await now(page);
  await press(page, "#play");
  await pause(page, 1000);
  // It stops by itself where it comes to the end.
  await page.locator("#play").evaluate((button) => button.textContent === "Pause" && button.click());
  return (await now(page)) - before;
}

// By the id of a control, or the kind of one that has none: operates it, and returns what went wrong, if anything.
const OPERATE = {
  async checkbox(page, { control, name }, isMotion) {
    if (isMotion) await press(page, "#none");
    if (isMotion) await setTime(page, timeOf(name));
    for (const way of ["first", "again"]) {
      const before = await control.isChecked();
      const differs = await changes(page, "#picture", () => control.click());
      if ((await control.isChecked()) === before) return `is not switched the ${way} time`;
      if (!differs) return `changes nothing when it is switched ${before ? "off" : "on"}`;
    }
  },
  async all(page) {
    await press(page, "#none");
    const differs = await changes(page, "#picture", () => press(page, "#all"));
    const off = await page.locator("#motions input:not(:checked)").count();
    return differs && off === 0 ? "" : `leaves ${off} motions off`;
  },
  async none(page) {
    await press(page, "#all");
    const count = await page.locator("#motions li").count();
    const differs = await changes(page, "#picture", () => press(page, "#none"));
    // Those that have come since are on.
    const on = await page.locator(`#motions li:nth-child(-n+${count}) input:checked`).count();
    return differs && on === 0 ? "" : `leaves ${on} motions on`;
  },
  async view(page, { control, name }) {
    await page.getByRole("button", { name: name === "Top" ? "Side" : "Top", exact: true }).click();
    return (await changes(page, "#picture", () => control.click())) ? "" : "changes nothing";
  },
  async colour(page) {
    for (const colour of ["clearance", "motion"]) {
      const differs = await changes(page, "#picture", () => page.locator("#colour").selectOption(colour));
      if (!differs) return `changes nothing at ${colour}`;
    }
  },
  async play(page) {
    const went = await played(page, "1");
    const stays = await now(page);
    await pause(page, 300);
    return went > 0.2 && stays === (await now(page)) ? "" : `went on by ${went} s, and then from ${stays} to ${await now(page)} s`;
  },
  async live(page) {
    await setTime(page, { share: 0.25 });
    const before = await now(page);
    await press(page, "#live");
    await pause(page, 500);
    const after = await now(page);
    await pause(page, 500);
    const later = await now(page);
    await press(page, "#play");
    return before < after && after < later ? "" : `is at ${before}, ${after} and ${later} s`;
  },
  async speed(page) {
    const [slow, slower, plain, fast] = [await played(page, "0.1"), await played(page, "0.25"), await played(page, "1"), await played(page, "4")];
    return slow < slower && slower < plain && plain < fast ? "" : `goes on by ${[slow, slower, plain, fast]} s`;
  },
  async time(page) {
    const before = await now(page);
    const box = await page.locator("#time").boundingBox();
    for (const share of [0.8, 0.3]) {
      const label = await text(page, "#now");
      const drawn = await changes(page, "#under", () => page.mouse.click(box.x + share * box.width, box.y + box.height / 2));
      if (!drawn || (await text(page, "#now")) === label) return `shows nothing else at ${share} of it`;
    }
    return (await now(page)) === before ? "ends where it began" : "";
  },
  async curves(page) {
    const options = await page.locator("#curves option").count();
    await page.locator("#curves").selectOption({ index: 0 });
    for (let index = options - 1; index >= 0 && options > 1; index--) {
      const differs = await changes(page, "#plot", () => page.locator("#curves").selectOption({ index }));
      if (!differs) return `draws nothing else at its entry ${index}`;
    }
  },
  async plot(page) {
    await setTime(page, { share: 0.9 });
    const box = await page.locator("#plot").boundingBox();
    const before = await now(page);
    await page.locator("#plot").click({ position: { x: box.width / 2, y: box.height / 2 } });
    return (await now(page)) < before ? "" : "does not go where it is clicked";
  },
  async scene(page) {
    const box = await page.locator("#scene").boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const isTouched = await page.evaluate(() => "ontouchstart" in window);
    const turned = await changes(page, "#picture", () => (isTouched ? swipe(page, x, y) : drag(page, x, y)));
    if (!turned) return "is not turned";
    const nearer = await changes(page, "#picture", () => (isTouched ? pinch(page, x, y) : page.mouse.wheel(0, -300)));
    return nearer ? "" : "does not come nearer";
  },
};

async function drag(page, x, y) {
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 80, y + 20, { steps: 4 });
  await page.mouse.up();
}

async function touch(page, ...frames) {
  const protocol = await page.context().newCDPSession(page);
  for (const [index, touchPoints] of frames.entries()) {
    const type = touchPoints.length === 0 ? "touchEnd" : index === 0 ? "touchStart" : "touchMove";
    await protocol.send("Input.dispatchTouchEvent", { type, touchPoints });
  }
}

const swipe = (page, x, y) => touch(page, [{ x, y }], [{ x: x + 40, y: y + 10 }], [{ x: x + 80, y: y + 20 }], []);
const pinch = (page, x, y) => {
  const fingers = (apart) => [{ x: x - apart, y, id: 0 }, { x: x + apart, y, id: 1 }];
  return touch(page, fingers(30), fingers(50), fingers(70), []);
};

// A time at which a motion's body is there: of one that names its begin, just after that.
function timeOf(name) {
  const begin = name.match(/: (-?[\d.]+) to /);
  return begin ? { at: parseFloat(begin[1]) + 0.05 } : { share: 0.5 };
}

async function operate(page, it) {
  const isMotion = await it.control.evaluate((control) => control.closest("#motions") !== null);
  const isView = await it.control.evaluate((control) => control.closest("#views") !== null);
  const act = OPERATE[it.id] ?? (isView ? OPERATE.view : OPERATE[it.type]);
  if (!act) return "is not known to this test";
  return (await act(page, it, isMotion)) || "";
}

// Operates each; layers need something that they show.
export async function operateAll(page, title) {
  const all = await controls(page);
  const wrong = [];
  for (const it of all) {
    // Live, motions of the past go.
    if (!(await it.control.evaluate((control) => control.isConnected))) continue;
    const isLayer = await it.control.evaluate((control) => control.closest("#layers") !== null);
    if (isLayer) {
      await press(page, "#all");
      await page.getByRole("button", { name: "Top", exact: true }).click();
      await setTime(page, { share: 0.5 });
    }
    if (it.id === "colour") await press(page, "#all");
    const fault = await operate(page, it);
    if (fault) wrong.push(`${it.kind} ${it.id || it.name} ${fault}`);
  }
  tell(`${title}: controls that do not do what they are for`, wrong.join("; ") || "none", `none of ${all.length}`, wrong.length === 0 && all.length > 0);
}
