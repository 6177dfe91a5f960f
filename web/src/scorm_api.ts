// The run-time interface of SCORM 1.2 (ADL 2001, section 3): an object that a learning management system puts into
// a window above this page or above the one that opened it. All values are texts; errors are the system's to keep.

interface Api {
  LMSInitialize(none: ""): string;
  LMSGetValue(element: string): string;
  LMSSetValue(element: string, value: string): string;
  LMSCommit(none: ""): string;
  LMSFinish(none: ""): string;
}

type Holder = Window & { API?: Api };

const MOST_ABOVE = 10; // windows; a system nests fewer

function above(from: Holder): Api | null {
  let at = from;
  for (let k = 0; k < MOST_ABOVE; ++k) {
    try {
      if (at.API) return at.API;
    } catch {
      return null; // a window of another site
    }
    if (at.parent === at) return null;
    at = at.parent as Holder;
  }
  return null;
}

/** One attempt at this page, from LMSInitialize to LMSFinish; values are kept by `commit`. */
export class Attempt {
  private ended = false;

  private constructor(private readonly api: Api) {}

  /** Null where no learning management system holds the page. */
  static begin(): Attempt | null {
    let api = above(window);
    if (!api && window.opener) api = above(window.opener as Holder);
    return api?.LMSInitialize("") === "true" ? new Attempt(api) : null;
  }

  get(element: string): string {
    return this.api.LMSGetValue(element);
  }

  set(element: string, value: string | number): void {
    this.api.LMSSetValue(element, String(value));
  }

  commit(): void {
    this.api.LMSCommit("");
  }

  end(): void {
    if (this.ended) return;
    this.ended = true;
    this.api.LMSCommit("");
    this.api.LMSFinish("");
  }
}

/** CMITimespan: "0012:03:04.50". */
export function timespan(seconds: number): string {
  const hundredths = Math.round(100 * seconds);
  const two = (n: number): string => String(n).padStart(2, "0");
  const s = Math.floor(hundredths / 100);
  return `${String(Math.floor(s / 3600)).padStart(4, "0")}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}.${two(hundredths % 100)}`;
}
