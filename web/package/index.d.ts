/**
 * Makes the WebAssembly ready; everything else waits for it. In Node it is ready already.
 * `module` is where it is, its bytes or its compiled module, if it is not beside this package.
 */
export default function init(module?: URL | string | BufferSource | WebAssembly.Module): Promise<void>;
export * from "./ohmstrain.js";
