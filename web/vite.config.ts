import { readFileSync } from "node:fs";
import { defineConfig } from "vitest/config";
import type { Plugin } from "vite";
import { viteSingleFile } from "vite-plugin-singlefile";

/**
 * The WebAssembly as text, xz in Base64: the page is one file that works from a disk, and nothing is fetched. Compressed
 * again on its way, it is hardly larger than the bytes would be; xz takes a third less than gzip.
 */
function wasmAsText(): Plugin {
  const name = "virtual:wasm";
  return {
    name: "wasm-as-text",
    resolveId: (id) => (id === name ? `\0${name}` : undefined),
    load: (id) => {
      if (id !== `\0${name}`) return undefined;
      const bytes = readFileSync(new URL("pkg/ohmstrain_bg.wasm.xz", import.meta.url));
      return `export default "${bytes.toString("base64")}";`;
    },
  };
}

export default defineConfig({
  plugins: [wasmAsText(), viteSingleFile({ removeViteModuleLoader: true })],
  build: { target: "es2022", assetsInlineLimit: Number.MAX_SAFE_INTEGER, chunkSizeWarningLimit: 10_000 },
  worker: { format: "iife" },
  test: { include: ["tests/**/*.test.ts"], testTimeout: 900_000, hookTimeout: 120_000, fileParallelism: false },
});
