/** A worker and what it is asked. */

import xzInBase64 from "virtual:wasm";
import { XzReadableStream } from "xz-decompress";
import type { Methods } from "./worker";
import ComputingWorker from "./worker?worker&inline";

let compiled: Promise<WebAssembly.Module> | undefined;

/** The compiled WebAssembly, once for all workers. */
function wasm(): Promise<WebAssembly.Module> {
  compiled ??= (async () => {
    const bytes = Uint8Array.from(atob(xzInBase64), (letter) => letter.charCodeAt(0));
    const unpacked = new XzReadableStream(new Blob([bytes]).stream());
    return WebAssembly.compile(await new Response(unpacked).arrayBuffer());
  })();
  return compiled;
}

interface Waiting {
  resolve: (result: never) => void;
  reject: (error: Error) => void;
}

/** The worker was ended before it answered. */
export class Cancelled extends Error {}

export class Engine {
  /** Is told where a calibration is. */
  onProgress: (stage: string, share: number) => void = () => {};
  /** A panic has ended it: it can answer nothing more. */
  isBroken = false;
  private readonly waiting = new Map<number, Waiting>();
  private calls = 0;

  private constructor(private readonly worker: Worker) {
    worker.onmessage = (event) => this.hear(event.data);
    worker.onerror = (event) => this.fail(new Error(event.message || "the worker stopped"));
  }

  static async start(): Promise<Engine> {
    const module = await wasm();
    const engine = new Engine(new ComputingWorker());
    engine.worker.postMessage({ module });
    return engine;
  }

  call<M extends keyof Methods>(method: M, ...args: Parameters<Methods[M]>): Promise<ReturnType<Methods[M]>> {
    const call = ++this.calls;
    return new Promise((resolve, reject) => {
      this.waiting.set(call, { resolve: resolve as (result: never) => void, reject });
      this.worker.postMessage({ call, method, args });
    });
  }

  /** Ends it, whatever it is doing. */
  terminate(): void {
    this.worker.terminate();
    this.fail(new Cancelled("cancelled"));
  }

  private fail(error: Error): void {
    this.isBroken = true;
    for (const { reject } of this.waiting.values()) reject(error);
    this.waiting.clear();
  }

  private hear(told: { call: number; result?: never; error?: string; isPanic?: boolean; stage?: string; share?: number }) {
    if (told.stage !== undefined) {
      this.onProgress(told.stage, told.share ?? 0);
      return;
    }
    const waiting = this.waiting.get(told.call);
    this.waiting.delete(told.call);
    if (told.isPanic) this.isBroken = true;
    if (told.error === undefined) waiting?.resolve(told.result as never);
    else waiting?.reject(new Error(told.error));
  }
}
