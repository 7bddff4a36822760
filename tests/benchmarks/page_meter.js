// Notes in the page itself how long after its message an estimate is on the map, and each frame.
(() => {
  const NS_PER_MS = 1e6;
  const meter = { late_ms: [], frames_ms: [], messages: 0, renders: 0, long_ms: [] };
  const waiting = new Map();
  let crowd = null;
  window.clewMeter = meter;

  const heard = EventSource.prototype.addEventListener;
  EventSource.prototype.addEventListener = function (name, handler, ...more) {
    return heard.call(this, name, name !== "changes" ? handler : (event) => {
      const changes = JSON.parse(event.data);
      meter.messages += 1;
      if (!changes.trails) for (const track of changes.tracks ?? []) waiting.set(track.responder_id, track);
      handler(event);
    }, ...more);
  };

  // Drawn is what stands at a message's place when the crowd was drawn; told once that is painted.
  const rendered = () => {
    meter.renders += 1;
    const drawn = [];
    for (const [id, [east, north]] of crowd.drawn) {
      const track = waiting.get(id);
      if (east !== track?.east_m || north !== track.north_m) continue;
      drawn.push(track.time_ns / NS_PER_MS);
      waiting.delete(id);
    }
    if (!drawn.length) return;
    const painted = new MessageChannel();
    painted.port1.onmessage = () => {
      const now_ms = performance.timeOrigin + performance.now();
      for (const since_ms of drawn) meter.late_ms.push(now_ms - since_ms);
    };
    requestAnimationFrame(() => painted.port2.postMessage(null));
  };

  let library;
  Object.defineProperty(window, "ol", {
    configurable: true,
    get: () => library,
    set: (given) => {
      library = { ...given, Map: class extends given.Map {
        constructor(options) {
          super(options);
          crowd = this.getAllLayers().find((layer) => layer.drawn);
          crowd.on("drawn", rendered);
        }
      } };
    },
  });

  new PerformanceObserver((list) => {
    for (const entry of list.getEntries()) meter.long_ms.push(entry.duration);
  }).observe({ type: "longtask" });
  const frame = (now_ms) => { meter.frames_ms.push(now_ms); requestAnimationFrame(frame); };
  requestAnimationFrame(frame);
})();
