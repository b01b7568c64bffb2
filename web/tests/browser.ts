/** The page in Chromium, opened from the disk unless the program serves it. */

import { once } from "node:events";
import { existsSync, mkdirSync } from "node:fs";
import { fileURLToPath } from "node:url";
import axe from "axe-core";
import { type Browser, type BrowserContextOptions, type Page, chromium } from "playwright-core";
import { expect } from "vitest";
import { started } from "./program";

const PAGE = new URL("../dist/index.html", import.meta.url);
const PICTURES = process.env["OHMSTRAIN_PICTURES"] ?? fileURLToPath(new URL("../dist-pictures/", import.meta.url));
const NAMES = ["chromium", "chromium-browser", "google-chrome"];

function executable(): string {
  const found = NAMES.map((name) => `/usr/bin/${name}`).find(existsSync);
  if (!found) throw new Error("no Chromium: scripts/chromium.sh installs it");
  return found;
}

export async function launch(): Promise<Browser> {
  return chromium.launch({ executablePath: executable(), args: ["--no-sandbox", "--disable-dev-shm-usage"] });
}

/** The page, what it has asked of the network, and what it has complained of. */
export interface Opened {
  page: Page;
  requests: string[];
  complaints: string[];
}

/** The page's address, as the program serves it, and what stops it. */
export async function serve(): Promise<{ address: string; stop: () => void }> {
  const server = started("--quiet", "serve", fileURLToPath(PAGE), "--port", "0");
  const [printed] = await once(server.stdout, "data");
  return { address: String(printed).trim(), stop: () => server.kill() };
}

/** Opens the page; `before` runs in it before its own scripts. */
export async function open(browser: Browser, options: BrowserContextOptions = {}, before?: () => void, address = PAGE.href): Promise<Opened> {
  const context = await browser.newContext({ viewport: { width: 1100, height: 900 }, ...options });
  const page = await context.newPage();
  const [requests, complaints]: [string[], string[]] = [[], []];
  context.on("request", (request) => requests.push(request.url()));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  page.on("pageerror", (error) => complaints.push(error.message));
  if (before) await page.addInitScript(before);
  await page.goto(address);
  return { page, requests, complaints };
}

/** Gives the page a file, as if it were chosen. */
export async function drop(page: Page, ...files: { name: string; bytes: Uint8Array | string }[]): Promise<void> {
  const payload = files.map(({ name, bytes }) => ({ name, mimeType: "text/plain", buffer: Buffer.from(bytes) }));
  await page.setInputFiles("#files", payload);
}

/** What a click downloads. */
export async function download(page: Page, click: () => Promise<void>): Promise<Buffer> {
  const [taken] = await Promise.all([page.waitForEvent("download"), click()]);
  const stream = await taken.createReadStream();
  const pieces: Buffer[] = [];
  for await (const piece of stream) pieces.push(piece as Buffer);
  return Buffer.concat(pieces);
}

/** Names and sentences of a list of them, on one line. */
export async function lines(page: Page, selector: string): Promise<string> {
  const texts = await page.locator(`${selector} dt, ${selector} dd`).allTextContents();
  return texts.join(" ");
}

/** Nothing that keeps people out, by axe-core. */
export async function checkAccess(page: Page): Promise<void> {
  await page.evaluate(axe.source);
  const found = await page.evaluate(async () => {
    const run = (globalThis as unknown as { axe: { run: () => Promise<{ violations: { id: string; nodes: { html: string }[] }[] }> } }).axe.run;
    return (await run()).violations.map((one) => `${one.id}: ${one.nodes.map((node) => node.html).join(" ")}`);
  });
  expect(found).toEqual([]);
}

/** Takes a picture of the whole page, or of a part of it, for people to look at. */
export async function picture(page: Page, name: string, part?: string): Promise<void> {
  mkdirSync(PICTURES, { recursive: true });
  const path = `${PICTURES}/${name}.png`;
  if (part) await page.locator(part).screenshot({ path });
  else await page.screenshot({ path, fullPage: true });
}
