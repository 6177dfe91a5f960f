// The report of kind "scene".

import { plain } from "./plain";

export function scene(data: unknown): void {
  plain(data);
}
