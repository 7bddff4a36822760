// The map: ways that were walked, who is where and how surely, access points. Metres, north is up.
/* global ol */
const ELLIPSE_POINTS = 36;
const SHAPES = { tracking: 24, dead_reckoning: 4, recovering: 3, lost: 4 };
const GROWS_WIDE_M = 80;

const projection = new ol.proj.Projection({ code: "clew:local", units: "m" });

export class MapView {
  #model;
  #features = new Map();
  #daps = new Map();
  #floor = null;
  #followed = true;

  constructor(target, model) {
    this.#model = model;
    this.sources = { trails: new ol.source.Vector(), regions: new ol.source.Vector(),
      people: new ol.source.Vector(), daps: new ol.source.Vector(), sites: new ol.source.Vector(),
      way: new ol.source.Vector() };
    const layer = (source) => new ol.layer.Vector({ source, updateWhileInteracting: true,
      updateWhileAnimating: true, style: (feature) => this.#style(feature) });
    this.map = new ol.Map({
      target,
      layers: ["trails", "regions", "way", "sites", "daps", "people"].map((name) => layer(this.sources[name])),
      view: new ol.View({ projection, center: [0, 0], resolution: 0.15, minResolution: 0.005,
        maxResolution: 50, enableRotation: false }),
      controls: [new ol.control.ScaleLine({ minWidth: 80 })],
    });
    this.map.on("pointerdrag", () => { this.#followed = false; });
    this.readColours();
  }

  readColours() {
    const styles = getComputedStyle(document.documentElement);
    const read = (name) => styles.getPropertyValue(`--${name}`).trim();
    this.colours = Object.fromEntries(["tracking", "dead_reckoning", "lost", "recovering", "ink",
      "faint", "accent", "ground"].map((name) => [name, read(name)]));
    this.map.getAllLayers().forEach((layer) => layer.changed());
  }

  /** Show one floor (its level) foremost, or all alike (`null`). */
  showFloor(level) {
    this.#floor = level;
    this.map.getAllLayers().forEach((layer) => layer.changed());
  }

  fit() {
    const extent = ol.extent.createEmpty();
    for (const name of ["trails", "people", "daps"]) {
      ol.extent.extend(extent, this.sources[name].getExtent());
    }
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

  /** Draw a way (places of north, east, down), or none. */
  showWay(places) {
    this.sources.way.clear();
    if (!places) return;
    const line = new ol.geom.LineString(places.map(([north, east]) => [east, north]));
    this.sources.way.addFeature(new ol.Feature({ kind: "way", geometry: line }));
  }

  /** Forget everybody: what is drawn next is of another time. */
  clear() {
    for (const name of ["trails", "regions", "people", "daps"]) this.sources[name].clear();
    this.#features.clear();
    this.#daps.clear();
  }

  drawTracks() {
    const touched = this.#model.takeTouched();
    for (const id of touched) if (this.#model.tracks.has(id)) this.#draw(this.#model.tracks.get(id));
    if (touched.size && this.#followed) this.#fitIfOutside();
  }

  drawDaps() {
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
      feature.getGeometry().setCoordinates([dap.position.east_m, dap.position.north_m]);
      feature.setProperties({ kind: "dap", id: dap.dap_id, status: dap.status,
        level: this.#model.floorOf(dap.position.down_m) });
    }
    for (const [id, feature] of this.#daps) {
      if (!here.has(id)) { this.sources.daps.removeFeature(feature); this.#daps.delete(id); }
    }
  }

  /** Where a further DAP would tell most. */
  drawSites() {
    this.sources.sites.clear();
    this.sources.sites.addFeatures(this.#model.sites.map((site) => new ol.Feature({ kind: "site",
      id: `+${site.gain_bits} bit`, level: this.#model.floorOf(site.down_m),
      geometry: new ol.geom.Point([site.east_m, site.north_m]) })));
  }

  #draw(track) {
    const made = this.#features.get(track.responder_id) ?? this.#make(track.responder_id);
    const level = this.#model.floorOf(track.floor_down_m);
    const at = [track.east_m, track.north_m];
    made.person.getGeometry().setCoordinates(at);
    made.region.getGeometry().setCoordinates(regionOf(track));
    const way = (this.#model.trails.get(track.responder_id) ?? []).map(([n, e]) => [e, n]);
    made.trail.getGeometry().setCoordinates(track.status === "lost" ? way : [...way, at]);
    for (const feature of Object.values(made)) {
      feature.setProperties({ status: track.status, level, heading: track.heading_rad,
        headingKnown: track.heading_sd_rad < 0.6 }, true);
      feature.changed();
    }
  }

  #make(id) {
    const made = {
      person: new ol.Feature({ kind: "person", id, geometry: new ol.geom.Point([0, 0]) }),
      region: new ol.Feature({ kind: "region", id, geometry: new ol.geom.MultiPolygon([]) }),
      trail: new ol.Feature({ kind: "trail", id, geometry: new ol.geom.LineString([]) }),
    };
    this.sources.people.addFeature(made.person);
    this.sources.regions.addFeature(made.region);
    this.sources.trails.addFeature(made.trail);
    this.#features.set(id, made);
    return made;
  }

  #fitIfOutside() {
    const view = this.map.getView().calculateExtent(this.map.getSize());
    const people = this.sources.people.getExtent();
    if (!ol.extent.isEmpty(people) && !ol.extent.containsExtent(view, people)) this.fit();
  }

  #style(feature) {
    const { kind, status, level, id } = feature.getProperties();
    const faint = this.#floor !== null && level !== this.#floor;
    const colour = withAlpha(this.colours[status] ?? this.colours.accent, faint ? 0.25 : 1);
    if (kind === "trail") {
      return new ol.style.Style({ stroke: new ol.style.Stroke({ color: withAlpha(colour, faint ? 0.1 : 0.55), width: 3 }) });
    }
    if (kind === "way") {
      return new ol.style.Style({ stroke: new ol.style.Stroke({ color: this.colours.accent, width: 6, lineDash: [14, 8] }) });
    }
    if (kind === "region") {
      return new ol.style.Style({
        fill: new ol.style.Fill({ color: withAlpha(colour, faint ? 0.03 : 0.14) }),
        stroke: new ol.style.Stroke({ color: colour, width: 1.5, lineDash: status === "lost" ? [8, 6] : undefined }),
      });
    }
    const ofPerson = kind === "person";
    const label = new ol.style.Text({ text: id, offsetY: ofPerson ? -30 : 16,
      font: `${ofPerson ? "600 16" : "13"}px system-ui, sans-serif`,
      fill: new ol.style.Fill({ color: withAlpha(this.colours.ink, faint ? 0.35 : 1) }),
      stroke: new ol.style.Stroke({ color: this.colours.ground, width: 4 }) });
    if (kind === "site") {
      const siteColour = withAlpha(this.colours.accent, faint ? 0.3 : 1);
      return new ol.style.Style({ text: label, image: new ol.style.RegularShape({ points: 4, radius: 9, angle: Math.PI / 4,
        stroke: new ol.style.Stroke({ color: siteColour, width: 2, lineDash: [4, 3] }) }) });
    }
    if (kind === "dap") {
      const dapColour = withAlpha(status === "lost" ? this.colours.lost : this.colours.accent, faint ? 0.3 : 1);
      return new ol.style.Style({ text: label, image: new ol.style.RegularShape({ points: 4, radius: 8, angle: Math.PI / 4,
        fill: new ol.style.Fill({ color: status === "lost" ? this.colours.ground : dapColour }),
        stroke: new ol.style.Stroke({ color: dapColour, width: 2.5 }) }) });
    }
    return this.#person(feature, colour, label);
  }

  #person(feature, colour, label) {
    const { status, heading, headingKnown } = feature.getProperties();
    const ring = new ol.style.Stroke({ color: this.colours.ground, width: 2 });
    const fill = new ol.style.Fill({ color: colour });
    const styles = [new ol.style.Style({ text: label, zIndex: 2, image: new ol.style.RegularShape({
      points: SHAPES[status] ?? 24, radius: 10, fill, stroke: ring }) })];
    if (headingKnown && status !== "lost") {
      styles.push(new ol.style.Style({ zIndex: 3, image: new ol.style.RegularShape({ points: 3, radius: 7,
        displacement: [0, 17], rotation: heading, fill, stroke: ring }) }));
    }
    return styles;
  }
}

/** The region that holds somebody with 95 %: an ellipse, or the outlines that were told. */
function regionOf(track) {
  if (track.regions_m.length) return track.regions_m.map((outline) => [close(outline.map(([n, e]) => [e, n]))]);
  const [longer, shorter] = track.axes95_m.map((axis) => Math.min(axis, 10 * GROWS_WIDE_M));
  const [sin, cos] = [Math.sin(track.bearing_rad), Math.cos(track.bearing_rad)];
  const ring = Array.from({ length: ELLIPSE_POINTS }, (_, index) => {
    const turn = (2 * Math.PI * index) / ELLIPSE_POINTS;
    const [along, across] = [longer * Math.cos(turn), shorter * Math.sin(turn)];
    return [track.east_m + along * sin + across * cos, track.north_m + along * cos - across * sin];
  });
  return [[close(ring)]];
}

const close = (ring) => [...ring, ring[0]];

function withAlpha(colour, alpha) {
  const [r, g, b, a = 1] = ol.color.asArray(colour);
  return [r, g, b, a * alpha];
}
