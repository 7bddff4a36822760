// Who is where, how surely, and the ways they came, drawn as one picture: two hundred people who move
// ten times a second leave no time for features of their own.
/* global ol */
import { stroke, TrailPicture } from "./trail_picture.js";
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
const REGION_TURN_RAD = Math.PI / 90;
const REGION_LINE = 1.5;

export class CrowdLayer extends ol.layer.Layer {
  #model;
  #canvas = document.createElement("canvas");
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
    this.#element.append(this.#canvas);
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
    this.#paint(frame.time, frame.viewHints.some((hint) => hint > 0));
    return this.#element;
  }

  /** Draw people where they are now; the map around them stands as it is. */
  redraw() {
    if (this.#view === null) this.changed();
    else this.#paint(Date.now(), false);
  }

  #paint(now_ms, moved) {
    const view = this.#view;
    const [width, height] = [Math.round(view.width * view.ratio), Math.round(view.height * view.ratio)];
    if (this.#canvas.width !== width || this.#canvas.height !== height) Object.assign(this.#canvas, { width, height });
    this.#trails.show(view, now_ms, moved);
    const pen = this.#canvas.getContext("2d");
    pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    pen.clearRect(0, 0, view.width, view.height);
    const alerts = this.#model.openAlerts();
    this.#alerted = new Set(alerts.map((alert) => alert.node_id));
    this.#grave = new Map(alerts.filter((alert) => GRAVE.has(alert.kind)).reverse().map((alert) => [alert.node_id, alert]));
    const people = [...this.#model.tracks.values()].map((track) => this.#placed(track, view));
    this.drawn = new Map(people.map(({ track }) => [track.responder_id, [track.east_m, track.north_m]]));
    const seen = people.filter(({ x, y }) => x > -MARGIN && y > -MARGIN && x < view.width + MARGIN && y < view.height + MARGIN);
    this.#drawRegions(pen, people, view);
    this.#drawTails(pen, seen, view);
    this.#drawRings(pen, seen);
    for (const person of seen) this.#drawPerson(pen, person, view.ratio);
    this.#drawLabels(pen, seen, view.ratio);
    this.dispatchEvent("drawn");
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
        const { picture, reach } = this.#region(axes.map(Math.round), Math.round(turn / REGION_TURN_RAD), look, view.ratio);
        pen.drawImage(picture, x - reach, y - reach, 2 * reach, 2 * reach);
      } else {
        pen.beginPath();
        pen.ellipse(x, y, ...axes, turn, 0, 2 * Math.PI);
        paintRegion(pen, look);
      }
    }
  }

  /** A small ellipse as a picture, to half a pixel: two hundred paths take most of a frame's time. */
  #region(axes, turn, look, ratio) {
    const name = `${axes} ${turn} ${look.colour} ${look.faint} ${look.dash} ${ratio}`;
    const known = this.#regions.get(name);
    if (known) return known;
    const reach = axes[0] + 2;
    const picture = Object.assign(document.createElement("canvas"), { width: 2 * reach * ratio, height: 2 * reach * ratio });
    const pen = picture.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, reach * ratio, reach * ratio);
    pen.beginPath();
    pen.ellipse(0, 0, ...axes, turn * REGION_TURN_RAD, 0, 2 * Math.PI);
    paintRegion(pen, look);
    if (this.#regions.size >= MOST_REGIONS) this.#regions.clear();
    const made = { picture, reach };
    this.#regions.set(name, made);
    return made;
  }

  /** The last steps up to where somebody is. */
  #drawTails(pen, people, view) {
    pen.lineWidth = 3;
    pen.globalAlpha = TRAIL_ALPHA;
    for (const { track, status, x, y } of people) {
      const tail = this.#trails.tail(track.responder_id).map(([north, east]) => view.at(north, east));
      if (status !== "lost") tail.push([x, y]);
      if (tail.length > 1) stroke(pen, tail, this.#lookOfTrail(track.responder_id).colour);
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
    const picture = Object.assign(document.createElement("canvas"), { width: 2 * REACH * ratio, height: 2 * REACH * ratio });
    const pen = picture.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, REACH * ratio, REACH * ratio);
    Object.assign(pen, { fillStyle: colour, strokeStyle: this.#colours.ground, lineWidth: 4, lineJoin: "round" });
    pen.beginPath();
    polygon(pen, 0, 0, RADIUS, SIDES[status] ?? 0, 0);
    if (turn !== null) {
      const heading = turn * TURN_RAD;
      polygon(pen, 17 * Math.sin(heading), -17 * Math.cos(heading), 7, 3, heading);
    }
    pen.stroke();
    pen.fill();
    return picture;
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
    const picture = document.createElement("canvas");
    const pen = picture.getContext("2d");
    pen.font = FONT;
    const [wide, high] = [Math.ceil(pen.measureText(text).width) + 6, 24];
    Object.assign(picture, { width: wide * ratio, height: high * ratio });
    pen.scale(ratio, ratio);
    Object.assign(pen, { font: FONT, textBaseline: "middle", lineWidth: 4, lineJoin: "round",
      strokeStyle: this.#colours.ground, fillStyle: this.#colours.ink });
    pen.strokeText(text, 3, high / 2);
    pen.fillText(text, 3, high / 2);
    const label = { picture, wide, high, ratio };
    this.#labels.set(text, label);
    return label;
  }
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
