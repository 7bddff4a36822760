// The ways behind people as a picture of its own: it is drawn anew when it is seen otherwise, and
// else only lengthened now and then; what came since is drawn with who came.
/* global ol */
const AGAIN_MS = 10_000;
const LENGTHEN_MS = 1_000;
const STRAIGHT = 0.75;
const WIDE = 3;

export class TrailPicture {
  #model;
  #view = null;
  #drawn_ms = 0;
  #lengthened_ms = 0;
  #ends = new Map();
  #look = null;
  #trails = null;

  /** `look(id)` says how a way is to look: `{ faint, colour }`. */
  constructor(model, look) {
    this.#model = model;
    this.#look = look;
    this.canvas = document.createElement("canvas");
  }

  /** Draw it anew when it is shown next. */
  forget() {
    this.#view = null;
  }

  /** Show the ways as they are seen now; while the map is `moved` by hand, as a picture that moves. */
  show(view, now_ms, moved) {
    const same = this.#view?.key === view.key && this.#trails === this.#model.trails
      && now_ms - this.#drawn_ms < AGAIN_MS;
    if (!same && (!moved || this.#view === null)) this.#draw(view, now_ms);
    else if (same && now_ms - this.#lengthened_ms >= LENGTHEN_MS) this.#lengthen(view, now_ms);
    const scale = this.#view.resolution / view.resolution;
    const [x, y] = view.at(...this.#view.corner);
    const stands = scale === 1 && Math.abs(x) < 1e-6 && Math.abs(y) < 1e-6;
    const placing = stands ? "" : `translate(${x}px, ${y}px) scale(${scale})`;
    if (this.canvas.style.transform !== placing) this.canvas.style.transform = placing;
  }

  /** The end of somebody's way that is not in the picture yet, from where that ends. */
  tail(id) {
    const trail = this.#model.trails.get(id) ?? [];
    return trail.slice(Math.max(trail.lastIndexOf(this.#ends.get(id)), 0));
  }

  #draw(view, now_ms) {
    const [width, height] = [Math.round(view.width * view.ratio), Math.round(view.height * view.ratio)];
    Object.assign(this.canvas, { width, height });
    this.#view = view;
    this.#drawn_ms = this.#lengthened_ms = now_ms;
    this.#ends.clear();
    this.#trails = this.#model.trails;
    const looks = [...this.#model.trails].filter(([, trail]) => trail.length)
      .map(([id, trail]) => ({ id, trail, ...this.#look(id) }));
    const pen = this.#pen(view);
    for (const { id, trail, colour } of looks.sort((one, other) => Number(other.faint) - Number(one.faint))) {
      this.#ends.set(id, trail.at(-1));
      stroke(pen, straightened(trail.map(([north, east]) => view.at(north, east))), colour);
    }
  }

  #lengthen(view, now_ms) {
    const pen = this.#pen(view);
    this.#lengthened_ms = now_ms;
    for (const id of this.#model.trails.keys()) {
      const tail = this.tail(id);
      if (tail.length < 2) continue;
      this.#ends.set(id, tail.at(-1));
      stroke(pen, tail.map(([north, east]) => view.at(north, east)), this.#look(id).colour);
    }
  }

  #pen(view) {
    const pen = this.canvas.getContext("2d");
    pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    return Object.assign(pen, { lineWidth: WIDE, lineJoin: "round" });
  }
}

function stroke(pen, places, colour) {
  pen.strokeStyle = colour;
  pen.beginPath();
  places.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.stroke();
}

/** A line without the places that lie on its way (Reumann and Witkam's strips), to less than a pixel. */
function straightened(places) {
  const kept = places.slice(0, 1);
  let strip = null;
  for (let index = 1; index < places.length; index += 1) {
    const [x0, y0] = kept.at(-1);
    const [dx, dy] = [places[index][0] - x0, places[index][1] - y0];
    if (strip === null) {
      const long = Math.hypot(dx, dy);
      if (long >= 1) strip = [dx / long, dy / long];
    } else if (Math.abs(dx * strip[1] - dy * strip[0]) > STRAIGHT || dx * strip[0] + dy * strip[1] < 0) {
      kept.push(places[index - 1]);
      strip = null;
      index -= 1;
    }
  }
  if (places.length > 1) kept.push(places.at(-1));
  return kept;
}
