/** What a person does on the page, through its own controls; every number is compared with the command line's. */

import { execFileSync } from "node:child_process";
import { mkdirSync } from "node:fs";
import { dirname } from "node:path";
import { unzipSync } from "fflate";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { checkAccess, download, drop, launch, lines, open, picture, serve } from "./browser";
import { Folder, nasty, simulated, withoutSeconds } from "./program";

let browser: Browser;
beforeAll(async () => {
  browser = await launch();
});
afterAll(() => browser.close());

test("a nasty lab file becomes a calibrated sensor and firmware, all as the command line makes them", async () => {
  const started = performance.now();
  const folder = new Folder();
  const lab = nasty(simulated(folder, 3), 30);
  folder.put("pruefstand.csv", lab);
  const steps = new Steps();
  const { page, requests, complaints } = await steps.take("open the page", () => open(browser));
  await steps.take("drop the file", async () => {
    await drop(page, { name: "pruefstand.csv", bytes: lab });
    await page.locator(".question").waitFor();
  });

  // It asks what the command line asks, and reads again once it is answered.
  const question = folder.refusal("import", "pruefstand.csv", "-o", "trace.csv");
  await expect.poll(() => page.locator(".question").textContent()).toBe(question);
  await steps.take("answer its question, see the plot", async () => {
    await page.locator("input[name=length]").fill("30");
    await page.locator("input[name=length]").press("Enter");
    await page.locator(".plot canvas").first().waitFor();
  });
  expect(await page.locator(".question").count()).toBe(0);
  const printed = folder.run("inspect", "pruefstand.csv", "--gauge-length-mm", "30");
  await page.locator("#recordings .lines").waitFor();
  for (const text of await page.locator("#recordings .lines dd").allTextContents()) expect(printed).toContain(text);
  const command = (await page.locator("code").first().textContent()) ?? "";
  folder.run(...words(command).slice(1), "-o", "trace.csv");
  const trace = await download(page, () => page.getByText("Download trace.csv").click());
  expect(trace.equals(folder.get("trace.csv"))).toBe(true);

  await steps.take("calibrate", async () => {
    await page.locator("#start").click();
    await page.locator("#verdict").waitFor({ timeout: 600_000 });
  });
  const closing = folder.run("calibrate", "trace.csv", "-o", "sensor.toml", "--report", "report.html", "--figures", "figures");
  expect(withoutSeconds(await lines(page, "#verdict"))).toBe(withoutSeconds(closing));
  const toml = await download(page, () => page.locator("#save-sensor").click());
  expect(toml.toString()).toBe(folder.get("sensor.toml").toString());
  expect(await page.getByText("Left out: each quarter").count()).toBe(1);

  const filtered = await steps.take("filter and smooth", async () => {
    await page.getByText("Filter and smooth").click();
    return download(page, () => page.getByText("Download estimates.csv").click());
  });
  folder.run("filter", "trace.csv", "--sensor", "sensor.toml", "-o", "filtered.csv");
  expect(filtered.equals(folder.get("filtered.csv"))).toBe(true);
  const smoothed = await download(page, () => page.getByText("Download smoothed.csv").click());
  folder.run("smooth", "trace.csv", "--sensor", "sensor.toml", "-o", "smoothed.csv");
  expect(smoothed.equals(folder.get("smoothed.csv"))).toBe(true);
  const reported = () => download(page, () => page.getByText("Download report and figures").click());
  const report = unzipSync(await steps.take("save report and figures", reported));
  for (const [name, bytes] of Object.entries(report)) expect(Buffer.from(bytes).equals(folder.get(name)), name).toBe(true);

  await steps.take("make firmware", async () => {
    await page.locator("#make-firmware").click();
    await page.locator(".costs").waitFor();
  });
  await checkAccess(page);
  await picture(page, "page-light");
  await picture(page, "readme", "section[aria-labelledby=step-2]");
  const zip = await steps.take("save it", () => download(page, () => page.locator("#save-firmware").click()));
  const step = await page.getByLabel("Time between two readings, s").inputValue();
  folder.run("export", "--sensor", "sensor.toml", "--target", "c", "--dt-s", step, "-o", "firmware");
  compileAndTest(folder, zip);

  expect(complaints).toEqual([]);
  expect(requests.filter((url) => !/^(file|blob|data):/.test(url))).toEqual([]);
  console.log(`a lab file to firmware: ${steps.text()}; with the command line beside it ${((performance.now() - started) / 1000).toFixed(0)} s`);
});

/** Seconds of each step of a person's work, without those of the test beside it. */
class Steps {
  readonly #taken: [string, number][] = [];

  async take<T>(name: string, step: () => Promise<T>): Promise<T> {
    const start = performance.now();
    const done = await step();
    this.#taken.push([name, (performance.now() - start) / 1000]);
    return done;
  }

  text(): string {
    const all = this.#taken.reduce((sum, [, seconds]) => sum + seconds, 0);
    return [...this.#taken, ["all", all] as const].map(([name, seconds]) => `${name} ${seconds.toFixed(1)} s`).join(", ");
  }
}

/** The words of a command as a shell takes them. */
function words(command: string): string[] {
  return execFileSync("sh", ["-c", `for word in ${command}; do printf '%s\\n' "$word"; done`], { encoding: "utf8" }).trim().split("\n");
}

/** The files of a zip are those of `ohmstrain export`; compiled, they pass their own test. */
function compileAndTest(folder: Folder, zip: Buffer): void {
  for (const [name, bytes] of Object.entries(unzipSync(zip))) {
    const path = name.replace(/^ohmstrain\//, "unpacked/");
    mkdirSync(dirname(folder.at(path)), { recursive: true });
    folder.put(path, bytes);
    expect(Buffer.from(bytes).equals(folder.get(path.replace("unpacked/", "firmware/"))), name).toBe(true);
  }
  const at = (path: string) => folder.at(`unpacked/${path}`);
  execFileSync("cc", ["-std=c99", "-O2", "-I", at("src"), at("src/ohmstrain.c"), at("selftest/selftest.c"), "-lm", "-o", folder.at("selftest")]);
  console.log(execFileSync(folder.at("selftest"), { encoding: "utf8" }).trim());
}

test("a hundred thousand rows are plotted soon", async () => {
  const rows = Array.from({ length: 100_000 }, (_, k) => `${(k / 100).toFixed(2)},${(1000 + 300 * Math.sin(k / 300)).toFixed(3)},${(0.15 - 0.15 * Math.cos(k / 300)).toFixed(5)}`);
  const { page } = await open(browser);
  await page.waitForTimeout(1000);
  const start = performance.now();
  await drop(page, { name: "long.csv", bytes: `Time (s),R (Ohm),Strain\n${rows.join("\n")}\n` });
  await page.locator("#recordings .plot canvas").waitFor();
  console.log(`first plot of 100 000 rows: ${((performance.now() - start) / 1000).toFixed(2)} s`);
  await page.locator("#recordings .lines").waitFor();
  console.log(`and all that is known of them: ${((performance.now() - start) / 1000).toFixed(2)} s`);
});

test("several channels are several sensors", async () => {
  const folder = new Folder();
  const rows = simulated(folder, 5).split("\n").filter((line) => /^\d/.test(line)).map((line) => line.split(",").map(Number));
  const second = rows.map(([time, ohm, strain]) => `${time};${ohm};${(0.8 * (ohm ?? 0) + 300).toFixed(2)};${100 * (strain ?? 0)}`);
  folder.put("two.csv", `Time (s);R left (Ohm);R right (Ohm);Strain (%)\n${second.join("\n")}\n`);
  const { page } = await open(browser);
  await drop(page, { name: "two.csv", bytes: folder.get("two.csv") });
  await page.getByText("A recording of each of the 2").click();
  await expect.poll(() => page.locator("#recordings .plot canvas").count()).toBe(2);
  await checkAccess(page);
  await page.getByLabel("Estimator").selectOption("ekf");
  for (const channel of ["R left (Ohm)", "R right (Ohm)"]) {
    await page.locator("#calibrate-controls label", { hasText: "Sensor" }).locator("select").selectOption(channel);
    await page.locator("#start").click();
    await page.locator("#verdict").waitFor();
    folder.run("import", "two.csv", "--column", `resistance=${channel}`, "-o", "two.trace.csv", "--force");
    folder.run("calibrate", "two.trace.csv", "--estimator", "ekf", "-o", "sensor.toml", "--force");
    const toml = await download(page, () => page.locator("#save-sensor").click());
    const law = (text: string) => text.slice(text.indexOf("[law]"), text.indexOf("[[recordings]]"));
    expect(law(toml.toString())).toBe(law(folder.get("sensor.toml").toString()));
    // It is filtered with its own readings only.
    expect(await page.locator("#use-controls option").allTextContents()).toEqual([`two.csv, ${channel}`]);
    await page.locator("#verdict").evaluate((verdict) => verdict.remove());
  }
  await picture(page, "page-channels");
});

test("a file that is refused is refused in the words of the command line", async () => {
  const folder = new Folder();
  folder.put("picture.csv", Buffer.from([0x89, 0x50, 0x4e, 0x47, 0, 1, 2, 3, 0, 0, 0, 255]));
  folder.put("words.csv", "name,colour\nfelt,grey\nsilk,red\n");
  const { page } = await open(browser);
  for (const name of ["picture.csv", "words.csv"]) {
    await drop(page, { name, bytes: folder.get(name) });
    await expect.poll(() => page.locator(".error, .question").last().textContent()).toBe(folder.refusal("import", name));
  }
  await checkAccess(page);
});

test("the program serves the page, and nothing else is asked for", async () => {
  const { address, stop } = await serve();
  try {
    const { page, requests, complaints } = await open(browser, {}, undefined, address);
    await page.locator("#example").click();
    await page.locator("#recordings .plot canvas").waitFor();
    expect(requests.filter((url) => !/^(blob|data):/.test(url))).toEqual([address]);
    expect(complaints).toEqual([]);
  } finally {
    stop();
  }
});

test("a calibration can be cancelled, and the page goes on", async () => {
  const { page } = await open(browser);
  await page.locator("#example").click();
  await page.locator("#start:not([disabled])").click();
  await page.getByText("fitting noise and motion").waitFor();
  await page.getByText("Cancel").click();
  await page.getByText("cancelled").waitFor();
  await page.getByLabel("Estimator").selectOption("ekf");
  await page.locator("#start").click();
  await page.locator("#verdict").waitFor();
});

test("all of it can be done with the keyboard, in the dark, on a phone", async () => {
  const { page, complaints } = await open(browser, { viewport: { width: 375, height: 740 }, colorScheme: "dark", hasTouch: true });
  const press = async (name: string) => {
    for (let tabs = 0; tabs < 120; tabs += 1) {
      await page.keyboard.press("Tab");
      const text = await page.evaluate(() => document.activeElement?.textContent ?? "");
      if (text === name) return page.keyboard.press("Enter");
    }
    throw new Error(`no Tab leads to ${name}`);
  };
  await press("Try an example");
  await page.locator("#recordings .lines").waitFor();
  await page.getByLabel("Estimator").selectOption("ekf");
  await press("Calibrate");
  await page.locator("#verdict").waitFor();
  await press("Filter and smooth");
  await page.getByText("Download estimates.csv").waitFor();
  await press("+");
  await press("Make firmware");
  await page.locator(".costs").waitFor();
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(375);
  await checkAccess(page);
  await picture(page, "page-dark-phone");
  expect(complaints).toEqual([]);
});
