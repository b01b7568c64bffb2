/** A board on a serial port, or a recording that is played as if it were one: whole lines, as they come. */

/** Whom a source tells what comes. */
export interface Listener {
  /** Whole lines, each with its end, and when they arrived, s. */
  lines(text: string, arrivedSeconds: number): void;
  /** The source is there. */
  connected(name: string): void;
  /** It is gone; why. */
  away(why: string): void;
}

/** A source that runs until it is stopped. */
export interface Source {
  stop(): Promise<void>;
}

/** Longest line that a device sends; what is longer is cut. */
const LONGEST_LINE = 8192;

/** Bytes as whole lines. */
export class LineSplitter {
  private begun = "";
  private readonly decoder = new TextDecoder();

  /** The lines that are complete now. */
  take(bytes: Uint8Array): string {
    const text = this.begun + this.decoder.decode(bytes, { stream: true });
    const end = text.lastIndexOf("\n") + 1;
    this.begun = text.slice(end).slice(0, LONGEST_LINE);
    return text.slice(0, end);
  }
}

/** True if this browser can open serial ports. */
export function hasSerial(): boolean {
  return "serial" in navigator;
}

/** Text for browsers without Web Serial. */
export const NO_SERIAL =
  "This browser cannot open serial ports. Chrome, Edge and Opera on a computer can; recordings can be played in any browser.";

/** Opens the port that a person chooses, and opens it again when it comes back. */
export async function openPort(baudRate: number, listener: Listener): Promise<Source> {
  const port = await navigator.serial.requestPort();
  const source = new PortSource(port, baudRate, listener);
  await source.open();
  return source;
}

class PortSource implements Source {
  private reader: ReadableStreamDefaultReader<Uint8Array> | undefined;
  private isStopped = false;

  constructor(
    private readonly port: SerialPort,
    private readonly baudRate: number,
    private readonly listener: Listener,
  ) {}

  async open(): Promise<void> {
    await this.port.open({ baudRate: this.baudRate });
    const { usbVendorId, usbProductId } = this.port.getInfo();
    const hexadecimal = (id: number | undefined) => (id ?? 0).toString(16).padStart(4, "0");
    this.listener.connected(usbVendorId ? `USB ${hexadecimal(usbVendorId)}:${hexadecimal(usbProductId)}` : "the port");
    void this.read();
  }

  async stop(): Promise<void> {
    this.isStopped = true;
    await this.reader?.cancel().catch(() => undefined);
    await this.port.close().catch(() => undefined);
  }

  private async read(): Promise<void> {
    const splitter = new LineSplitter();
    let why = "it was unplugged";
    try {
      this.reader = this.port.readable?.getReader();
      for (;;) {
        const { value, done } = (await this.reader?.read()) ?? { done: true, value: undefined };
        if (done || !value) break;
        const lines = splitter.take(value);
        if (lines !== "") this.listener.lines(lines, performance.now() / 1000);
      }
    } catch (error) {
      why = error instanceof Error ? error.message : String(error);
    }
    this.reader?.releaseLock();
    if (this.isStopped) return;
    await this.port.close().catch(() => undefined);
    this.listener.away(why);
    navigator.serial.addEventListener("connect", () => void this.reopen(), { once: true });
  }

  private async reopen(): Promise<void> {
    if (!this.isStopped) await this.open().catch((error: Error) => this.listener.away(error.message));
  }
}

/** Plays the text of a trace CSV, `speed` times as fast as it was recorded. */
export function play(csv: string, time: Float64Array, speed: number, listener: Listener): Source {
  const lines = csv.split("\n").filter((line) => line !== "");
  const head = lines.length - time.length;
  listener.lines(`${lines.slice(0, head).join("\n")}\n`, 0);
  listener.connected("the recording");
  const start = performance.now();
  let next = 0;
  const due = () => {
    const now = (time[0] ?? 0) + ((performance.now() - start) / 1000) * speed;
    const from = next;
    while (next < time.length && (time[next] ?? 0) <= now) next += 1;
    if (next > from) listener.lines(`${lines.slice(head + from, head + next).join("\n")}\n`, performance.now() / 1000);
    if (next === time.length) {
      clearInterval(timer);
      listener.away("the recording has ended");
    }
  };
  const timer = setInterval(due, 16);
  return { stop: async () => clearInterval(timer) };
}
