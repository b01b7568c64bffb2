/** The WebAssembly in Node: every number is the command line's, to the last digit. */

import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { Recording, Sensor, calibrate, initSync } from "../pkg/ohmstrain.js";
import { Folder, simulated, withoutSeconds } from "./program";

initSync({ module: readFileSync(new URL("../pkg/ohmstrain_bg.wasm", import.meta.url)) });

/** Seconds that something takes. */
function seconds(work: () => void): number {
  const start = performance.now();
  work();
  return (performance.now() - start) / 1000;
}

// The page's tests calibrate the default estimator: the same WebAssembly in the same engine.
const estimator = "ekf";
test("a calibration, filter and smoother are the command line's", () => {
  const folder = new Folder();
  const trace = folder.put("trace.csv", simulated(folder, 3));
  let printed = "";
  const native = seconds(() => {
    printed = folder.run("calibrate", "trace.csv", "-o", "sensor.toml", "--estimator", estimator);
  });
  const recording = Recording.fromCsv("trace.csv", readFileSync(trace));
  const stages = new Set<string>();
  let made: ReturnType<typeof calibrate> | undefined;
  const here = seconds(() => {
    const onStage = (stage: string) => stages.add(stage);
    made = calibrate([recording.copy()], { estimator, file: "sensor.toml" }, onStage);
  });
  console.log(`calibrate: ${native.toFixed(1)} s native, ${here.toFixed(1)} s here: ${(here / native).toFixed(2)} times`);
  const sensor = made?.sensor() as Sensor;
  expect(sensor.toToml()).toBe(folder.get("sensor.toml").toString());
  const lines = (made?.lines() ?? []).map(([name, text]) => `${name} ${text}`).join(" ");
  expect(withoutSeconds(lines)).toBe(withoutSeconds(printed));
  expect([...stages]).toEqual(["fitting the law", "fitting noise and motion", "checking parts left out"]);
  for (const [command, made] of [["filter", sensor.filterRecording(recording)], ["smooth", sensor.smoothRecording(recording)]] as const) {
    folder.run(command, "trace.csv", "--sensor", "sensor.toml", "-o", "out.csv");
    expect(Buffer.from(made.csv()).equals(folder.get("out.csv")), command).toBe(true);
  }
});
