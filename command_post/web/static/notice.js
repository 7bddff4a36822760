// What somebody has to be told of at once, where it can be seen: a refusal, above all.
const SHOWN_MS = 15_000;
let timer = 0;

/** Show `text` for a while, and have it read out. */
export function tell(text) {
  const notice = document.getElementById("notice");
  clearTimeout(timer);
  notice.hidden = false;
  notice.textContent = text;
  notice.onclick = () => { notice.hidden = true; };
  timer = setTimeout(notice.onclick, SHOWN_MS);
}
