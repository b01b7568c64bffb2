// In Node the WebAssembly is beside this file, and ready when this module is.
import { readFileSync } from "node:fs";
import { initSync } from "./ohmstrain.js";

initSync({ module: readFileSync(new URL("ohmstrain_bg.wasm", import.meta.url)) });

export default async function init() {}
export * from "./ohmstrain.js";
