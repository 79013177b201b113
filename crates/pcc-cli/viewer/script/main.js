// The page that `pcc view` writes or serves. The address may say what is shown first: #time=1.5&motions=all
import { listen } from "./live.js";
import { Viewer, element } from "./viewer.js";

function ready(viewer) {
  window.pccView = Object.freeze({ shown: () => viewer.shown() });
  const wanted = new URLSearchParams(location.hash.slice(1));
  if (wanted.get("motions") === "all") viewer.switchAll(true);
  if (wanted.has("time")) viewer.goTo(Math.min(Math.max(Number(wanted.get("time")) || 0, 0), viewer.span.until_s));
  requestAnimationFrame(() => requestAnimationFrame(() => {
    document.body.dataset.ready = "true";
  }));
}

const view = JSON.parse(element("data").textContent);
try {
  if (view) ready(new Viewer(view)); else listen(ready);
} catch (error) {
  element("state").textContent = `This browser cannot draw the picture: ${error.message}`;
  throw error;
}
