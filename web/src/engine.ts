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
    worker.onmessage = (event) => this.receive(event.data);
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

  private receive(message: { call: number; result?: never; error?: string; isPanic?: boolean; stage?: string; share?: number }) {
    if (message.stage !== undefined) {
      this.onProgress(message.stage, message.share ?? 0);
      return;
    }
    const waiting = this.waiting.get(message.call);
    this.waiting.delete(message.call);
    if (message.isPanic) this.isBroken = true;
    if (message.error === undefined) waiting?.resolve(message.result as never);
    else waiting?.reject(new Error(message.error));
  }
}
