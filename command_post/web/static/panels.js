// The lists beside the map: alerts, responders, access points, and what the post remarks.
import { told } from "./phrases.js";
import { counted, duration, length, word } from "./words.js";

const NS_PER_S = 1e9;
const MOST_TEXT = 200;
const MOST_ROWS = 40;
const kept = new WeakMap();
const $ = (id) => document.getElementById(id);

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children.filter((child) => child !== null));
  return made;
}

/**
 * Keep the list's items that are still there, by key, so that nobody's focus is lost. What an item shows is written into
 * it (`write`) where that can be, or else it is made anew; of so many at `most`. Says whether that was all.
 */
function renew(list, entries, make, write = () => false, most = Infinity) {
  const known = new Map([...list.children].map((item) => [kept.get(item).key, item]));
  let left = most;
  entries.forEach((entry, index) => {
    const text = JSON.stringify(entry.shown);
    let item = known.get(entry.key);
    known.delete(entry.key);
    const isNew = !item;
    if (isNew || (kept.get(item).text !== text && left > 0)) {
      left -= 1;
      if (isNew || !write(item, entry)) item = replaced(item, make(entry));
      kept.set(item, { key: entry.key, text });
    } else if (kept.get(item).text !== text) {
      left = -1;
    }
    if (list.children[index] !== item) list.insertBefore(item, list.children[index] ?? null);
  });
  for (const item of known.values()) {
    const focused = item.contains(document.activeElement);
    item.remove();
    if (focused) (list.querySelector("button") ?? list.closest("section")).focus();
  }
  return left >= 0;
}

/** Put an item in another's place, and the focus where it was. */
function replaced(item, made) {
  const focused = item?.contains(document.activeElement) ? document.activeElement.dataset.action : null;
  item?.replaceWith(made);
  const again = `[data-action="${focused}"]`;
  if (focused) (made.matches(again) ? made : made.querySelector(again) ?? made.querySelector("button"))?.focus();
  return made;
}

export function showAlerts(model, may, actions) {
  const now = model.roster?.now_ns ?? 0;
  const open = model.openAlerts();
  $("alert-count").textContent = open.length ? `(${open.length})` : "";
  $("no-alerts").hidden = open.length > 0;
  renew($("alert-list"), open.map((alert) => ({
    key: String(alert.number), alert,
    shown: [alert, duration((now - alert.since_ns) / NS_PER_S), may, word("acknowledge")],
  })), ({ alert }) => alertItem(alert, now, may, actions));
}

function alertItem(alert, now, may, actions) {
  const button = (name, act) => {
    const made = element("button", { type: "button", textContent: word(name), onclick: act, disabled: !may });
    made.dataset.action = name;
    made.setAttribute("aria-label", `${word(name)}: ${word(alert.kind)}, ${alert.node_id}`);
    return made;
  };
  const stage = alert.stage === "assigned" ? `${word("assigned")} ${alert.assigned_to}` : word(alert.stage);
  const by = alert.by ? ` (${word("by")} ${alert.by})` : "";
  const age = duration(Math.max(0, now - alert.since_ns) / NS_PER_S);
  const item = element("li", {},
    element("strong", { textContent: `${word(alert.kind)}: ${alert.node_id}` }),
    element("p", { className: "why", textContent: `${told(alert.words)} · ${age} · ${stage}${by}` }),
    element("div", { className: "row" },
      alert.stage === "raised" ? button("acknowledge", () => actions.turn(alert, "acknowledged")) : null,
      button("assign", () => actions.assign(alert)),
      button("resolve", () => actions.turn(alert, "resolved"))));
  item.dataset.stage = alert.stage;
  return item;
}

/** Show the responders; of a large crew so many at a time. Says whether that was all. */
export function showPeople(model, actions) {
  const rows = model.responders();
  const isWhole = renew($("responder-list"), rows.map((row) => ({ key: row.responder_id, row, shown: personWords(model, row) })),
    ({ row, shown }) => personItem(row, shown, actions), ({ children: [who] }, { shown }) => writePerson(who, shown), MOST_ROWS);
  const lost = rows.filter((row) => row.status === "lost").length;
  const counts = `${rows.length} ${word("inside")}` + (lost ? `, ${lost} ${word("lost_count")}` : "");
  if ($("counts").textContent !== counts) $("counts").textContent = counts;
  return isWhole;
}

/** What stands of somebody in the list: their name, and in words how they are. */
function personWords(model, row) {
  const track = model.tracks.get(row.responder_id);
  const status = track ? model.statusOf(track) : row.status;
  const reason = status === row.status ? row.reason : track.reason;
  const sure = track && track.floor_probability.toFixed(1) >= 0.9 ? "" : "?";
  const orders = row.orders.map((one) => `${word(one.order.kind)}: ${word(one.received ? "has_it" : "not_acknowledged")}`);
  return {
    status, state: word(status),
    floor: track ? `${word("floor")} ${model.floorOf(track.floor_down_m)}${sure}` : "",
    sure: track ? `${word("within")} ${length(track.axes95_m[0])}` : "",
    why: [told(reason), told(row.activity), suppliesWords(row.supplies), told(row.fault)].filter(Boolean).join(" · "),
    orders: orders.join(" · "),
    buttons: [word("way_out"), word("rescue")],
  };
}

function personItem(row, shown, actions) {
  const part = (className, name) => {
    const made = element("span", { className, textContent: shown[name] });
    made.dataset.part = name;
    return made;
  };
  const state = part("state", "state");
  state.dataset.status = shown.status;
  const who = element("button", { type: "button", className: "who", onclick: () => actions.centre(row.responder_id) },
    element("strong", { textContent: row.responder_id }), state, part("", "floor"), part("sure", "sure"),
    shown.why ? part("why", "why") : null, shown.orders ? part("why", "orders") : null);
  who.dataset.action = "centre";
  who.buttons = shown.buttons.join();
  const way = (name, act) => {
    const made = element("button", { type: "button", textContent: word(name), onclick: act });
    made.dataset.action = name;
    made.setAttribute("aria-label", `${word(name)}: ${row.responder_id}`);
    return made;
  };
  return element("li", {}, who, element("div", { className: "row" },
    way("way_out", () => actions.wayOut(row.responder_id)),
    way("rescue", () => actions.rescue(row.responder_id))));
}

/** Write what has changed of somebody into their item; not where it has other parts, or is in other words. */
function writePerson(who, shown) {
  const parts = new Map([...who.querySelectorAll("[data-part]")].map((each) => [each.dataset.part, each]));
  if (parts.has("why") !== Boolean(shown.why) || parts.has("orders") !== Boolean(shown.orders)) return false;
  if (who.buttons !== shown.buttons.join()) return false;
  for (const [name, part] of parts) {
    if (part.textContent !== shown[name]) part.textContent = shown[name];
  }
  const state = parts.get("state");
  if (state.dataset.status !== shown.status) state.dataset.status = shown.status;
  return true;
}

/** What somebody, or something, has left, as far as that is known. */
function suppliesWords(left) {
  const percent = left?.battery === undefined ? "" : `${word("battery")} ${Math.round(100 * left.battery)} %`;
  return [percent && left.charging ? `${percent} (${word("charging")})` : percent,
    left?.air_bar === undefined ? "" : `${word("air")} ${Math.round(left.air_bar)} bar`,
    left?.air_left_s === undefined ? "" : `${word("air_for")} ${duration(left.air_left_s)}`].filter(Boolean).join(" · ");
}

/** What is to be known besides: what orders wait for whom, and what is wrong with the post. */
export function showRemarks(model) {
  const rows = model.responders();
  const orders = new Map();
  for (const row of rows) {
    for (const { order } of row.orders) {
      const known = orders.get(order.sequence) ?? { order, waited: [] };
      known.waited.push(row.responder_id);
      orders.set(order.sequence, known);
    }
  }
  const waiting = [...orders.values()].map(({ order, waited }) => {
    const of = order.to?.length || rows.length;
    return `${word(order.kind)}: ${counted("acknowledged_by", { n: of - waited.length, of })}, ${word("waited_for")} ${waited.join(", ")}`;
  });
  const lines = [...waiting, ...(model.roster?.remarks ?? []).map(told)];
  renew($("remarks"), lines.map((line) => ({ key: line, shown: line })), ({ shown }) => element("li", { textContent: shown }));
  $("take-back").hidden = waiting.length === 0;
}

/** Where a further DAP would help, in words: the map has but a mark. */
export function showSites(model) {
  renew($("site-list"), model.sites.map((site, index) => ({
    key: String(index), shown: [site.reason, site.gain_bits, model.floorOf(site.down_m), length(1), word("floor")], site,
  })), ({ site }) => element("li", { textContent: `${word("floor")} ${model.floorOf(site.down_m)}, ${word("north")} ${length(site.north_m)}, `
    + `${word("east")} ${length(site.east_m)}: +${counted("bits", { n: site.gain_bits })}; ${told(site.reason)}` }));
  $("more-daps").hidden = model.sites.length === 0;
}

export function showDaps(model) {
  const daps = model.roster?.daps ?? [];
  renew($("dap-list"), daps.map((row) => ({
    key: row.dap_id, row, shown: [row.status, row.reason, row.fault, word(row.status), suppliesWords(row.supplies)],
  })), ({ row, shown }) => {
    const state = element("span", { className: "state", textContent: word(row.status) });
    state.dataset.status = row.status;
    return element("li", {}, element("div", { className: "who" },
      element("strong", { textContent: row.dap_id }), state,
      element("span", { className: "why", textContent: [told(row.reason), shown.at(-1), told(row.fault)].filter(Boolean).join(" · ") })));
  });
}

export function showFloors(model, chosen, choose) {
  const entries = [{ level: null }, ...model.floors].map(({ level }) => ({
    key: String(level), level, shown: [level, level === chosen, word("floor")],
  }));
  renew($("floors"), entries, ({ level }) => {
    const tab = element("button", { type: "button", onclick: () => choose(level),
      textContent: level === null ? word("all_floors") : `${word("floor")} ${level}` });
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-selected", String(level === chosen));
    tab.setAttribute("aria-controls", "map");
    tab.dataset.action = "floor";
    return tab;
  });
}

/** A way in words, one line a leg. */
export function wayWords(way) {
  const legs = way.legs.map((leg) => `${word(leg.turn)} ${length(leg.length_m)}`);
  return `${length(way.length_m)}, ${duration(way.walk_s)} ${word("walking")}, `
    + `${duration(way.crawl_s)} ${word("crawling")}: ${legs.join("; ")}`;
}

/** A way's words as long as a message may be: whole legs, as far as they go. */
export function cutToLegs(words) {
  if (words.length <= MOST_TEXT) return words;
  return `${words.slice(0, words.lastIndexOf("; ", MOST_TEXT - 3))}; …`;
}
