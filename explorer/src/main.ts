/** Entry of the page. */

import { App } from "./app";
import { readArrays, readWords } from "./data";
import { EquilibriumSet } from "./set";
import { h } from "./words";
import css from "./style.css";

async function begin(): Promise<void> {
  document.head.append(h("style", {}, css));
  const words = readWords(), set = new EquilibriumSet(words, await readArrays(words));
  const app = new App(set);
  app.view.resize();
  app.view.draw();
  document.documentElement.dataset.ready = String(Math.round(performance.now()));
  Object.assign(window, { explorer: app });
}

begin().catch((error: unknown) => {
  const webgl = /webgl/i.test(String(error));
  document.getElementById("explorer")!.append(h("p", { class: "verdict refused", role: "alert" },
    webgl ? "This page draws with WebGL, which this browser does not offer." : `The page cannot be shown: ${String(error)}`));
  document.documentElement.dataset.failed = String(error);
});
