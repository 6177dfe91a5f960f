// The report of kind "fit".

import { plain } from "./plain";

export function fit(data: unknown): void {
  plain(data);
}
