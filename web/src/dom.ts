/** Elements, made briefly. */

type Child = Node | string | undefined | false;
type Attributes = Record<string, string | number | boolean | ((event: Event) => void) | undefined>;

/** An element with attributes, listeners (functions, under the names of their events) and children. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(name, value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children.filter((child): child is Node | string => child !== undefined && child !== false));
  return element;
}

/** The element of the page with this id. */
export function byId(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no element #${id}`);
  return found;
}

/** A labelled drop-down. */
export function choice(
  label: string,
  options: [value: string, text: string][],
  value: string,
  chosen: (value: string) => void,
  hidesLabel = false,
): HTMLLabelElement {
  const items = options.map(([option, text]) => h("option", { value: option, selected: option === value }, text));
  const select = h("select", { change: (event) => chosen((event.target as HTMLSelectElement).value) }, ...items);
  return h("label", { class: "field" }, h("span", hidesLabel ? { class: "hidden" } : {}, label), select);
}

/** A labelled text field; `chosen` is called when it is left or Enter is pressed. */
export function field(
  label: string,
  value: string,
  chosen: (value: string) => void,
  more: Attributes = {},
): HTMLLabelElement {
  const input = h("input", { value, change: (event) => chosen((event.target as HTMLInputElement).value), ...more });
  return h("label", { class: "field" }, h("span", {}, label), input);
}

/** Names and sentences. */
export function sentences(lines: [string, string][]): HTMLDListElement {
  return h("dl", { class: "lines" }, ...lines.flatMap(([name, text]) => [h("dt", {}, name), h("dd", {}, text)]));
}

/** Warnings; nothing if there is none. */
export function warnings(texts: string[]): HTMLElement | undefined {
  if (texts.length === 0) return undefined;
  return h("ul", { class: "warnings" }, ...texts.map((text) => h("li", {}, `warning: ${text}`)));
}

/** Hands a file to the person. */
export function save(name: string, content: BlobPart, type = "application/octet-stream"): void {
  const url = URL.createObjectURL(new Blob([content], { type }));
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
