// The token of the page's address: whoever has it can take part. It is taken out of the address at once, so
// that nobody reads it over a shoulder or in a copied link, and kept for this tab.

const KEY = "sonde.token";
const CLIENT_KEY = "sonde.client";
const FORM = /^#([0-9a-f]{32})$/;

let kept = "";

/** Takes a token that stands in the address; true when there was one. */
export function takeToken(): boolean {
  const found = FORM.exec(location.hash)?.[1];
  if (!found) return false;
  kept = found;
  try {
    sessionStorage.setItem(KEY, found);
  } catch {
    // private mode: a reload asks for the address again
  }
  history.replaceState(null, "", location.pathname + location.search);
  return true;
}

/** A name that no other page has: 32 hexadecimal digits. */
export const freshId = (): string => [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");

/** The program's WebSocket beside a page: this one, or that of a place of a class ("3/"). */
export function socketAddress(client: string, place = ""): URL {
  const at = new URL(`${place}ws?client=${client}`, location.href.replace(/^http/, "ws"));
  at.hash = "";
  return at;
}

/** What this page calls itself, the same after a reload: so it gets back what was its own. */
export function clientId(): string {
  const fresh = freshId();
  try {
    const known = sessionStorage.getItem(CLIENT_KEY) ?? fresh;
    sessionStorage.setItem(CLIENT_KEY, known);
    return known;
  } catch {
    return fresh;
  }
}

/** Empty when this tab was never given one. */
export function token(): string {
  try {
    return kept || (sessionStorage.getItem(KEY) ?? "");
  } catch {
    return kept;
  }
}

/** Whether the program is there and does not know this page's token. */
export async function isStranger(): Promise<boolean> {
  try {
    const answer = await fetch("status.json", { headers: { Authorization: `Bearer ${token()}` }, cache: "no-store" });
    return answer.status === 401;
  } catch {
    return false; // not there
  }
}
