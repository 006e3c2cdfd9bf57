// Dark and light: the page's colours are in style.css, those of the picture here, in linear light.

export interface Theme {
  name: "dark" | "light";
  bottom: [number, number, number];
  top: [number, number, number];
  ambient: number;
  pool: number; // size of the pool of light, which is a fog where the backdrop is bright
  glows: boolean; // light adds up; on a bright backdrop it could not be seen
}

export const THEMES: Record<Theme["name"], Theme> = {
  dark: { name: "dark", bottom: [0.0105, 0.015, 0.024], top: [0.003, 0.0042, 0.0085], ambient: 0.34, pool: 1, glows: true },
  light: { name: "light", bottom: [0.62, 0.66, 0.7], top: [0.8, 0.86, 0.92], ambient: 0.6, pool: 1.6, glows: false },
};

const KEY = "pointmass theme";

export function firstTheme(): Theme {
  const stored = localStorage.getItem(KEY);
  return stored === "light" ? THEMES.light : THEMES.dark;
}

export function other(theme: Theme): Theme {
  const next = theme.name === "dark" ? THEMES.light : THEMES.dark;
  localStorage.setItem(KEY, next.name);
  return next;
}
