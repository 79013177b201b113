// A page that is served: what is told while it happens is added, and what is old is let go of.
import { Viewer, element } from "./viewer.js";
import { floats } from "./samples.js";

// Time that the page has behind it.
const KEPT_S = 60;

class LiveViewer extends Viewer {
  constructor(view) {
    super(view, (text) => Array.from(floats(text)));
    this.letGoOf = -Infinity;
    element("live").hidden = false;
    element("live").addEventListener("click", () => this.follow());
    this.follow();
  }

  // The whole state once more, as after a connection that was lost: it takes the place of all that was told before.
  begin(view) {
    this.take(view);
    this.letGoOf = -Infinity;
    Object.assign(this.span, { from_s: 0, until_s: 0 });
    this.legend();
    this.show();
  }

  follow() {
    this.isPlaying = false;
    this.follows = true;
    this.now = this.span.until_s;
    this.show();
  }

  show() {
    element("play").textContent = this.follows || this.isPlaying ? "Pause" : "Play";
    element("live").disabled = this.follows;
    this.draw();
  }

  play() {
    const plays = !this.follows && !this.isPlaying;
    this.follows = false;
    super.play(plays);
    this.show();
  }

  atEnd() {
    this.follow();
  }

  goTo(time) {
    this.follows = false;
    super.goTo(time);
    this.show();
  }

  // What is commanded and measured.
  frame({ time_s, configurations_rad, clearances, curves }) {
    const oldest = time_s - KEPT_S;
    this.motions.slice(0, configurations_rad.length).forEach((motion, index) => {
      motion.push(time_s, configurations_rad[index], clearances[index] ?? NaN, oldest);
    });
    this.curves.forEach((set, index) => {
      set.time.push(time_s);
      set.values.forEach((values, line) => values.push(curves[index][line] ?? NaN));
      if (set.time[0] < oldest - 10) [set.time, ...set.values].forEach((values) => values.splice(0, 500));
    });
    this.span.from_s = Math.max(oldest, this.curves[0].time[0]);
    this.span.until_s = time_s;
    this.now = this.follows ? time_s : Math.max(this.now, this.span.from_s);
    this.letGo(oldest);
    this.changed();
  }

  // The balls of a source: they take the place of those that it told of before.
  scene({ source, balls, time_s }) {
    const { tracks } = this.obstacles;
    for (const track of tracks) if (track.source === source) track.until_s = Math.min(track.until_s, time_s);
    this.obstacles.tracks = tracks.concat(balls.map((ball) => ({ ...ball, source })));
    this.letGo(time_s - KEPT_S);
    this.changed();
  }

  // A motion that was published.
  motion({ begins_s, motion }) {
    this.marks = this.marks.concat([{ time_s: begins_s }]);
    this.addMotion(motion, true);
    this.legend();
    this.changed();
  }

  // What was over at a time; once a second.
  letGo(oldest) {
    if (oldest < this.letGoOf + 1) return;
    this.letGoOf = oldest;
    for (const motion of this.motions.slice(2)) if (motion.time.at(-1) < oldest) this.removeMotion(motion);
    this.marks = this.marks.filter((mark) => mark.time_s >= oldest);
    this.obstacles.tracks = this.obstacles.tracks.filter((track) => track.until_s >= oldest);
  }

  // A page that is paused rests: what is told meanwhile is drawn when it is operated, or goes on.
  changed() {
    if (this.follows) this.draw();
  }

  shown() {
    return { ...super.shown(), follows: this.follows, isPlaying: this.isPlaying };
  }
}

export function listen(ready) {
  const source = new EventSource("live");
  let viewer = null, shown = "";
  const on = (name, act) => source.addEventListener(name, (event) => act(JSON.parse(event.data), event.data));
  on("view", (view, text) => {
    if (viewer && text !== shown) return location.reload();
    shown = text;
    // The server tells it first of all on each connection.
    if (viewer) return viewer.begin(view);
    viewer = new LiveViewer(view);
    ready(viewer);
  });
  for (const name of ["frame", "scene", "motion"]) on(name, (told) => viewer?.[name](told));
  on("status", ({ lines }) => element("state").replaceChildren(...lines.map((line) => Object.assign(document.createElement("span"), { textContent: line }))));
  source.addEventListener("error", () => {
    const isOver = source.readyState === EventSource.CLOSED;
    element("state").textContent = isOver ? "pcc view --live has begun anew: open the address that it says" : "pcc view --live does not answer; waiting for it";
  });
}
