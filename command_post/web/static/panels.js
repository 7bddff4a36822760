// The lists beside the map: alerts, responders, access points, and what the post remarks.
import { told } from "./phrases.js";
import { counted, duration, length, word } from "./words.js";

const NS_PER_S = 1e9;
const MOST_TEXT = 200;
const $ = (id) => document.getElementById(id);

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children.filter((child) => child !== null));
  return made;
}

/** Keep the list's items that are still there, by key, so that nobody's focus is lost. */
function renew(list, entries, make) {
  const known = new Map([...list.children].map((item) => [item.dataset.key, item]));
  entries.forEach((entry, index) => {
    const text = JSON.stringify(entry.shown);
    let item = known.get(entry.key);
    known.delete(entry.key);
    if (!item || item.dataset.shown !== text) {
      const focused = item?.contains(document.activeElement) ? document.activeElement.dataset.action : null;
      const made = make(entry);
      made.dataset.key = entry.key;
      made.dataset.shown = text;
      item ? item.replaceWith(made) : null;
      item = made;
      const again = `[data-action="${focused}"]`;
      if (focused) (item.matches(again) ? item : item.querySelector(again) ?? item.querySelector("button"))?.focus();
    }
    if (list.children[index] !== item) list.insertBefore(item, list.children[index] ?? null);
  });
  for (const item of known.values()) {
    const focused = item.contains(document.activeElement);
    item.remove();
    if (focused) (list.querySelector("button") ?? list.closest("section")).focus();
  }
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

export function showPeople(model, actions) {
  const rows = model.responders();
  renew($("responder-list"), rows.map((row) => {
    const track = model.tracks.get(row.responder_id);
    const floor = track ? model.floorOf(track.floor_down_m) : null;
    const radius = track ? track.axes95_m[0] : null;
    const status = track ? model.statusOf(track) : row.status;
    const shown = {
      status, floor, sure: track?.floor_probability.toFixed(1), radius: radius === null ? "" : length(radius),
      reason: status === row.status ? row.reason : track.reason, activity: row.activity, fault: row.fault,
      left: suppliesWords(row.supplies),
      orders: row.orders.map((one) => [one.order.kind, one.received]), word: word(status),
    };
    return { key: row.responder_id, row, shown };
  }), ({ row, shown }) => personItem(row, shown, actions));
  const lost = rows.filter((row) => row.status === "lost").length;
  $("counts").textContent = `${rows.length} ${word("inside")}` + (lost ? `, ${lost} ${word("lost_count")}` : "");
}

function personItem(row, shown, actions) {
  const state = element("span", { className: "state", textContent: word(shown.status) });
  state.dataset.status = shown.status;
  const sure = shown.radius ? `${word("within")} ${shown.radius}` : "";
  const floor = shown.floor === null ? "" : `${word("floor")} ${shown.floor}${shown.sure < 0.9 ? "?" : ""}`;
  const why = [told(shown.reason), told(shown.activity), shown.left, told(shown.fault)].filter(Boolean).join(" · ");
  const orders = row.orders.map((one) => {
    const stage = one.received ? word("has_it") : word("not_acknowledged");
    return `${word(one.order.kind)}: ${stage}`;
  });
  const who = element("button", { type: "button", className: "who", onclick: () => actions.centre(row.responder_id) },
    element("strong", { textContent: row.responder_id }), state,
    element("span", { textContent: floor }), element("span", { className: "sure", textContent: sure }),
    why ? element("span", { className: "why", textContent: why }) : null,
    orders.length ? element("span", { className: "why", textContent: orders.join(" · ") }) : null);
  who.dataset.action = "centre";
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
