// What a person does on the page of `pcc view`.

export async function press(page, selector) {
  await page.locator(selector).click();
}

// Goes to a share of the time that the page has, or to a time in s.
export async function setTime(page, { share, at }) {
  await page.locator("#time").evaluate((bar, { share, at }) => {
    bar.value = at ?? Number(bar.min) + share * (bar.max - bar.min);
    bar.dispatchEvent(new Event("input", { bubbles: true }));
  }, { share, at });
}

// Presses a place of an element, as shares of its width and height.
export async function pressAt(page, selector, x, y = 0.5) {
  const place = page.locator(selector);
  await place.scrollIntoViewIfNeeded();
  const box = await place.boundingBox();
  await page.mouse.click(box.x + x * box.width, box.y + y * box.height);
}

// Turns the picture by a drag, or by a finger.
export async function turn(page) {
  const { x, y, isTouched } = await middle(page);
  if (isTouched) return touch(page, [{ x, y }], [{ x: x + 40, y: y + 10 }], [{ x: x + 80, y: y + 20 }], []);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 80, y + 20, { steps: 4 });
  await page.mouse.up();
}

// Comes nearer by the wheel, or by two fingers.
export async function comeNearer(page) {
  const { x, y, isTouched } = await middle(page);
  const fingers = (apart) => [{ x: x - apart, y, id: 0 }, { x: x + apart, y, id: 1 }];
  if (isTouched) return touch(page, fingers(30), fingers(50), fingers(70), []);
  await page.mouse.move(x, y);
  await page.mouse.wheel(0, -300);
}

async function middle(page) {
  await page.locator("#scene").scrollIntoViewIfNeeded();
  const box = await page.locator("#scene").boundingBox();
  const isTouched = await page.evaluate(() => "ontouchstart" in window);
  return { x: box.x + box.width / 2, y: box.y + box.height / 2, isTouched };
}

async function touch(page, ...frames) {
  const protocol = await page.context().newCDPSession(page);
  for (const [index, touchPoints] of frames.entries()) {
    const type = touchPoints.length === 0 ? "touchEnd" : index === 0 ? "touchStart" : "touchMove";
    await protocol.send("Input.dispatchTouchEvent", { type, touchPoints });
  }
  await protocol.detach();
}

// The time from a motion's begin to its end by its name, s; none of one that does not name them.
export function timesOf(name) {
  const times = name.match(/: (-?[\d.]+) to (-?[\d.]+) s/);
  return times ? times.slice(1).map(parseFloat) : null;
}
