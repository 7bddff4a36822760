// A recording in the page: its time line, played at any speed and gone through to any moment.
import * as post from "./post.js";
import { told } from "./phrases.js";
import { word } from "./words.js";

const SPEEDS = [0.5, 1, 2, 5, 10, 30, 60];
const FRAME_S = 0.1;
const FRAMES = 20;
const FETCH_AHEAD_S = 1.2;
const READING_MS = 500;
const $ = (id) => document.getElementById(id);

export class Review {
  #shown;
  #line = null;
  #at = 0;
  #fetched = 0;
  #frames = [];
  #fetching = false;
  #seeking = null;
  #playing = false;
  #before = null;

  /** `shown` has `moment(changes)`, all there is to see at once, and `changes(changes)`. */
  constructor(shown) {
    this.#shown = shown;
  }

  get begin_ns() { return this.#line.begin_ns; }
  get at_s() { return this.#at; }

  async begin() {
    $("timeline").hidden = false;
    $("speed").replaceChildren(...SPEEDS.map((each) => new Option(`${each} ×`, each, each === 1, each === 1)));
    $("play").onclick = () => this.turn();
    $("mark-before").onclick = () => this.#toMark(-1);
    $("mark-next").onclick = () => this.#toMark(1);
    $("speed").onchange = () => { this.#frames = []; this.#fetched = this.#at; };
    $("scrub").oninput = () => this.seek(Number($("scrub").value));
    document.addEventListener("keydown", (event) => this.#key(event));
    await this.#follow();
    $("scrub").max = Math.ceil(this.#line.length_s);
    await this.seek(0);
  }

  /** Play on, or hold. */
  turn() {
    if (!this.#playing && this.#at >= this.#line.length_s) this.seek(0);
    this.#playing = !this.#playing;
    this.#before = null;
    this.#tell();
    if (this.#playing) requestAnimationFrame((now) => this.#step(now));
  }

  /** Show the moment `at_s` after the beginning; of many that are wished for, the last one. */
  async seek(at_s) {
    this.#at = Math.min(Math.max(at_s, 0), this.#line.length_s);
    this.#frames = [];
    this.#fetched = this.#at;
    this.#tell();
    const idle = this.#seeking === null;
    this.#seeking = this.#at;
    if (!idle) return;
    while (this.#seeking !== null) {
      const wished = this.#seeking;
      try {
        this.#shown.moment(await post.moment(wished));
      } catch (error) {
        this.#fail(error);
      }
      if (this.#seeking === wished) this.#seeking = null;
    }
  }

  /** Write everything anew, in another language perhaps. */
  write() {
    if (this.#line === null) return;
    this.#drawMarks();
    this.#tell();
  }

  async #follow() {
    this.#line = await post.timeline();
    this.#drawMarks();
    if (this.#line.read_s < this.#line.length_s) setTimeout(() => this.#follow(), READING_MS);
  }

  #step(now) {
    if (!this.#playing) return;
    const speed = Number($("speed").value);
    const gone = this.#before === null ? 0 : ((now - this.#before) / 1000) * speed;
    this.#before = now;
    if (this.#seeking === null) {
      // What has not come yet is waited for.
      this.#at = Math.min(this.#at + gone, Math.max(this.#fetched, this.#at));
      while (this.#frames.length && this.#frames[0].at_s <= this.#at) {
        this.#shown.changes(this.#frames.shift().changes);
      }
      if (this.#fetched - this.#at < FETCH_AHEAD_S * speed) this.#fetch(speed);
    }
    if (this.#at >= this.#line.length_s) this.#playing = false;
    this.#tell();
    requestAnimationFrame((next) => this.#step(next));
  }

  async #fetch(speed) {
    if (this.#fetching || this.#fetched >= this.#line.length_s) return;
    this.#fetching = true;
    const [from, step] = [this.#fetched, FRAME_S * speed];
    try {
      const told = await post.moments(from, step, FRAMES);
      if (this.#fetched !== from || Number($("speed").value) !== speed || this.#seeking !== null) return;
      told.forEach((changes, index) => this.#frames.push({ at_s: from + (index + 1) * step, changes }));
      this.#fetched = Math.min(from + FRAMES * step, this.#line.length_s);
      this.#frames.at(-1).at_s = Math.min(this.#frames.at(-1).at_s, this.#line.length_s);
    } catch (error) {
      this.#fail(error);
    } finally {
      this.#fetching = false;
    }
  }

  /** Hold, and say why no more can be shown. */
  #fail(error) {
    this.#playing = false;
    $("faults").textContent = `${word("refused")} ${told(error.message)}`;
    this.#tell();
  }

  #toMark(way) {
    const times = this.#line.marks.map((mark) => mark.at_s);
    const next = way > 0 ? times.find((time) => time > this.#at + 0.5) : times.findLast((time) => time < this.#at - 0.5);
    if (next !== undefined) this.seek(next);
  }

  #key(event) {
    const free = event.target === document.body || ["map", "scrub"].includes(event.target.id);
    if (event.key !== " " || !free) return;
    event.preventDefault();
    this.turn();
  }

  #clock(at_s) {
    return new Date(this.#line.begin_ns / 1e6 + at_s * 1000).toTimeString().slice(0, 8);
  }

  #tell() {
    const clock = this.#clock(this.#at);
    $("clock").textContent = `${clock} (+${elapsed(this.#at)})`;
    $("play").textContent = word(this.#playing ? "hold" : "play");
    if (document.activeElement !== $("scrub") || this.#playing) $("scrub").value = this.#at;
    $("scrub").setAttribute("aria-valuetext", clock);
  }

  #drawMarks() {
    const line = this.#line;
    const place = (at_s) => `${(100 * at_s) / Math.max(line.length_s, 1e-3)}%`;
    const tick = (at_s, mark) => {
      const made = document.createElement("span");
      made.style.left = place(at_s);
      made.dataset.kind = mark.kind;
      made.title = this.#words(mark);
      made.onclick = () => this.seek(at_s);
      return made;
    };
    const gaps = line.gaps.map((gap) => {
      const made = document.createElement("i");
      made.style.left = place(gap.from_s);
      made.style.width = place(gap.to_s - gap.from_s);
      made.title = told(gap.words);
      return made;
    });
    const unread = document.createElement("b");
    unread.style.left = place(line.read_s);
    $("marks").replaceChildren(unread, ...gaps, ...line.marks.map((mark) => tick(mark.at_s, mark)));
    $("happened").replaceChildren(...line.marks.map((mark) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = this.#words(mark);
      button.onclick = () => this.seek(mark.at_s);
      const item = document.createElement("li");
      item.append(button);
      return item;
    }));
    $("happened-count").textContent = `(${line.marks.length})`;
    $("faults").textContent = [...line.faults.map(told), ...line.gaps.map((gap) =>
      `${this.#clock(gap.from_s)}–${this.#clock(gap.to_s)}: ${told(gap.words)}`)].join(" · ");
  }

  #words(mark) {
    const steps = mark.steps.slice(1).map((step) => {
      const by = step.by ? ` ${word("by")} ${step.by}` : "";
      return `${this.#clock(step.at_s)} ${word(step.stage)}${step.to ? ` ${step.to}` : ""}${by}`;
    });
    if (mark.awaited.length) steps.push(`${word("not_acknowledged")}: ${mark.awaited.join(", ")}`);
    return [`${this.#clock(mark.at_s)} ${word(mark.kind)}: ${mark.node_id}. ${told(mark.words)}`, ...steps].join("; ");
  }
}

/** Hours, minutes and seconds since the beginning. */
function elapsed(seconds) {
  const two = (value) => String(Math.floor(value)).padStart(2, "0");
  return `${Math.floor(seconds / 3600)}:${two((seconds / 60) % 60)}:${two(seconds % 60)}`;
}
