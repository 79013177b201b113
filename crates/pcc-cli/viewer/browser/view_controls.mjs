// Every control of the page that `pcc view` writes, operated, and what it is for seen to happen in the picture.
import { look, operateEach } from "./driver.mjs";
import { comeNearer, press, pressAt, setTime, timesOf, turn } from "./gestures.mjs";

const text = (page, selector) => page.locator(selector).textContent();
// The time that is shown, s.
const now = async (page) => parseFloat(await text(page, "#now"));
const pause = (page, ms) => page.waitForTimeout(ms);

async function changes(page, selector, act) {
  const before = await look(page, selector);
  await act();
  return before !== (await look(page, selector));
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
    const differs = await changes(page, "#picture", () => press(page, "#none"));
    const on = await page.locator("#motions input:checked").count();
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
  async speed(page) {
    const [slow, slower, plain, fast] = [await played(page, "0.1"), await played(page, "0.25"), await played(page, "1"), await played(page, "4")];
    return slow < slower && slower < plain && plain < fast ? "" : `goes on by ${[slow, slower, plain, fast]} s`;
  },
  async time(page) {
    const before = await now(page);
    for (const share of [0.8, 0.3]) {
      const label = await text(page, "#now");
      const drawn = await changes(page, "#under", () => pressAt(page, "#time", share));
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
    const before = await now(page);
    await pressAt(page, "#plot", 0.5);
    return (await now(page)) < before ? "" : "does not go where it is clicked";
  },
  async scene(page) {
    if (!(await changes(page, "#picture", () => turn(page)))) return "is not turned";
    return (await changes(page, "#picture", () => comeNearer(page))) ? "" : "does not come nearer";
  },
};

// A time at which a motion's body is there: of one that names its begin, just after that.
function timeOf(name) {
  const times = timesOf(name);
  return times ? { at: times[0] + 0.05 } : { share: 0.5 };
}

async function operate(page, it) {
  const act = OPERATE[it.id] ?? (it.part === "views" ? OPERATE.view : OPERATE[it.type]);
  if (!act) return "is not known to this test";
  if (it.part === "layers") {
    // It needs something to show.
    await press(page, "#all");
    await page.getByRole("button", { name: "Top", exact: true }).click();
    await setTime(page, { share: 0.5 });
  }
  if (it.id === "colour") await press(page, "#all");
  return act(page, it, it.part === "motions");
}

export const operateAll = (page, title) => operateEach(page, title, operate);
