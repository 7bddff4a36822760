// The way to the post: who we are, what changes, and what is asked for.
let token = "";

async function talk(path, body) {
  const answer = await fetch(`api/v1/${path}`, body === undefined ? {} : {
    method: "POST",
    headers: { "Content-Type": "application/json", "X-Clew-Token": token },
    body: JSON.stringify(body),
  }).catch(() => { throw new Error("the post does not answer"); });
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.error ?? answer.statusText);
  return told;
}

export async function whoAmI() {
  const me = await talk("me");
  token = me.token ?? "";
  return me;
}

export const signIn = (name, password) => talk("sign-in", { name, password });
export const signOut = () => talk("sign-out", {});
export const order = (kind, to, text) => talk("orders", { kind, to, text });
export const turnAlert = (number, stage, assigned_to = null) =>
  talk(`alerts/${number}`, { stage, assigned_to });

export const plan = () => talk("plan");
export const setOrigin = (origin) => talk("origin", origin);

/** A way now, or as it was so many seconds after a recording's beginning. */
export const wayOut = (id, at_s) => talk(`ways/out/${id}${then(at_s)}`);
export const rescue = (id, at_s) => talk(`ways/rescue/${id}${then(at_s)}`);
const then = (at_s) => (at_s === undefined ? "" : `?at_s=${at_s}`);

export const timeline = () => talk("timeline");
/** All that was shown so many seconds after a recording's beginning. */
export const moment = (at_s) => talk(`moment?at_s=${at_s}`);
/** What changed in `count` steps from there on. */
export const moments = (after_s, step_s, count) =>
  talk(`moments?after_s=${after_s}&step_s=${step_s}&count=${count}`);

export const comparison = () => talk("comparison");
export const compare = (wish) => talk("comparison", wish);
export const compared = () => talk("comparison/result");

/** Have `changed` called with what has changed, `linked` with whether there is a link, `ended` if there will be none. */
export function follow(changed, linked, ended) {
  const events = new EventSource("api/v1/events");
  events.addEventListener("changes", (event) => {
    changed(JSON.parse(event.data));
    linked(true);
  });
  events.addEventListener("open", () => linked(true));
  events.addEventListener("error", () => {
    linked(false);
    // Refused, not broken off: a browser does not try that again by itself.
    if (events.readyState === EventSource.CLOSED) ended();
  });
}
