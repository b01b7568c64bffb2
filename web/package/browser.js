// In a browser the WebAssembly has to come first: `await init()`.
import load from "./ohmstrain.js";

export default async function init(module = new URL("ohmstrain_bg.wasm", import.meta.url)) {
  await load({ module_or_path: module });
}
export * from "./ohmstrain.js";
