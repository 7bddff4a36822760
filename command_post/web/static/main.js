// The commander's page: follows the post, draws what has changed once a frame, asks for what is wanted.
import { Comparison } from "./compare.js";
import { askAssign, askOrder, askOrigin, askWho, showWay } from "./dialogs.js";
import { MapView } from "./map.js";
import { Model } from "./model.js";
import { cutToLegs, showAlerts, showDaps, showFloors, showPeople, showRemarks, showSites, wayWords } from "./panels.js";
import { tell } from "./notice.js";
import { loadPhrases, told } from "./phrases.js";
import * as post from "./post.js";
import { Review } from "./review.js";
import { changeLanguage, changeUnits, duration, word, writeWords } from "./words.js";

const AGAIN_MS = 1000;
const RANKS = { viewer: 0, operator: 1, commander: 2 };
const $ = (id) => document.getElementById(id);
const model = new Model();
let me = {};
let view = null;
let chosenFloor = null;
let due = { tracks: false, panels: false, wasPutOff: false };
let lostSince = null;
let drawnFirst = false;
let wayTimer = 0;
let findAgain = null;
let waysAsked = 0;
let joined = false;
let review = null;
let comparison = null;
const seen = new Set();

const may = (role) => RANKS[me.role] >= RANKS[role];

/** Draw what is due: people, and the lists in the frame after, so that neither waits for both. */
function draw() {
  const now = due;
  const isPutOff = now.tracks && now.panels && drawnFirst && !now.wasPutOff;
  due = { tracks: false, panels: isPutOff, wasPutOff: isPutOff };
  if (isPutOff) requestAnimationFrame(draw);
  if (now.tracks) view.drawTracks();
  if (now.panels && !isPutOff) {
    view.drawDaps();
    view.drawSites();
    view.drawOutside();
    const isWhole = drawPanels();
    comparison?.show();
    if (!isWhole) ask({ tracks: false, panels: true });
  }
  if (!drawnFirst && model.tracks.size) {
    drawnFirst = true;
    view.fit();
  }
}

/** Write the lists; says whether that was all, or more is to be written in the next frame. */
function drawPanels() {
  showFloors(model, chosenFloor, chooseFloor);
  showAlerts(model, may("operator"), { turn, assign });
  const isWhole = showPeople(model, { centre: (id) => view.centre(id), wayOut, rescue });
  showDaps(model);
  showSites(model);
  showRemarks(model);
  return isWhole;
}

function ask(what) {
  if (!due.tracks && !due.panels) requestAnimationFrame(draw);
  due = { ...due, tracks: due.tracks || what.tracks, panels: due.panels || what.panels };
}

function take(changes) {
  model.take(changes);
  // What stood when we came makes no sound; what came while there was no link does.
  soundNew(changes.alerts ?? [], Boolean(changes.trails) && (review !== null || !joined));
  joined = true;
  for (const answer of changes.answers ?? []) {
    if (answer.refusal && answer.commander_id === me.name) tell(`${word("refused")} ${told(answer.refusal)}`);
  }
  const panels = Boolean(changes.roster || changes.alerts?.length || changes.floors || changes.sites || changes.outside);
  ask({ tracks: Boolean(changes.tracks?.length || changes.trails), panels });
}

/** Sound each new alert once, and again if it gets worse; have it read out; not what stood before we came. */
function soundNew(alerts, before) {
  for (const alert of alerts) {
    const raised = `${alert.number} ${alert.words}`;
    const isNew = alert.stage === "raised" && !seen.has(raised);
    seen.add(raised);
    if (!isNew || before) continue;
    $("new-alert").textContent = `${word(alert.kind)}: ${alert.node_id}. ${told(alert.words)}`;
    beep();
  }
}

function beep() {
  if (!navigator.userActivation?.hasBeenActive) return;
  const context = new AudioContext();
  const tone = new OscillatorNode(context, { frequency: 880 });
  const volume = new GainNode(context, { gain: 0.2 });
  tone.connect(volume).connect(context.destination);
  tone.start();
  tone.stop(context.currentTime + 0.5);
  tone.onended = () => context.close();
}

function linked(isLinked) {
  lostSince = isLinked ? null : (lostSince ?? Date.now());
  showLink();
}

function showLink() {
  const link = $("link");
  if (review) {
    link.dataset.state = "past";
    link.textContent = word("recording");
    return;
  }
  link.dataset.state = lostSince === null ? (model.roster ? "live" : "waiting") : "lost";
  link.textContent = lostSince === null
    ? word(model.roster ? "live" : "waiting")
    : `${word("lost_link")} ${duration((Date.now() - lostSince) / 1000)}`;
}

function chooseFloor(level) {
  chosenFloor = level;
  view.showFloor(level);
  ask({ tracks: false, panels: true });
}

async function turn(alert, stage, assigned_to = null) {
  try {
    await post.turnAlert(alert.number, stage, assigned_to);
  } catch (error) {
    tell(`${word("refused")} ${told(error.message)}`);
  }
}

const wayOut = (id) => findWay("way_out", id, post.wayOut);
const rescue = (id) => findWay("rescue", id, post.rescue);

/** Find a way, and follow whoever goes it: it is found anew every few seconds, until it is closed. */
function findWay(name, id, find) {
  clearInterval(wayTimer);
  findAgain = () => showFound(name, id, find);
  wayTimer = setInterval(findAgain, 3000);
  return findAgain();
}

async function showFound(name, id, find) {
  const asked = waysAsked += 1;
  let found = null;
  let words = "";
  try {
    found = await find(id, review?.at_s);
    words = wayWords(found.way);
  } catch (error) {
    words = told(error.message);
  }
  // Meanwhile it was closed, or another was asked for.
  if (asked !== waysAsked) return;
  const title = `${word(name)} ${id}`;
  const send = found && may("commander") ? () => post.order("message", [found.who], cutToLegs(`${title}: ${words}`)) : null;
  view.showWay(found ? found.way.places_m : null);
  showWay(found && found.who !== id ? `${title} ← ${found.who}` : title, words, send, endWay);
}

function endWay() {
  clearInterval(wayTimer);
  findAgain = null;
  waysAsked += 1;
  view.showWay(null);
}

const ids = () => model.responders().map((row) => row.responder_id);
const assign = (alert) => askAssign(ids(), (id) => turn(alert, "assigned", id));

function wireButtons() {
  $("evacuate").onclick = () => askOrder("evacuate", ids(), new Set(), me.teams);
  // By exception: those of whom it is not known that they are well are asked, the others need not.
  $("roll-call").onclick = () => askOrder("roll_call", ids(), model.doubtful(), me.teams);
  $("message").onclick = () => askOrder("message", ids(), new Set(), me.teams);
  $("take-back").onclick = () => askOrder("withdraw", ids(), new Set(), me.teams);
  $("earth").onclick = () => askOrigin(model.origin, (picked) => view.pick(picked));
  $("fit").onclick = () => view.fit();
  $("units").onclick = () => { changeUnits(); view.readUnits(); comparison?.write(); ask({ tracks: false, panels: true }); };
  $("language").onclick = () => { changeLanguage(); writeWords(); showLink(); review?.write(); comparison?.write(); ask({ tracks: false, panels: true }); };
  $("theme").onclick = () => {
    const night = document.documentElement.dataset.theme !== "night";
    localStorage.setItem("theme", night ? "night" : "day");
    setTheme(night);
  };
  $("sign-out").onclick = async () => { await post.signOut(); location.reload(); };
}

function setTheme(night) {
  document.documentElement.dataset.theme = night ? "night" : "day";
  view.readColours();
}

async function begin() {
  await loadPhrases();
  me = await post.whoAmI();
  $("incident").textContent = me.incident;
  document.title = `Clew: ${me.incident}`;
  if (!me.role) { askWho(begin); return; }
  showRole();
  if (me.review) beginReview();
  else follow();
  view.showPlan(await post.plan());
}

function follow() {
  post.follow(take, linked, () => setTimeout(rejoin, AGAIN_MS));
}

/** Come in again where the post wants to know anew who one is: it, or its page, was started again. */
async function rejoin() {
  try {
    me = await post.whoAmI();
  } catch {
    setTimeout(rejoin, AGAIN_MS);
    return;
  }
  if (!me.role) { askWho(rejoin); return; }
  showRole();
  follow();
}

/** Say as whom one has signed in, and let be pressed what that one may do. */
function showRole() {
  $("sign-out").hidden = me.name === "local";
  $("sign-out").textContent = `${word("sign_out")} (${me.name})`;
  for (const button of document.querySelectorAll("[data-role]")) button.disabled = !may(button.dataset.role);
  ask({ tracks: false, panels: true });
}

/** Nothing can be ordered in what is past: what would do so is not shown. */
async function beginReview() {
  document.documentElement.dataset.review = "";
  review = new Review({ moment: (changes) => { view.clear(); take(changes); findAgain?.(); }, changes: take });
  showLink();
  await review.begin();
  comparison = new Comparison(model, view, (at_s) => review.seek(at_s), review.begin_ns);
  comparison.begin();
}

function start() {
  writeWords();
  view = new MapView("map", model);
  const kept = localStorage.getItem("theme");
  setTheme(kept ? kept === "night" : matchMedia("(prefers-color-scheme: dark)").matches);
  wireButtons();
  showLink();
  setInterval(showLink, 1000);
  begin();
}

start();
