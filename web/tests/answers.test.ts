/** Flags of what a person says, columns of what a board prints, and lines of what comes in pieces. */

import { expect, test } from "vitest";
import { guess, header } from "../src/columns";
import { Answers, quoted } from "../src/answers";
import { LineSplitter } from "../src/serial";

test("answers become flags in the syntax of a shell", () => {
  const answers = new Answers();
  answers.column("2", "resistance", "ratio");
  answers.unit("ratio", "percent");
  answers.answer("--unit strain=K if 1 V is that much");
  answers.answer("--decimal ,");
  answers.gaugeLength = "30";
  expect(answers.flags()).toBe(
    "--column resistance=none --column ratio=2 --unit ratio=percent --unit strain=K --gauge-length-mm 30 --decimal ,",
  );
  expect(quoted("it's")).toBe("'it'\\''s'");
});

test("columns of a board are guessed", () => {
  expect(guess(["hello", "1000,512", "1010,513"])).toEqual(["time_ms", "resistance_ohm"]);
  expect(guess(["0.10,512,1", "0.20,513,1"])).toEqual(["time_s", "resistance_ohm", ""]);
  expect(guess(["512", "511"])).toEqual(["resistance_ohm"]);
  expect(guess(["nothing"])).toBeUndefined();
  expect(header(["time_ms", "", "adc"])).toBe("time_ms,unused_2,adc");
});

test("lines that come in pieces are whole", () => {
  const splitter = new LineSplitter();
  const bytes = (text: string) => new TextEncoder().encode(text);
  expect(["1,2\n3", ",4\r\n5", "\n"].map((piece) => splitter.take(bytes(piece)))).toEqual(["1,2\n", "3,4\r\n", "5\n"]);
});
