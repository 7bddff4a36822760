// What is asked before something is done: whom to order what, whom to give an alert to, who one is.
import { told } from "./phrases.js";
import * as post from "./post.js";
import { word } from "./words.js";

const $ = (id) => document.getElementById(id);

/** Ask whom to order `kind`; those in `chosen` are ticked already. */
export function askOrder(kind, ids, chosen) {
  const everybody = kind === "evacuate";
  $("order-title").textContent = word(kind);
  $("order-send").textContent = word(kind === "message" ? "send" : kind);
  $("order-text-label").hidden = kind === "roll_call";
  $("order-text").value = "";
  $("order-problem").textContent = "";
  const boxes = [...(everybody ? [["", word("everybody"), true]] : []),
    ...ids.map((id) => [id, id, chosen.has(id)])];
  $("order-to").replaceChildren(...boxes.map(([id, text, ticked]) => {
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", value: id, checked: ticked });
    label.append(box, text);
    return label;
  }));
  $("order-send").onclick = () => sendOrder(kind);
  $("order-dialog").showModal();
}

async function sendOrder(kind) {
  const ticked = [...$("order-to").querySelectorAll("input:checked")].map((box) => box.value);
  const text = $("order-text").value.trim();
  if (!ticked.length) { $("order-problem").textContent = word("nobody"); return; }
  if (kind === "message" && !text) { $("order-problem").textContent = word("text_needed"); return; }
  try {
    await post.order(kind, ticked.includes("") ? [] : ticked, text);
    $("order-dialog").close();
  } catch (error) {
    $("order-problem").textContent = `${word("refused")} ${told(error.message)}`;
  }
}

/** Show a way for `who`; `send` sends its words to them, if that may be; `done` when it is closed. */
export function showWay(title, words, send, done) {
  $("way-title").textContent = title;
  $("way-words").textContent = words;
  $("way-send").hidden = send === null;
  $("way-send").onclick = async () => { await send(); $("way").hidden = true; done(); };
  $("way-close").onclick = () => { $("way").hidden = true; done(); };
  $("way").hidden = false;
}

/** Ask where on the Earth a place of the incident is: its origin, or what is clicked (`pick`). */
export function askOrigin(origin, pick) {
  let place = [0, 0];
  const show = () => { $("earth-place").value = place.map((metres) => metres.toFixed(1)).join(", "); };
  const fields = { latitude: "latitude_deg", longitude: "longitude_deg", height: "height_m", bearing: "bearing_deg" };
  for (const [id, name] of Object.entries(fields)) {
    const optional = id === "height" || id === "bearing";
    $(id).value = origin ? (origin[name] ?? 0) : (optional ? 0 : "");
  }
  $("earth-problem").textContent = "";
  $("earth-pick").onclick = () => {
    $("earth-dialog").close();
    pick((picked) => { place = picked; show(); $("earth-dialog").showModal(); });
  };
  $("earth-cancel").onclick = () => $("earth-dialog").close();
  $("earth-form").onsubmit = async (event) => {
    event.preventDefault();
    const given = Object.fromEntries(Object.entries(fields).map(([id, name]) => [name, $(id).valueAsNumber]));
    try {
      await post.setOrigin({ ...given, north_m: place[0], east_m: place[1] });
      $("earth-dialog").close();
    } catch (error) {
      $("earth-problem").textContent = `${word("refused")} ${told(error.message)}`;
    }
  };
  show();
  $("earth-dialog").showModal();
}

/** Ask whom to give an alert to; `chosen` is called with the id. */
export function askAssign(ids, chosen) {
  $("assign-to").replaceChildren(...ids.map((id) => Object.assign(document.createElement("button"), {
    type: "button", textContent: id, onclick: () => { $("assign-dialog").close(); chosen(id); },
  })));
  $("assign-dialog").showModal();
}

/** Ask who one is, until that is right; then call `entered`. */
export function askWho(entered) {
  $("sign-in-form").onsubmit = async (event) => {
    event.preventDefault();
    try {
      await post.signIn($("name").value, $("password").value);
      $("password").value = "";
      $("sign-in-dialog").close();
      entered();
    } catch (error) {
      $("sign-in-problem").textContent = told(error.message);
    }
  };
  $("sign-in-dialog").oncancel = (event) => event.preventDefault();
  $("sign-in-dialog").showModal();
}
