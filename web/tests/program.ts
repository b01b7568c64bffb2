/** The command line that the page is compared with, and recordings for both. */

import { type ChildProcessByStdio, execFileSync, spawn } from "node:child_process";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Readable } from "node:stream";

const program = process.env["OHMSTRAIN"];
if (!program) throw new Error("OHMSTRAIN must name the program that the page is compared with: scripts/web.sh --test does");

/**
 * The program computes with the elementary functions of WebAssembly, not the system's: those differ in the last bit of one
 * exponential in ten, and what is fitted with them in the last digits.
 */
const sameLibm = { ...process.env, LD_PRELOAD: process.env["OHMSTRAIN_SAME_LIBM"] };

/** A folder with files, in which the program runs. */
export class Folder {
  readonly path = mkdtempSync(join(tmpdir(), "ohmstrain-web-"));

  at(name: string): string {
    return join(this.path, name);
  }

  put(name: string, content: string | Uint8Array): string {
    writeFileSync(this.at(name), content);
    return this.at(name);
  }

  get(name: string): Buffer {
    return readFileSync(this.at(name));
  }

  /** Runs the program; what it prints. */
  run(...args: string[]): string {
    return execFileSync(program as string, args, { cwd: this.path, env: sameLibm, encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });
  }

  /** Runs the program, which fails; what it says of that. */
  refusal(...args: string[]): string {
    try {
      this.run(...args);
    } catch (error) {
      return String((error as { stderr: string }).stderr).trim().replace(/^ohmstrain: /, "");
    }
    throw new Error(`ohmstrain ${args.join(" ")} was expected to fail`);
  }
}

/** The program while it runs. */
export function started(...args: string[]): ChildProcessByStdio<null, Readable, null> {
  return spawn(program as string, args, { stdio: ["ignore", "pipe", "inherit"] });
}

/** A recording of the simulator, as its text: a thousand rows, enough to calibrate on. */
export function simulated(folder: Folder, seed: number): string {
  const whole = folder.run("simulate", "--material", "representative", "--protocol", "mixed", "--speed-mm-s", "5", "--mismatched",
    "--sample-rate-hz", "5", "--seed", String(seed));
  const lines = whole.split("\n");
  const header = lines.findIndex((line) => !line.startsWith("#"));
  return `${lines.slice(0, header + 1001).join("\n")}\n`;
}

/** The same as a lab with a German computer writes it: a preamble, semicolons, decimal commas, a row of units, kΩ and mm. */
export function nasty(trace: string, gaugeLengthMm: number): Uint8Array {
  const lines = trace.split("\n").filter((line) => line !== "" && !line.startsWith("#"));
  const header = (lines[0] ?? "").split(",");
  const place = (name: string) => header.indexOf(name);
  const [time, reading, strain] = [place("time_s"), place("resistance_ohm"), place("strain")];
  const comma = (value: number, digits: number) => value.toFixed(digits).replace(".", ",");
  const row = (line: string): string => {
    const cells = line.split(",").map(Number);
    const resistance = cells[reading] ? comma(cells[reading] / 1000, 6) : "OVLD";
    return `${comma(cells[time] ?? 0, 3)};${resistance};${comma((cells[strain] ?? 0) * gaugeLengthMm, 5)};ok`;
  };
  const head = ["Prüfstand 3, Dehnungssensor Nr. 7", "Prüfer: Müller", "", "Zeit;Widerstand;Weg;Bemerkung", "s;kΩ;mm;"];
  const text = [...head, ...lines.slice(1).map(row)].join("\r\n") + "\r\n";
  return Buffer.from(text, "utf8");
}

/** Lines of a closing, with no seconds: those are another machine's every time. */
export function withoutSeconds(text: string): string {
  return text.replace(/; it took [\d.]+ s/, "").replace(/\s+/g, " ").trim();
}
