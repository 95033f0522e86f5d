/** Dark or light: as the address says, as was chosen here, or as the system has it. */

import type { Theme } from "./view";

const LIGHT: Theme = { ink: "#1a1a1a", faint: "#8c8c8c", paper: "#ffffff" };
const DARK: Theme = { ink: "#f0f0f0", faint: "#8c8c8c", paper: "#17191c" };

export class Appearance {
  /** What was chosen; empty for that of the system. */
  chosen = new URLSearchParams(location.hash.slice(1)).get("theme") ?? "";

  constructor(changed: () => void) {
    this.apply();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { this.apply(); changed(); });
  }

  private get dark(): boolean { return this.chosen ? this.chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches; }
  private apply(): void { document.documentElement.dataset.theme = this.dark ? "dark" : "light"; }
  get colours(): Theme { return this.dark ? DARK : LIGHT; }
  change(): void { this.chosen = this.dark ? "light" : "dark"; this.apply(); }
}
