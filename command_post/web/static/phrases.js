// What the post says in English, said in another language: each phrase has a code, and parameters.
// English is what the record has; a phrase that is not in the catalogue comes as it is.
import { languageNow } from "./words.js";

const MOST_KEPT = 2000;
const PARAMETER = /\{(\w+)\}/g;
let phrases = [];
const kept = new Map();

const escaped = (text) => text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");

/** Fetch the catalogue. */
export async function loadPhrases() {
  const told = await (await fetch("phrases.json")).json();
  phrases = Object.values(told).map((phrase) => ({ ...phrase, ...matcher(phrase.en) }));
  // What says more is tried first.
  phrases.sort((one, other) => other.literal - one.literal);
  kept.clear();
}

function matcher(english) {
  const pieces = english.split(PARAMETER);
  const names = pieces.filter((_, index) => index % 2);
  const source = pieces.map((piece, index) => (index % 2 ? "(.+?)" : escaped(piece))).join("");
  return { names, pattern: new RegExp(`^${source}$`), literal: english.replace(PARAMETER, "").length };
}

/** What the post says, in the language that was chosen. */
export function told(text) {
  if (!text || languageNow() === "en") return text;
  const key = `${languageNow()} ${text}`;
  if (!kept.has(key)) {
    if (kept.size >= MOST_KEPT) kept.clear();
    kept.set(key, said(text, languageNow()));
  }
  return kept.get(key);
}

function said(text, language) {
  for (const { pattern, names, [language]: other } of phrases) {
    const found = other && pattern.exec(text);
    if (!found) continue;
    const values = Object.fromEntries(names.map((name, index) => [name, said(found[index + 1], language)]));
    return other.replace(PARAMETER, (_, name) => values[name]);
  }
  for (const between of ["; ", ", "]) {
    if (text.includes(between)) return text.split(between).map((part) => said(part, language)).join(between);
  }
  return text;
}
