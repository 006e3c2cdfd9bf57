// The bar at the left: what a user can do to the scene, one button each; every one has a key, too.

import { addButton, icon } from "./button";
import type { Key } from "./keys";
import "./tools.css";

export interface Tool extends Key {
  shape: string; // path of its icon, 24 by 24
  pressed?: () => boolean; // of one that stays on
  ready?: () => boolean; // whether it can be used now
}

const OPENER = "M5 12h.01M12 12h.01M19 12h.01";

export class Tools {
  private readonly buttons: [Tool, HTMLButtonElement][];

  constructor(
    private readonly box: HTMLDetailsElement,
    tools: Tool[],
  ) {
    const bar = box.querySelector("nav")!;
    box.querySelector("summary")!.innerHTML = icon(OPENER);
    box.open = matchMedia("(width >= 700px) and (height >= 560px)").matches; // on a small screen it hides too much
    this.buttons = tools.map((tool) => {
      const button = addButton(bar, icon(tool.shape), `${tool.does} (${tool.shown})`, () => {
        tool.action();
        this.update();
      });
      return [tool, button];
    });
    this.update();
  }

  /** After anything that they depend on; without any that can be used there is no bar. */
  update(): void {
    let some = false;
    for (const [tool, button] of this.buttons) {
      const ready = tool.ready?.() ?? true;
      some ||= ready;
      if (button.disabled === ready) button.disabled = !ready;
      if (tool.pressed) button.ariaPressed = String(tool.pressed());
    }
    this.box.hidden = !some;
  }
}
