// The map: ways that were walked, who is where and how surely, access points. Metres, north is up.
/* global ol */
import { CrowdLayer } from "./crowd_layer.js";
import { PlanLayers } from "./plan_layer.js";
import { counted, inFeet, languageNow } from "./words.js";

const projection = new ol.proj.Projection({ code: "clew:local", units: "m" });

export class MapView {
  #model;
  #crowd;
  #way;
  #daps = new Map();
  #sites = null;
  #outside = null;
  #plan;
  #scale = new ol.control.ScaleLine({ minWidth: 80 });
  #styles = new Map();
  #floor = null;
  #followed = true;

  constructor(target, model) {
    this.#model = model;
    this.#crowd = new CrowdLayer(model);
    this.sources = { daps: new ol.source.Vector(), sites: new ol.source.Vector(), way: new ol.source.Vector(),
      outside: new ol.source.Vector() };
    this.#plan = new PlanLayers(projection, (down_m) => model.storeyAt(down_m));
    const layer = (source) => new ol.layer.Vector({ source, updateWhileInteracting: true,
      updateWhileAnimating: true, style: (feature) => this.#style(feature) });
    this.#way = layer(this.sources.way);
    this.map = new ol.Map({
      target,
      layers: [this.#plan.group, this.#crowd.ground, this.#way, layer(this.sources.sites),
        layer(this.sources.outside), layer(this.sources.daps), this.#crowd],
      view: new ol.View({ projection, center: [0, 0], resolution: 0.15, minResolution: 0.005,
        maxResolution: 50, enableRotation: false }),
      controls: [this.#scale],
    });
    this.map.on("pointerdrag", () => { this.#followed = false; });
    this.readUnits();
    this.readColours();
  }

  /** Say how long things are in the units that were chosen. */
  readUnits() {
    this.#scale.setUnits(inFeet() ? "us" : "metric");
  }

  readColours() {
    const styles = getComputedStyle(document.documentElement);
    const read = (name) => styles.getPropertyValue(`--${name}`).trim();
    this.colours = Object.fromEntries(["tracking", "dead_reckoning", "lost", "recovering", "ink",
      "faint", "accent", "ground", "alarm"].map((name) => [name, read(name)]));
    this.#styles.clear();
    this.#crowd.setColours(this.colours);
    this.#plan.setColour(this.colours.faint);
    this.map.getAllLayers().forEach((layer) => layer.changed());
  }

  /** Show one floor (its level) foremost, or all alike (`null`). */
  showFloor(level) {
    this.#floor = level;
    this.#crowd.setLevel(level);
    this.#plan.setLevel(level);
    this.map.getAllLayers().forEach((layer) => layer.changed());
  }

  fit() {
    const extent = ol.extent.extend(this.#crowd.extent(true), this.sources.daps.getExtent());
    ol.extent.extend(extent, this.#plan.extent());
    if (ol.extent.isEmpty(extent)) return;
    this.#followed = true;
    this.map.getView().fit(ol.extent.buffer(extent, 5), { padding: [30, 30, 50, 30], maxZoom: 28 });
  }

  centre(id) {
    const track = this.#model.tracks.get(id);
    if (!track) return;
    this.#followed = false;
    this.map.getView().setCenter([track.east_m, track.north_m]);
  }

  /** Call `picked` with the place (north, east) of the next click. */
  pick(picked) {
    this.map.once("singleclick", (event) => picked([event.coordinate[1], event.coordinate[0]]));
  }

  /** Draw a way (places of north, east, down), or none. */
  showWay(places) {
    this.sources.way.clear();
    this.#way.setVisible(Boolean(places));
    if (!places) return;
    const line = new ol.geom.LineString(places.map(([north, east]) => [east, north]));
    this.sources.way.addFeature(new ol.Feature({ kind: "way", geometry: line }));
  }

  /** Forget what stands where: what is drawn next is of another time. */
  clear() {
    this.sources.daps.clear();
    this.#daps.clear();
  }

  drawTracks() {
    if (this.#followed) this.#fitIfOutside();
    this.#crowd.redraw();
  }

  drawDaps() {
    this.#plan.setLevel(this.#floor);
    const here = new Set();
    for (const dap of this.#model.roster?.daps ?? []) {
      if (!dap.position) continue;
      here.add(dap.dap_id);
      let feature = this.#daps.get(dap.dap_id);
      if (!feature) {
        feature = new ol.Feature({ geometry: new ol.geom.Point([0, 0]) });
        this.#daps.set(dap.dap_id, feature);
        this.sources.daps.addFeature(feature);
      }
      const [east, north] = feature.getGeometry().getCoordinates();
      if (east !== dap.position.east_m || north !== dap.position.north_m) {
        feature.getGeometry().setCoordinates([dap.position.east_m, dap.position.north_m]);
      }
      const level = this.#model.floorOf(dap.position.down_m);
      // Whatever is set, even to what it was, has the whole map drawn anew.
      if (feature.get("status") !== dap.status || feature.get("level") !== level) {
        feature.setProperties({ kind: "dap", id: dap.dap_id, status: dap.status, level });
      }
    }
    for (const [id, feature] of this.#daps) {
      if (!here.has(id)) { this.sources.daps.removeFeature(feature); this.#daps.delete(id); }
    }
  }

  showPlan(plan) {
    this.#plan.set(plan);
    this.#plan.setLevel(this.#floor);
  }

  /** What people of other systems have put on the map. */
  drawOutside() {
    if (this.#outside === this.#model.outside) return;
    this.#outside = this.#model.outside;
    this.sources.outside.clear();
    this.sources.outside.addFeatures(this.#outside.map((word) => new ol.Feature({ kind: "outside",
      status: word.kind === "mayday" ? "lost" : "", level: this.#model.floorOf(word.position.down_m),
      id: [word.callsign, word.words].filter(Boolean).join(": "),
      geometry: new ol.geom.Point([word.position.east_m, word.position.north_m]) })));
  }

  /** Where a further DAP would tell most. */
  drawSites() {
    const sites = JSON.stringify([this.#model.sites, languageNow()]);
    if (this.#sites === sites) return;
    this.#sites = sites;
    this.sources.sites.clear();
    this.sources.sites.addFeatures(this.#model.sites.map((site) => new ol.Feature({ kind: "site",
      id: `+${counted("bits", { n: site.gain_bits })}`, level: this.#model.floorOf(site.down_m),
      geometry: new ol.geom.Point([site.east_m, site.north_m]) })));
  }

  #fitIfOutside() {
    const view = this.map.getView().calculateExtent(this.map.getSize());
    const people = this.#crowd.extent(false);
    if (!ol.extent.isEmpty(people) && !ol.extent.containsExtent(view, people)) this.fit();
  }

  #style(feature) {
    const { kind, status, level, id } = feature.getProperties();
    const faint = this.#floor !== null && level !== this.#floor;
    const name = `${kind} ${status} ${faint} ${id}`;
    if (!this.#styles.has(name)) this.#styles.set(name, this.#makeStyle(kind, status, faint, id));
    return this.#styles.get(name);
  }

  #makeStyle(kind, status, faint, id) {
    if (kind === "way") {
      return new ol.style.Style({ stroke: new ol.style.Stroke({ color: this.colours.accent, width: 6, lineDash: [14, 8] }) });
    }
    const text = new ol.style.Text({ text: id, offsetY: 16, font: "13px system-ui, sans-serif",
      fill: new ol.style.Fill({ color: withAlpha(this.colours.ink, faint ? 0.35 : 1) }),
      stroke: new ol.style.Stroke({ color: this.colours.ground, width: 4 }) });
    const colour = withAlpha(status === "lost" ? this.colours.lost : this.colours.accent, faint ? 0.3 : 1);
    if (kind === "site") {
      return new ol.style.Style({ text, image: new ol.style.RegularShape({ points: 4, radius: 9, angle: Math.PI / 4,
        stroke: new ol.style.Stroke({ color: colour, width: 2, lineDash: [4, 3] }) }) });
    }
    if (kind === "outside") {
      return new ol.style.Style({ text, image: new ol.style.RegularShape({ points: 3, radius: 9,
        fill: new ol.style.Fill({ color: this.colours.ground }), stroke: new ol.style.Stroke({ color: colour, width: 2.5 }) }) });
    }
    return new ol.style.Style({ text, image: new ol.style.RegularShape({ points: 4, radius: 8, angle: Math.PI / 4,
      fill: new ol.style.Fill({ color: status === "lost" ? this.colours.ground : colour }),
      stroke: new ol.style.Stroke({ color: colour, width: 2.5 }) }) });
  }
}

function withAlpha(colour, alpha) {
  const [r, g, b, a = 1] = ol.color.asArray(colour);
  return [r, g, b, a * alpha];
}
