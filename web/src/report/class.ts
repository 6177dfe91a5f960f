// The report of kind "class".

import { plain } from "./plain";

export function classReport(data: unknown): void {
  plain(data);
}
