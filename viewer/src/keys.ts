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
      const field = event.target;
      const typing = (field instanceof HTMLInputElement && !["checkbox", "range"].includes(field.type)) || field instanceof HTMLSelectElement;
      if (typing || event.altKey) return;
      const control = event.ctrlKey || event.metaKey;
      const name = `${control ? `ctrl+${event.shiftKey ? "shift+" : ""}` : ""}${event.key.toLowerCase()}`;
      const found = keys.find(({ key }) => key === name);
      if (!found || (event.target instanceof HTMLButtonElement && event.key === " ")) return;
      event.preventDefault();
      found.action();
    });
  }

  toggle(): void {
    if (this.overlay.open) this.overlay.close();
    else this.overlay.showModal();
  }
}
