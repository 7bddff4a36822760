// A recording compared with what else could have been made of it: a second line, and how far it is off.
/* global ol */
import { told } from "./phrases.js";
import * as post from "./post.js";
import { length, word } from "./words.js";

const ASK_MS = 300;
const REST_S = 30;
const NS_PER_S = 1e9;
const $ = (id) => document.getElementById(id);

export class Comparison {
  #model;
  #view;
  #seek;
  #lines = null;
  #differences = {};
  #begin_ns;
  #source = new ol.source.Vector();

  /** `seek` goes to a moment, in seconds since `begin_ns`. */
  constructor(model, view, seek, begin_ns) {
    this.#model = model;
    this.#view = view;
    this.#seek = seek;
    this.#begin_ns = begin_ns;
    view.map.addLayer(new ol.layer.Vector({ source: this.#source, style: (feature) => this.#style(feature) }));
  }

  async begin() {
    const there = await post.comparison();
    $("compare").hidden = false;
    $("with-plan").parentElement.hidden = !there.plan;
    $("with-settings").parentElement.hidden = !there.settings;
    $("compare-go").onclick = () => this.#wish();
    if (there.wish !== null) this.#await();
  }

  /** Draw the other ways up to the moment that is shown, and say how far they are off there. */
  show() {
    if (this.#lines === null) return;
    this.#source.clear();
    const now = this.#model.roster?.now_ns ?? 0;
    for (const [id, line] of Object.entries(this.#lines)) {
      const past = line.times_s.findLastIndex((time_s) => time_s * NS_PER_S <= now);
      const places = line.places_m.slice(0, past + 1).map(([north, east]) => [east, north]);
      if (places.length > 1) this.#source.addFeature(new ol.Feature(new ol.geom.LineString(places)));
      const track = this.#model.tracks.get(id);
      const other = track ? placeAt(line, track.time_ns / NS_PER_S) : null;
      const off_m = other ? Math.hypot(track.north_m - other[0], track.east_m - other[1]) : null;
      if (other) this.#source.addFeature(new ol.Feature(new ol.geom.Point([other[1], other[0]])));
      const cell = document.querySelector(`#differences [data-of="${id}"]`);
      if (cell) cell.textContent = off_m === null ? "–" : length(off_m);
    }
  }

  /** Write everything anew, in other words or units. */
  write() {
    if (this.#lines === null) return;
    this.#drawTable();
    this.show();
  }

  async #wish() {
    const wish = { way: $("compare-way").value, plan: $("with-plan").checked, settings: $("with-settings").checked };
    try {
      await post.compare(wish);
      this.#await();
    } catch (error) {
      $("compare-state").textContent = `${word("refused")} ${told(error.message)}`;
    }
  }

  async #await() {
    const now = await post.comparison();
    $("compare-progress").hidden = now.is_done;
    $("compare-progress").value = now.share;
    $("compare-state").textContent = now.failed === null ? (now.is_done ? "" : word("comparing")) : told(now.failed);
    if (!now.is_done) { setTimeout(() => this.#await(), ASK_MS); return; }
    if (now.failed !== null) return;
    const result = await post.compared();
    this.#lines = result.lines;
    this.#differences = result.differences;
    this.#drawTable();
    this.show();
  }

  #drawTable() {
    const rows = Object.entries(this.#differences).map(([id, apart]) => {
      const row = document.createElement("tr");
      const cells = [id, "–", length(apart.median_m), length(apart.p95_m)].map((text) => {
        const cell = document.createElement("td");
        cell.textContent = text;
        return cell;
      });
      cells[1].dataset.of = id;
      const most = document.createElement("button");
      most.type = "button";
      most.textContent = length(apart.most_m);
      most.onclick = () => this.#seek(apart.most_s - this.#begin_ns / NS_PER_S);
      const last = document.createElement("td");
      last.append(most);
      row.append(...cells, last);
      return row;
    });
    $("differences").querySelector("tbody").replaceChildren(...rows);
    $("differences").hidden = false;
  }

  #style(feature) {
    const { ink: colour, ground } = this.#view.colours;
    if (feature.getGeometry().getType() === "Point") {
      return new ol.style.Style({ image: new ol.style.Circle({ radius: 6,
        fill: new ol.style.Fill({ color: ground }), stroke: new ol.style.Stroke({ color: colour, width: 2.5 }) }) });
    }
    return new ol.style.Style({ stroke: new ol.style.Stroke({ color: colour, width: 2, lineDash: [6, 5] }) });
  }
}

/** Where a line is at a time: straight between its moments, at rest shortly beyond its ends. */
function placeAt(line, time_s) {
  const after = line.times_s.findIndex((each) => each >= time_s);
  if (after < 0) return time_s - line.times_s.at(-1) < REST_S ? line.places_m.at(-1) : null;
  if (after === 0) return line.times_s[0] - time_s < REST_S ? line.places_m[0] : null;
  const [from, to] = [line.times_s[after - 1], line.times_s[after]];
  const share = (time_s - from) / (to - from);
  return line.places_m[after].map((value, axis) => value * share + line.places_m[after - 1][axis] * (1 - share));
}
