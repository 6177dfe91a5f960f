// What the operator asked for and the program has not told of yet. A step starts from it, so that keys which come
// quicker than the program's answers add up.

const PATIENCE_MS = 4000; // an answer that has not come by then does not come: the wish was refused
const SAME = 1e-3; // what is told has been through single precision

function same(a: unknown, b: unknown): boolean {
  if (typeof a === "number" && typeof b === "number") return Math.abs(a - b) <= SAME;
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((v, i) => same(v, b[i]));
  return a === b;
}

interface Asked {
  values: unknown[]; // in the order in which they were asked for
  at_ms: number;
}

/** Values by name: those that were asked for, over those that the program told last. */
export class Wishes<T extends object> {
  private told: Partial<T> = {};
  private readonly asked = new Map<keyof T, Asked>();

  /** Remembers what is asked for, and gives it back to be sent. */
  ask<P extends Partial<T>>(part: P): P {
    for (const key of Object.keys(part) as (keyof T)[]) {
      const before = this.pending(key);
      this.asked.set(key, { values: [...(before?.values ?? []), part[key as keyof P]], at_ms: performance.now() });
    }
    return part;
  }

  /** What the program says. An answer fulfils its wish and those before it; a value that nobody here asked for ends all of that name. */
  tell(told: Partial<T>): void {
    for (const key of Object.keys(told) as (keyof T)[]) {
      const asked = this.asked.get(key);
      if (!asked || same(told[key], this.told[key])) continue;
      const at = asked.values.findIndex((v) => same(v, told[key]));
      asked.values = at < 0 ? [] : asked.values.slice(at + 1);
      if (asked.values.length === 0) this.asked.delete(key);
    }
    this.told = { ...told };
  }

  get<K extends keyof T>(key: K): T[K] | undefined {
    const asked = this.pending(key);
    return asked ? (asked.values[asked.values.length - 1] as T[K]) : this.told[key];
  }

  forget(): void {
    this.asked.clear();
  }

  private pending(key: keyof T): Asked | undefined {
    const asked = this.asked.get(key);
    if (asked && performance.now() - asked.at_ms > PATIENCE_MS) this.asked.delete(key);
    return this.asked.get(key);
  }
}
