// Who is where, how surely, and the ways they came, drawn as one picture: two hundred people who move
// ten times a second leave no time for features of their own.
/* global ol */
import { TrailPicture } from "./trail_picture.js";
import { word } from "./words.js";

const SIDES = { tracking: 0, dead_reckoning: 4, recovering: 3, lost: 4 };
const WIDEST_M = 800;
const RADIUS = 10;
const MARGIN = 60;
const HEADING_KNOWN_RAD = 0.6;
const TURN_RAD = Math.PI / 36;
const REACH = 28;
const TRAIL_ALPHA = 0.55;
const FONT = "600 16px system-ui, sans-serif";
const GRAVE = new Set(["mayday", "fall", "motionless", "low_air"]);
const RING = 24;
const MOST_PICTURED = 64;
const MOST_REGIONS = 1000;
const REGION_STEP = 0.1;
const REGION_TURN_RAD = Math.PI / 30;
const REGION_LINE = 1.5;

export class CrowdLayer extends ol.layer.Layer {
  #model;
  #canvas = document.createElement("canvas");
  #beneath = document.createElement("canvas");
  #beneathDue = 0;
  #element = document.createElement("div");
  #trails;
  #view = null;
  #symbols = new Map();
  #regions = new Map();
  #labels = new Map();
  #labelled = new Set();
  #alerted = new Set();
  #grave = new Map();
  #level = null;
  #colours = {};

  constructor(model) {
    super({});
    this.#model = model;
    this.#trails = new TrailPicture(model, (id) => this.#lookOfTrail(id));
    this.#trails.canvas.className = "trails";
    this.#element.className = "crowd";
    this.#element.append(this.#beneath, this.#canvas);
    const ground = Object.assign(document.createElement("div"), { className: "crowd" });
    ground.append(this.#trails.canvas);
    this.ground = new ol.layer.Layer({ render: () => ground });
  }

  /** A layer for the ways they came, to lie under whatever people are to stand upon. */
  ground;

  /** Where everybody stands in the picture (east, north), by id; it fires `drawn` when that is new. */
  drawn = new Map();

  /** Draw in these colours from now on. */
  setColours(colours) {
    this.#colours = colours;
    this.#labels.clear();
    this.#symbols.clear();
    this.#regions.clear();
    this.#trails.forget();
    this.changed();
  }

  /** Draw one floor (its level) foremost, or all alike (`null`). */
  setLevel(level) {
    this.#level = level;
    this.#trails.forget();
    this.changed();
  }

  /** The extent of everybody, and of the ways they came if `ways`. */
  extent(ways) {
    const extent = ol.extent.createEmpty();
    for (const track of this.#model.tracks.values()) ol.extent.extendCoordinate(extent, [track.east_m, track.north_m]);
    for (const trail of ways ? this.#model.trails.values() : []) {
      for (const [north, east] of trail) ol.extent.extendCoordinate(extent, [east, north]);
    }
    return extent;
  }

  render(frame) {
    this.#view = viewOf(frame);
    this.#paint();
    this.#paintBeneath(frame.time, frame.viewHints.some((hint) => hint > 0));
    return this.#element;
  }

  /** Draw people where they are now, and in the next frame what lies beneath them: neither frame has time for both. */
  redraw() {
    if (this.#view === null) { this.changed(); return; }
    this.#paint();
    if (!this.#beneathDue) this.#beneathDue = requestAnimationFrame(() => this.#paintBeneath(Date.now(), false));
  }

  #paint() {
    const view = this.#view;
    const pen = cleared(this.#canvas, view);
    const alerts = this.#model.openAlerts();
    this.#alerted = new Set(alerts.map((alert) => alert.node_id));
    this.#grave = new Map(alerts.filter((alert) => GRAVE.has(alert.kind)).reverse().map((alert) => [alert.node_id, alert]));
    const people = this.#placedIn(view);
    this.drawn = new Map(people.map(({ track }) => [track.responder_id, [track.east_m, track.north_m]]));
    const seen = people.filter((person) => isSeen(person, view));
    this.#drawRings(pen, seen);
    for (const person of seen) this.#drawPerson(pen, person, view.ratio);
    this.#drawLabels(pen, seen, view.ratio);
    this.dispatchEvent("drawn");
  }

  /** Draw the ways people came, and the regions that hold them. */
  #paintBeneath(now_ms, moved) {
    cancelAnimationFrame(this.#beneathDue);
    this.#beneathDue = 0;
    const view = this.#view;
    this.#trails.show(view, now_ms, moved);
    const pen = cleared(this.#beneath, view);
    const people = this.#placedIn(view);
    this.#drawRegions(pen, people, view);
    this.#drawTails(pen, people.filter((person) => isSeen(person, view)), view);
  }

  #placedIn(view) {
    return [...this.#model.tracks.values()].map((track) => this.#placed(track, view));
  }

  #placed(track, view) {
    const [x, y] = view.at(track.north_m, track.east_m);
    const status = this.#model.statusOf(track);
    return { track, status, x, y, faint: this.#isFaint(track), colour: this.#colours[status] ?? this.#colours.accent };
  }

  #lookOfTrail(id) {
    const track = this.#model.tracks.get(id);
    const faint = Boolean(track) && this.#isFaint(track);
    const colour = (track && this.#colours[this.#model.statusOf(track)]) ?? this.#colours.accent;
    return { faint, colour: faint ? mixed(colour, this.#colours.ground, 0.2) : colour };
  }

  /** Nobody is faint who is in need, whatever floor is looked at. */
  #isFaint(track) {
    return !this.#grave.has(track.responder_id) && this.#level !== null && this.#model.floorOf(track.floor_down_m) !== this.#level;
  }

  #drawRegions(pen, people, view) {
    for (const { track, status, x, y, faint, colour } of people) {
      const look = { colour, faint, dash: status === "lost" ? [8, 6] : [] };
      if (track.regions_m.length) {
        pen.beginPath();
        for (const outline of track.regions_m) {
          outline.forEach(([north, east], index) => (index ? pen.lineTo : pen.moveTo).apply(pen, view.at(north, east)));
          pen.closePath();
        }
        paintRegion(pen, look);
        continue;
      }
      const axes = track.axes95_m.map((axis) => Math.min(axis, WIDEST_M) / view.resolution);
      const turn = track.bearing_rad - Math.PI / 2;
      if (x + axes[0] < 0 || y + axes[0] < 0 || x - axes[0] > view.width || y - axes[0] > view.height) continue;
      if (axes[0] <= MOST_PICTURED) {
        const [long, wide] = axes.map((axis) => Math.round(Math.log(Math.max(axis, 1)) / REGION_STEP));
        const { picture, reach } = this.#region(long, wide, long === wide ? 0 : Math.round(turn / REGION_TURN_RAD), look, view.ratio);
        pen.drawImage(picture, x - reach, y - reach, 2 * reach, 2 * reach);
      } else {
        pen.beginPath();
        pen.ellipse(x, y, ...axes, turn, 0, 2 * Math.PI);
        paintRegion(pen, look);
      }
    }
  }

  /** A small ellipse as a picture, to 5 % and 3°: two hundred paths take most of a frame's time. */
  #region(long, wide, turn, look, ratio) {
    const name = `${long} ${wide} ${turn} ${look.colour} ${look.faint} ${look.dash} ${ratio}`;
    const known = this.#regions.get(name);
    if (known) return known;
    const axes = [long, wide].map((steps) => Math.exp(steps * REGION_STEP));
    const reach = Math.ceil(axes[0]) + 2;
    const pen = penOf(2 * reach, 2 * reach, ratio);
    pen.translate(reach, reach);
    pen.beginPath();
    pen.ellipse(0, 0, ...axes, turn * REGION_TURN_RAD, 0, 2 * Math.PI);
    paintRegion(pen, look);
    if (this.#regions.size >= MOST_REGIONS) this.#regions.clear();
    const made = { picture: pen.canvas.transferToImageBitmap(), reach };
    this.#regions.set(name, made);
    return made;
  }

  /** The last steps up to where somebody is: those of a colour in one stroke. */
  #drawTails(pen, people, view) {
    const tails = new Map();
    for (const { track, status, x, y } of people) {
      const tail = this.#trails.tail(track.responder_id).map(([north, east]) => view.at(north, east));
      if (status !== "lost") tail.push([x, y]);
      if (tail.length < 2) continue;
      const { colour } = this.#lookOfTrail(track.responder_id);
      if (!tails.has(colour)) tails.set(colour, new Path2D());
      const path = tails.get(colour);
      tail.forEach(([tailX, tailY], index) => (index ? path.lineTo(tailX, tailY) : path.moveTo(tailX, tailY)));
    }
    Object.assign(pen, { lineWidth: 3, globalAlpha: TRAIL_ALPHA });
    for (const [colour, path] of tails) {
      pen.strokeStyle = colour;
      pen.stroke(path);
    }
    pen.globalAlpha = 1;
  }

  /** A ring round whoever is in need; a thinner one once somebody has acknowledged that. */
  #drawRings(pen, people) {
    pen.strokeStyle = this.#colours.alarm;
    for (const { track, x, y } of people) {
      const alert = this.#grave.get(track.responder_id);
      if (!alert) continue;
      pen.lineWidth = alert.stage === "raised" ? 6 : 3;
      pen.beginPath();
      pen.arc(x, y, RING, 0, 2 * Math.PI);
      pen.stroke();
    }
  }

  #drawPerson(pen, { track, status, x, y, faint, colour }, ratio) {
    const known = track.heading_sd_rad < HEADING_KNOWN_RAD && status !== "lost";
    const turn = known ? Math.round(track.heading_rad / TURN_RAD) : null;
    const name = `${status} ${colour} ${turn} ${ratio}`;
    if (!this.#symbols.has(name)) this.#symbols.set(name, this.#symbol(status, colour, turn, ratio));
    pen.globalAlpha = faint ? 0.25 : 1;
    pen.drawImage(this.#symbols.get(name), x - REACH, y - REACH, 2 * REACH, 2 * REACH);
    pen.globalAlpha = 1;
  }

  /** What stands for a person: its shape says what their track is worth, an arrow where they face. */
  #symbol(status, colour, turn, ratio) {
    const pen = penOf(2 * REACH, 2 * REACH, ratio);
    pen.translate(REACH, REACH);
    Object.assign(pen, { fillStyle: colour, strokeStyle: this.#colours.ground, lineWidth: 4, lineJoin: "round" });
    pen.beginPath();
    polygon(pen, 0, 0, RADIUS, SIDES[status] ?? 0, 0);
    if (turn !== null) {
      const heading = turn * TURN_RAD;
      polygon(pen, 17 * Math.sin(heading), -17 * Math.cos(heading), 7, 3, heading);
    }
    pen.stroke();
    pen.fill();
    return pen.canvas.transferToImageBitmap();
  }

  /** Write names: those of who is lost or alerted to first, and none over another. */
  #drawLabels(pen, people, ratio) {
    const rank = ({ track, status, faint }) => (faint ? 4 : 0)
      + (status === "lost" || this.#alerted.has(track.responder_id) ? 0 : this.#labelled.has(track.responder_id) ? 1 : 2);
    const taken = [];
    this.#labelled = new Set();
    for (const person of people.sort((one, other) => rank(one) - rank(other))) {
      const id = person.track.responder_id;
      const grave = this.#grave.get(id);
      const label = this.#label(grave ? `${id}: ${word(grave.kind)}` : id, ratio);
      const [left, top] = [person.x - label.wide / 2, person.y - (grave ? 40 : 30) - label.high / 2];
      const box = [left, top, left + label.wide, top + label.high];
      if (taken.some((other) => ol.extent.intersects(other, box))) continue;
      taken.push(box);
      this.#labelled.add(id);
      pen.globalAlpha = person.faint ? 0.35 : 1;
      pen.drawImage(label.picture, left, top, label.wide, label.high);
    }
    pen.globalAlpha = 1;
  }

  #label(text, ratio) {
    const known = this.#labels.get(text);
    if (known?.ratio === ratio) return known;
    const ruler = this.#canvas.getContext("2d");
    ruler.font = FONT;
    const [wide, high] = [Math.ceil(ruler.measureText(text).width) + 6, 24];
    const pen = penOf(wide, high, ratio);
    Object.assign(pen, { font: FONT, textBaseline: "middle", lineWidth: 4, lineJoin: "round",
      strokeStyle: this.#colours.ground, fillStyle: this.#colours.ink });
    pen.strokeText(text, 3, high / 2);
    pen.fillText(text, 3, high / 2);
    const label = { picture: pen.canvas.transferToImageBitmap(), wide, high, ratio };
    this.#labels.set(text, label);
    return label;
  }
}

/** A pen on a picture as large as the map, of which nothing is left. */
function cleared(canvas, view) {
  const [width, height] = [Math.round(view.width * view.ratio), Math.round(view.height * view.ratio)];
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const pen = canvas.getContext("2d");
  pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
  pen.clearRect(0, 0, view.width, view.height);
  return pen;
}

const isSeen = ({ x, y }, view) => x > -MARGIN && y > -MARGIN && x < view.width + MARGIN && y < view.height + MARGIN;

/** A pen for a picture of its own, so large in CSS pixels. */
function penOf(wide, high, ratio) {
  const pen = new OffscreenCanvas(Math.ceil(wide * ratio), Math.ceil(high * ratio)).getContext("2d");
  pen.scale(ratio, ratio);
  return pen;
}

/** How metres become places in the picture (CSS pixels), north up. */
function viewOf(frame) {
  const { center: [east, north], resolution } = frame.viewState;
  const [width, height] = frame.size;
  const [left, top] = [east - (width / 2) * resolution, north + (height / 2) * resolution];
  const ratio = frame.pixelRatio;
  return { width, height, ratio, resolution, corner: [top, left],
    key: [left, top, resolution, width, height, ratio].join(" "),
    at: (north_m, east_m) => [(east_m - left) / resolution, (top - north_m) / resolution] };
}

/** Fill and outline the path that a pen has drawn, as a region is. */
function paintRegion(pen, { colour, faint, dash }) {
  Object.assign(pen, { fillStyle: colour, strokeStyle: colour, lineWidth: REGION_LINE });
  pen.globalAlpha = faint ? 0.03 : 0.14;
  pen.fill();
  pen.globalAlpha = faint ? 0.25 : 1;
  pen.setLineDash(dash);
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

/** A shape round a place, a corner to where it turns; a circle without `sides`. */
function polygon(pen, x, y, radius, sides, turn) {
  pen.moveTo(x + radius * Math.sin(turn), y - radius * Math.cos(turn));
  if (!sides) pen.arc(x, y, radius, -Math.PI / 2, 1.5 * Math.PI);
  for (let corner = 1; corner < sides; corner += 1) {
    const angle = turn + (2 * Math.PI * corner) / sides;
    pen.lineTo(x + radius * Math.sin(angle), y - radius * Math.cos(angle));
  }
  pen.closePath();
}

function mixed(colour, ground, share) {
  const [a, b] = [ol.color.asArray(colour), ol.color.asArray(ground)];
  return `rgb(${[0, 1, 2].map((part) => Math.round(share * a[part] + (1 - share) * b[part])).join(" ")})`;
}
