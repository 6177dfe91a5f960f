// The image's buttons: freeze, distance, area, clear, compare.

import type { Tool } from "./calipers";
import { find, pressed, release } from "./dom";
import type { EchoView } from "./echo";

export class EchoTools {
  constructor(private readonly echo: EchoView) {
    this.wire("freeze", () => this.freeze());
    this.wire("measure-distance", (keyboard) => this.use("distance", keyboard));
    this.wire("measure-area", (keyboard) => this.use("area", keyboard));
    this.wire("measure-clear", () => echo.clearMeasures());
    this.wire("compare", () => this.compare());
    echo.measured = () => (find<HTMLButtonElement>("measure-clear").disabled = echo.measures.length === 0);
  }

  private wire(id: string, action: (keyboard: boolean) => void): void {
    find(id).onclick = (e) => {
      action(e.detail === 0);
      release(find(id));
    };
  }

  freeze(): void {
    this.echo.freeze(!this.echo.isFrozen);
    pressed("freeze", this.echo.isFrozen);
  }

  private compare(): void {
    this.echo.compare(!this.echo.isCompared);
    pressed("compare", this.echo.isCompared);
    document.body.classList.toggle("comparing", this.echo.isCompared); // the panel grows: two images stand in it
    if (!this.echo.isCompared && this.echo.isFrozen) this.freeze();
  }

  /** The tool that is on is put away by choosing it again. */
  private use(tool: Exclude<Tool, null>, keyboard: boolean): void {
    this.echo.use(this.echo.activeTool === tool ? null : tool, keyboard);
    pressed("measure-distance", this.echo.activeTool === "distance");
    pressed("measure-area", this.echo.activeTool === "area");
  }

  key(code: string): boolean {
    if (code === "KeyM") this.use("distance", true);
    else if (code === "KeyO") this.use("area", true);
    else if (code === "KeyB") this.compare();
    else if (code === "Delete" || code === "Backspace") this.echo.clearMeasures();
    else return false;
    return true;
  }
}
