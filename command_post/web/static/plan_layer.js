// The plan beneath the map: walls, and images that may be turned. Metres, north is up.
/* global ol */

/** Layers of a plan's walls and images; `level_of` tells the floor of a height. */
export class PlanLayers {
  #images = [];
  #walls;
  #levelOf;

  constructor(projection, levelOf) {
    this.#levelOf = levelOf;
    this.#walls = new ol.layer.Vector({ source: new ol.source.Vector(), visible: false });
    this.group = new ol.layer.Group({ layers: [this.#walls] });
    this.projection = projection;
  }

  set(plan) {
    const lines = plan.walls_m.map(([north, east, north2, east2]) => [[east, north], [east2, north2]]);
    this.#walls.setVisible(lines.length > 0);
    if (lines.length) {
      this.#walls.getSource().addFeature(new ol.Feature({ geometry: new ol.geom.MultiLineString(lines) }));
    }
    for (const image of plan.images) this.#add(image);
  }

  setColour(colour) {
    this.#walls.setStyle(new ol.style.Style({ stroke: new ol.style.Stroke({ color: colour, width: 2 }) }));
  }

  /** Show the images of one floor; of all floors (`null`), the ground floor's. */
  setLevel(level) {
    for (const { layer, down_m } of this.#images) layer.setVisible(this.#levelOf(down_m) === (level ?? 0));
  }

  extent() {
    return this.#walls.getSource().getExtent();
  }

  #add({ number, down_m, placing: [a, d, b, e, c, f] }) {
    const picture = new Image();
    const canvas = document.createElement("canvas");
    const source = new ol.source.ImageCanvas({ projection: this.projection, ratio: 1,
      canvasFunction: (extent, _resolution, _ratio, size) => {
        [canvas.width, canvas.height] = size;
        const scale = size[0] / (extent[2] - extent[0]);
        const context = canvas.getContext("2d");
        context.setTransform(a * scale, -d * scale, b * scale, -e * scale, (c - extent[0]) * scale, (extent[3] - f) * scale);
        if (picture.complete && picture.naturalWidth) context.drawImage(picture, 0, 0);
        return canvas;
      } });
    const layer = new ol.layer.Image({ source, opacity: 0.6, visible: false });
    picture.onload = () => source.changed();
    picture.src = `api/v1/plan/${number}`;
    this.#images.push({ layer, down_m });
    this.group.getLayers().insertAt(0, layer);
  }
}
