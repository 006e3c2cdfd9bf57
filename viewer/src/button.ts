// Buttons with an icon, and what closes a card.

/** Of a path, 24 by 24. */
export function icon(path: string): string {
  return `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${path}"/></svg>`;
}

/** A button at the end of a bar, with a label for people and for readers of the screen. */
export function addButton(bar: HTMLElement, content: string, label: string, action: () => void): HTMLButtonElement {
  const made = document.createElement("button");
  made.type = "button";
  made.title = made.ariaLabel = label;
  made.innerHTML = content;
  made.addEventListener("click", action);
  bar.append(made);
  return made;
}

/** The title of a card, with a button that closes it. */
export function addHead(card: HTMLElement, title: string, label: string, close: () => void): void {
  const head = document.createElement("header"), name = document.createElement("b");
  name.textContent = title;
  head.append(name);
  addButton(head, "×", label, close);
  card.append(head);
}
