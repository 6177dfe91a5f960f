// The report of kind "exam".

import { plain } from "./plain";

export function exam(data: unknown): void {
  plain(data);
}
