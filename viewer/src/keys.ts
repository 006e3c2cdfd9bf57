// The keys, and the overlay that shows them.

export interface Key {
  key: string; // as in KeyboardEvent.key, in lower case; "ctrl+" and "shift+" before it
  shown: string;
  does: string;
  action: () => void;
}

const MOUSE: [string, string][] = [
  ["drag a particle", "pull it"],
  ["click a particle", "its numbers and springs"],
  ["drag beside it", "turn the camera"],
  ["right drag", "move the camera"],
  ["wheel, pinch", "zoom"],
];

export class Keys {
  constructor(
    private readonly overlay: HTMLDialogElement,
    keys: Key[],
  ) {
    const rows = [...keys.map(({ shown, does }) => [shown, does]), ...MOUSE];
    overlay.innerHTML = `<h2>Keys</h2><dl>${rows.map(([key, does]) => `<dt><kbd>${key}</kbd></dt><dd>${does}</dd>`).join("")}</dl>`;
    overlay.addEventListener("click", () => overlay.close());
    addEventListener("keydown", (event) => {
      if (event.altKey || takes(event.target, event.key)) return;
      const control = event.ctrlKey || event.metaKey;
      const name = `${control ? `ctrl+${event.shiftKey ? "shift+" : ""}` : ""}${event.key.toLowerCase()}`;
      const found = keys.find(({ key }) => key === name);
      if (!found) return;
      event.preventDefault();
      found.action();
    });
    letGo();
  }

  toggle(): void {
    if (this.overlay.open) this.overlay.close();
    else this.overlay.showModal();
  }
}

/** Whether what has the focus needs a key itself. */
function takes(target: EventTarget | null, key: string): boolean {
  if (target instanceof HTMLSelectElement) return true;
  if (target instanceof HTMLInputElement && !["checkbox", "range"].includes(target.type)) return true;
  return key === " " && target instanceof HTMLElement && target.matches("button, summary, [type=checkbox]");
}

/** Who works with a mouse does not expect that the last button, box or choice still has the focus, and takes the keys. */
function letGo(): void {
  let pressed: EventTarget | null = null;
  addEventListener("pointerdown", (event) => (pressed = event.target), { capture: true });
  addEventListener("keydown", () => (pressed = null), { capture: true });
  addEventListener("change", ({ target }) => target === pressed && target instanceof HTMLSelectElement && target.blur());
  addEventListener("click", ({ target, detail }) => {
    if (detail > 0 && target instanceof Element) target.closest<HTMLElement>("button, summary, [type=checkbox]")?.blur();
  });
}
