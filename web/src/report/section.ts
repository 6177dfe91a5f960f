// The report of kind "section".

import { plain } from "./plain";

export function section(data: unknown): void {
  plain(data);
}
