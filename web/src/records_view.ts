/** The records that this browser keeps: to download, to use as recordings, to remove. */

import { byId, h, save } from "./dom";
import { records, remove, text } from "./records";

let use: (name: string, bytes: Uint8Array) => void = () => {};

/** Says what a record is used for. */
export function onUse(listener: typeof use): void {
  use = listener;
}

/** Draws the list. */
export async function showRecords(): Promise<void> {
  const place = byId("records");
  const names = await records().catch(() => []);
  if (names.length === 0) {
    place.replaceChildren();
    return;
  }
  const row = (name: string) => {
    const act = (label: string, doing: () => Promise<void>) =>
      h("button", { type: "button", class: "small", "aria-label": `${label} ${name}`, click: () => void doing() }, label);
    return h(
      "li",
      {},
      name,
      " ",
      act("Download", async () => save(name, await text(name), "text/csv")),
      " ",
      act("Use as a recording", async () => use(name, new TextEncoder().encode(await text(name)))),
      " ",
      act("Remove", async () => {
        await remove(name);
        await showRecords();
      }),
    );
  };
  place.replaceChildren(h("h3", {}, "Records kept in this browser"), h("ul", {}, ...names.map(row)));
}
