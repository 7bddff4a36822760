// What is asked before something is done: whom to order what, whom to give an alert to, who one is.
import { tell } from "./notice.js";
import { told } from "./phrases.js";
import * as post from "./post.js";
import { word } from "./words.js";

const $ = (id) => document.getElementById(id);

/** Ask whom to order `kind`; those in `chosen` are ticked already. A team's box ticks its people. */
export function askOrder(kind, ids, chosen, teams = {}) {
  const forAll = kind === "evacuate" || kind === "withdraw";
  $("order-title").textContent = word(kind === "withdraw" ? "take_back" : kind);
  $("order-send").textContent = word({ message: "send", withdraw: "take_back" }[kind] ?? kind);
  $("order-text-label").hidden = kind === "roll_call" || kind === "withdraw";
  $("order-text").value = "";
  $("order-problem").textContent = "";
  const everybody = forAll ? [box("", word("everybody"), true)] : [];
  const people = ids.map((id) => box(id, id, chosen.has(id)));
  const crews = Object.entries(teams).map(([name, members]) => {
    const made = box(null, `${word("team")} ${name}`, false);
    made.input.dataset.members = JSON.stringify(members);
    made.input.disabled = !members.some((id) => ids.includes(id));
    return made;
  });
  $("order-to").replaceChildren(...[...everybody, ...crews, ...people].map(({ label }) => label));
  $("order-to").onchange = (event) => settle(event.target, people.map(({ input }) => input), everybody[0]?.input);
  $("order-send").onclick = () => sendOrder(kind);
  $("order-dialog").showModal();
}

function box(value, text, checked) {
  const label = document.createElement("label");
  const input = Object.assign(document.createElement("input"), { type: "checkbox", checked });
  if (value === null) input.name = "team";
  else input.value = value;
  label.append(input, text);
  return { label, input };
}

/** Have a team's box tick its people; everybody is either named, or all without names. */
function settle(turned, people, everybody) {
  if (turned === everybody) {
    if (everybody.checked) for (const other of $("order-to").querySelectorAll("input")) other.checked = other === everybody;
    return;
  }
  const members = JSON.parse(turned.dataset.members ?? "[]");
  for (const one of people) if (members.includes(one.value)) one.checked = turned.checked;
  if (everybody && turned.checked) everybody.checked = false;
}

async function sendOrder(kind) {
  const ticked = [...$("order-to").querySelectorAll("input:checked:not([name=team])")].map((box) => box.value);
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
  $("way-send").onclick = async () => {
    try {
      await send();
      $("way").hidden = true;
      done();
    } catch (error) {
      tell(`${word("refused")} ${told(error.message)}`);
    }
  };
  $("way-close").onclick = () => { $("way").hidden = true; done(); };
  $("way").hidden = false;
}

/** Ask where on the Earth a place of the incident is: its origin, or what is clicked (`pick`). */
export function askOrigin(origin, pick) {
  const place = ["earth-north", "earth-east"];
  const show = (metres) => place.forEach((id, axis) => { $(id).value = metres[axis].toFixed(1); });
  const fields = { latitude: "latitude_deg", longitude: "longitude_deg", height: "height_m", bearing: "bearing_deg" };
  for (const [id, name] of Object.entries(fields)) {
    const optional = id === "height" || id === "bearing";
    $(id).value = origin ? (origin[name] ?? 0) : (optional ? 0 : "");
  }
  $("earth-problem").textContent = "";
  $("earth-pick").onclick = () => {
    $("earth-dialog").close();
    pick((picked) => { show(picked); $("earth-dialog").showModal(); });
  };
  $("earth-cancel").onclick = () => $("earth-dialog").close();
  $("earth-form").onsubmit = async (event) => {
    event.preventDefault();
    const given = Object.fromEntries(Object.entries(fields).map(([id, name]) => [name, $(id).valueAsNumber]));
    try {
      const [north_m, east_m] = place.map((id) => $(id).valueAsNumber);
      await post.setOrigin({ ...given, north_m, east_m });
      $("earth-dialog").close();
    } catch (error) {
      $("earth-problem").textContent = `${word("refused")} ${told(error.message)}`;
    }
  };
  show([0, 0]);
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
