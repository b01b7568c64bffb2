/** A board that is played by a mock of Web Serial: its readings become strain, and a record that outlives cable and tab. */

import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { checkAccess, download, drop, launch, open, picture } from "./browser";
import { Folder, simulated } from "./program";

let browser: Browser;
const folder = new Folder();
beforeAll(async () => {
  browser = await launch();
  folder.put("trace.csv", simulated(folder, 3));
  folder.run("calibrate", "trace.csv", "-o", "sensor.toml", "--estimator", "sign-split");
});
afterAll(() => browser.close());

/** A board in the page: `board.send` sends text, `board.unplug` pulls the cable, `board.plug` puts it in again. */
function mock(): void {
  let control: ReadableStreamDefaultController<Uint8Array> | undefined;
  const serial = new EventTarget();
  const port = {
    readable: undefined as ReadableStream<Uint8Array> | undefined,
    open: async () => {
      port.readable = new ReadableStream({ start: (controller) => void (control = controller) });
    },
    close: async () => {
      port.readable = undefined;
    },
    getInfo: () => ({ usbVendorId: 0x2341, usbProductId: 0x0043 }),
  };
  Object.assign(serial, { requestPort: async () => port, getPorts: async () => [port] });
  Object.defineProperty(navigator, "serial", { value: serial, configurable: true });
  Object.assign(globalThis, {
    board: {
      send: (text: string) => control?.enqueue(new TextEncoder().encode(text)),
      unplug: () => control?.error(new DOMException("The device has been lost.", "NetworkError")),
      plug: () => serial.dispatchEvent(new Event("connect")),
    },
  });
}

async function connected(sensor = folder.get("sensor.toml")): Promise<Page> {
  const { page } = await open(browser, {}, mock);
  await drop(page, { name: "sensor.toml", bytes: sensor });
  await page.locator("#connect").click();
  await page.getByText("reading USB 2341:0043").waitFor();
  return page;
}

const send = (page: Page, text: string) =>
  page.evaluate((it) => (globalThis as unknown as { board: { send: (text: string) => void } }).board.send(it), text);
const tell = (page: Page, what: "plug" | "unplug") =>
  page.evaluate((it) => (globalThis as unknown as { board: Record<string, () => void> }).board[it]?.(), what);

/** Lines of the trace: time and reading, as a board prints them. */
function boardLines(): string[] {
  const rows = folder.get("trace.csv").toString().split("\n").filter((line) => /^\d/.test(line));
  return rows.map((row) => row.split(",").slice(0, 2).join(","));
}

test("what a board sends is filtered as the command line filters it, recorded, and kept when the cable is pulled", async () => {
  const page = await connected();
  const all = boardLines().slice(0, 600);
  await send(page, "booting\r\ntime_s,resistance_ohm\r\n");
  await send(page, `${all.slice(0, 10).join("\r\n")}\r\n`);
  await expect.poll(() => page.locator("#live-result .hint").nth(1).textContent()).toContain("10 rows");
  await page.locator("#record").click();
  await page.getByText("Stop recording").waitFor();
  // In pieces that end within lines.
  const text = `${all.slice(10).join("\r\n")}\r\n`;
  for (let at = 0; at < text.length; at += 997) await send(page, text.slice(at, at + 997));
  await expect.poll(() => page.locator("#live-result .hint").nth(1).textContent()).toContain("600 rows");
  folder.put("sent.csv", `time_s,resistance_ohm\n${all.join("\n")}\n`);
  folder.run("filter", "sent.csv", "--sensor", "sensor.toml", "-o", "estimates.csv");
  const last = (folder.get("estimates.csv").toString().trim().split("\n").at(-1) ?? "").split(",").map(Number);
  const shown = `${(100 * (last[2] ?? 0)).toFixed(2)} ± ${(196 * (last[3] ?? 0)).toFixed(2)} %`;
  await expect.poll(() => page.locator(".value").textContent()).toBe(shown);
  await checkAccess(page);
  await picture(page, "page-live");
  await tell(page, "unplug");
  await page.getByText("no more comes: The device has been lost").waitFor();
  // The tab is closed without another word; another one still has the record.
  const other = await page.context().newPage();
  await page.close();
  await other.goto(page.url());
  const record = await download(other, () => other.getByText("Download", { exact: true }).click());
  const rows = record.toString().trim().split("\n").filter((line) => /^\d/.test(line));
  expect(rows).toEqual(all.slice(10).map((line) => line.split(",").map((cell) => String(Number(cell))).join(",")));
  folder.put("record.csv", record);
  folder.run("filter", "record.csv", "--sensor", "sensor.toml", "-o", "again.csv");
});

test("a board comes back, restarts, is at rest, and is zeroed", async () => {
  const page = await connected();
  const all = boardLines();
  await send(page, `time_s,resistance_ohm\n${all.slice(0, 50).join("\n")}\n`);
  await page.locator("#rest").click();
  await page.getByText("the strain is zero now").waitFor();
  await page.locator("#zero").click();
  await page.getByText(/R0 is [\d.]+ now, the median of \d+ readings; it starts again at zero/).waitFor();
  await tell(page, "unplug");
  await page.getByText("no more comes").waitFor();
  await tell(page, "plug");
  await page.getByText("reading USB 2341:0043").waitFor();
  await send(page, `time_s,resistance_ohm\n${all.slice(0, 20).join("\n")}\n`);
  await page.getByText("1 restarts").waitFor();
});

test("a record begins anew after another header or with another clock, and the earlier ones are kept", async () => {
  const page = await connected();
  const all = boardLines();
  const counts = () => page.locator("#live-result .hint").nth(1).textContent();
  await send(page, `time_s,resistance_ohm\n${all.slice(0, 50).join("\n")}\n`);
  await expect.poll(counts).toContain("50 rows");
  await page.locator("#record").click();
  await page.getByText("Stop recording").waitFor();
  const warm = (rows: string[]) => rows.map((row) => `${row},31.5`);
  const header = "time_s,resistance_ohm,temperature_c";
  // The end of one record and the beginning of the next come in one piece.
  await send(page, `${all.slice(50, 60).join("\n")}\n${header}\n${warm(all.slice(20, 40)).join("\n")}\n`);
  await page.getByText(/another clock or header: recording to live-.*-part2\.csv; live-.*\.csv is kept/).waitFor();
  // The third row of an earlier time says that the clock has begun anew.
  await send(page, `${warm(all.slice(0, 10)).join("\n")}\n`);
  await page.getByText(/recording to live-.*-part3\.csv; live-.*-part2\.csv is kept/).waitFor();
  await expect.poll(counts).toContain("88 rows");
  await page.locator("#record").click();
  const record = async (name: RegExp) => {
    const text = (await download(page, () => page.getByLabel(name).click())).toString().trim();
    return text.split("\n").filter((line) => !line.startsWith("#"));
  };
  const numbers = (rows: string[]) => rows.map((line) => line.split(",").map((cell) => String(Number(cell))).join(","));
  expect(await record(/^Download live-[^p]*\.csv$/)).toEqual(["time_s,resistance_ohm", ...numbers(all.slice(50, 60))]);
  expect(await record(/^Download .*-part2\.csv$/)).toEqual([header, ...numbers(warm(all.slice(20, 40)))]);
  expect(await record(/^Download .*-part3\.csv$/)).toEqual([header, ...numbers(warm(all.slice(2, 10)))]);
});

test("a stream without a header is asked about", async () => {
  const page = await connected();
  const lines = boardLines().map((line) => {
    const [time, reading] = line.split(",");
    return `${Math.round(1000 * Number(time))},${reading}`;
  });
  await send(page, `${lines.slice(0, 12).join("\n")}\n`);
  await page.getByText("what are its columns?").waitFor();
  expect(await page.getByLabel("Column 1").inputValue()).toBe("time_ms");
  await page.locator("#columns").click();
  await send(page, `${lines.slice(12, 40).join("\n")}\n`);
  await page.getByText(/time_s, resistance_ohm: 28 rows/).waitFor();
});

test("a thousand rows a second keep the page moving", async () => {
  const page = await connected();
  await send(page, "time_s,resistance_ohm\n");
  const devtools = await page.context().newCDPSession(page);
  await devtools.send("Performance.enable", { timeDomain: "threadTicks" });
  const busy = async () => {
    const { metrics } = await devtools.send("Performance.getMetrics");
    return metrics.find((metric) => metric.name === "TaskDuration")?.value ?? 0;
  };
  // Asking for each frame takes time of its own: the share of a core is measured without.
  for (const [rate, name] of [[1000, "1 kHz"], [100, "100 Hz"], [0.001, "no rows"]] as const) {
    const { frames, longest } = await page.evaluate(measure, { rate, isCounting: true });
    const before = await busy();
    const { seconds } = await page.evaluate(measure, { rate, isCounting: false });
    const share = (100 * ((await busy()) - before)) / seconds;
    console.log(`${name}: ${frames.toFixed(0)} frames a second, the longest ${longest.toFixed(0)} ms; ${share.toFixed(0)} % of a core for the page's thread`);
  }
});

/** Sends rows for three seconds; frames that were drawn, if they are counted. */
async function measure({ rate, isCounting }: { rate: number; isCounting: boolean }) {
  const board = (globalThis as unknown as { board: { send: (text: string) => void } }).board;
  const state = globalThis as unknown as { sentUntil?: number };
  const [begin, from] = [performance.now(), state.sentUntil ?? 0];
  let [sent, frames, longest, last, isRunning] = [0, 0, 0, begin, true];
  const frame = (now: number) => {
    frames += 1;
    longest = Math.max(longest, now - last);
    last = now;
    if (isRunning) requestAnimationFrame(frame);
  };
  if (isCounting) requestAnimationFrame(frame);
  while (performance.now() - begin < 3000) {
    let text = "";
    for (const due = Math.floor(((performance.now() - begin) / 1000) * rate); sent < due; sent += 1) {
      const time = from + (sent + 1) / rate;
      text += `${time.toFixed(4)},${(3500 + 300 * Math.sin(time)).toFixed(2)}\n`;
    }
    if (text) board.send(text);
    await new Promise((wake) => setTimeout(wake, 10));
  }
  isRunning = false;
  state.sentUntil = from + (sent + 1) / rate;
  const seconds = (performance.now() - begin) / 1000;
  return { frames: frames / seconds, longest, seconds };
}

test("where there is no Web Serial the page says who has it, and plays files", async () => {
  const hide = () => {
    delete (Navigator.prototype as { serial?: unknown }).serial;
  };
  const { page } = await open(browser, {}, hide);
  await drop(page, { name: "sensor.toml", bytes: folder.get("sensor.toml") });
  await page.getByText("Chrome, Edge and Opera on a computer can").waitFor();
  await drop(page, { name: "trace.csv", bytes: folder.get("trace.csv") });
  await page.getByLabel("Speed").selectOption("50");
  await page.locator("#play").click();
  await page.getByText(/resistance_ohm, strain: \d{3,} rows/).waitFor();
});
