// "Copy as TOML": the server writes the scene as it is set now, the page puts it on the clipboard.

/** The text, or the server's sentence why there is none. */
export async function sceneText(): Promise<string> {
  const token = new URLSearchParams(location.search).get("token") ?? "";
  const answer = await fetch(`scene.toml?token=${encodeURIComponent(token)}`);
  const text = await answer.text();
  if (!answer.ok) throw new Error(text);
  return text;
}

export async function copyScene(): Promise<void> {
  const text = await sceneText();
  if (navigator.clipboard) return navigator.clipboard.writeText(text);
  // Browsers give the clipboard to pages of this machine and to encrypted ones only; an exposed page is neither.
  const area = document.createElement("textarea");
  area.value = text;
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  if (!done) throw new Error("the browser does not let this page use the clipboard");
}
