// What is known of the incident: the newest of everything that was told.
const MOST_TRAIL = 300;
const TRAIL_SPACING_M = 0.5;
const WORST_FIRST = ["mayday", "fall", "motionless", "low_air", "left_team", "lost_contact", "intruder", "dap_dead",
  "dap_moved", "low_battery", "doubt"];
const STOREY_M = 1.8;
const STAGES = ["raised", "acknowledged", "assigned", "resolved"];

export class Model {
  #rows = new Map();

  constructor() {
    this.tracks = new Map();
    this.trails = new Map();
    this.alerts = new Map();
    this.answers = [];
    this.roster = null;
    this.floors = [{ level: 0, down_m: 0 }];
    this.sites = [];
    this.origin = null;
    this.outside = [];
  }

  /** Take in what has changed; `trails` are whole where they are given. */
  take(changes) {
    if (changes.trails) {
      this.trails = new Map(Object.entries(changes.trails));
      this.tracks.clear();
      this.alerts.clear();
    }
    for (const track of changes.tracks ?? []) {
      this.tracks.set(track.responder_id, track);
      if (!changes.trails) this.#lengthen(track);
    }
    for (const alert of changes.alerts ?? []) this.alerts.set(alert.number, alert);
    for (const answer of changes.answers ?? []) this.answers.push(answer);
    if (changes.roster) {
      this.roster = changes.roster;
      this.#rows = new Map(changes.roster.responders.map((row) => [row.responder_id, row]));
    }
    if (changes.floors) this.floors = changes.floors;
    if (changes.sites) this.sites = changes.sites;
    if (changes.origin) this.origin = changes.origin;
    if (changes.outside) this.outside = changes.outside;
  }

  /** What is not resolved: the newest of the worst first, and what nobody has seen before all. */
  openAlerts() {
    const open = [...this.alerts.values()].filter((alert) => alert.stage !== "resolved");
    const rank = (alert) => [
      STAGES.indexOf(alert.stage), WORST_FIRST.indexOf(alert.kind), -alert.since_ns,
    ];
    return open.sort((one, other) => {
      const [a, b] = [rank(one), rank(other)];
      return a[0] - b[0] || a[1] - b[1] || a[2] - b[2];
    });
  }

  responders() {
    return this.roster?.responders ?? [];
  }

  /** What a track is worth now: the roster knows what has become of it since it was told. */
  statusOf(track) {
    const status = this.#rows.get(track.responder_id)?.status;
    return status === undefined || status === "tracking" || status === "no_track" ? track.status : status;
  }

  /** Those of whom it is not known that they are well: a roll call asks these alone. */
  doubtful() {
    const alerted = new Set(this.openAlerts().map((alert) => alert.node_id));
    const ids = this.responders()
      .filter((row) => row.status === "lost" || row.alarm || alerted.has(row.responder_id))
      .map((row) => row.responder_id);
    return new Set(ids);
  }

  /** The floor on which something at a height is; `null` where no floor is so high. */
  storeyAt(down_m) {
    const level = this.floorOf(down_m);
    const floor = this.floors.find((one) => one.level === level);
    return Math.abs(floor.down_m - down_m) < STOREY_M ? level : null;
  }

  floorOf(down_m) {
    const off = (floor) => Math.abs(floor.down_m - down_m);
    return this.floors.reduce((best, floor) => (off(floor) < off(best) ? floor : best)).level;
  }

  #lengthen(track) {
    const trail = this.trails.get(track.responder_id) ?? [];
    const last = trail.at(-1);
    const place = [track.north_m, track.east_m, track.down_m];
    const moved = !last || place.some((value, axis) => Math.abs(value - last[axis]) >= TRAIL_SPACING_M);
    if (moved && track.status !== "lost") trail.push(place);
    if (trail.length > MOST_TRAIL) trail.shift();
    this.trails.set(track.responder_id, trail);
  }
}
