/** The worker: every computation of the page, behind one message for each call. */

import {
  Files,
  Recording,
  type Calibrated,
  type Choices,
  type Estimates,
  type Inspection,
  Sensor,
  type Stream,
  calibrate,
  example,
  initSync,
  lastPanic,
} from "../pkg/ohmstrain.js";
import type { Progress, RecordingData, Series } from "./protocol";

const inspections = new Map<string, Inspection>();
const recordings = new Map<string, Recording>();
let sensor: Sensor | undefined;
let stream: Stream | undefined;

function data(recording: Recording): RecordingData {
  const { name, rows, time, reading, reference, unit, quantity } = recording;
  return { name, rows, time, reading, reference, unit, quantity };
}

function keep(id: string, recording: Recording): RecordingData {
  recordings.get(id)?.free();
  recordings.set(id, recording);
  return data(recording);
}

function recordingOf(id: string): Recording {
  const recording = recordings.get(id);
  if (!recording) throw new Error("there is no such recording any more");
  return recording;
}

function sensorInUse(): Sensor {
  if (!sensor) throw new Error("there is no sensor yet: calibrate one, or drop a sensor.toml");
  return sensor;
}

function series(estimates: Estimates): Series {
  return {
    time: estimates.column(0),
    strain: estimates.column(2),
    sd: estimates.column(3),
    csv: estimates.csv(),
    warnings: estimates.warnings(),
  };
}

function streamInUse(): Stream {
  if (!stream) throw new Error("nothing is connected");
  return stream;
}

/** Result of a calibration. */
function closing(made: Calibrated) {
  return {
    lines: made.lines(),
    advice: made.advice(),
    warnings: made.warnings(),
    isBetter: made.isBetter,
    leftOut: made.leftOut(),
    toml: sensorInUse().toToml(),
    sensor: sensorInUse().described(),
  };
}

const methods = {
  inspect(id: string, files: { name: string; bytes: Uint8Array }[], answers: string) {
    const all = new Files();
    for (const { name, bytes } of files) all.add(name, bytes);
    const inspection = all.inspect(answers);
    all.free();
    inspections.get(id)?.free();
    inspections.set(id, inspection);
    const described = inspection.described();
    return { described, recording: described.question ? undefined : keep(id, inspection.recording()) };
  },
  survey(id: string): [string, string][] {
    return inspections.get(id)?.survey() ?? [];
  },
  forget(id: string): void {
    inspections.get(id)?.free();
    inspections.delete(id);
    recordings.get(id)?.free();
    recordings.delete(id);
  },
  csv(id: string): Uint8Array {
    return recordingOf(id).csv();
  },
  load(id: string, name: string, csv: Uint8Array): RecordingData {
    return keep(id, Recording.fromCsv(name, csv));
  },
  example(seed: number): { name: string; bytes: Uint8Array } {
    const made = example(seed);
    return { name: made.name, bytes: made.csv() };
  },
  calibrate(ids: string[], choices: Choices) {
    const made = calibrate(ids.map((id) => recordingOf(id).copy()), choices, progress);
    sensor?.free();
    sensor = made.sensor();
    const closed = closing(made);
    made.free();
    return closed;
  },
  useSensor(toml: string, name: string) {
    const read = Sensor.fromToml(toml, name);
    sensor?.free();
    sensor = read;
    return { toml, sensor: read.described() };
  },
  estimate(id: string): { filtered: Series; smoothed: Series } {
    const recording = recordingOf(id);
    const filtered = sensorInUse().filterRecording(recording);
    const smoothed = sensorInUse().smoothRecording(recording);
    const both = { filtered: series(filtered), smoothed: series(smoothed) };
    filtered.free();
    smoothed.free();
    return both;
  },
  report(id: string): { html: string; figures: string[] } {
    const drawn = sensorInUse().report(recordingOf(id));
    const both = { html: drawn.html, figures: drawn.figures() };
    drawn.free();
    return both;
  },
  firmware(target: string, stepSeconds: number, budget: string) {
    const made = sensorInUse().firmware(target, stepSeconds, budget === "" ? undefined : budget);
    const all = { files: made.files(), lines: made.lines(), words: made.words, cost: made.cost() };
    made.free();
    return all;
  },
  streamOpen(header: string | undefined, frontEnd: string): void {
    const opened = sensorInUse().stream(header, frontEnd);
    stream?.free();
    stream = opened;
  },
  streamTake(text: string, arrivedSeconds: number) {
    const rows = streamInUse().take(text, arrivedSeconds);
    return { rows, summary: streamInUse().summary(), recorded: streamInUse().recorded() };
  },
  streamSummary() {
    return streamInUse().summary();
  },
  streamRest() {
    streamInUse().rest();
    return streamInUse().summary();
  },
  streamZero() {
    streamInUse().zero();
    return streamInUse().summary();
  },
};

/** Requests to the worker. */
export type Methods = typeof methods;

let current = 0;

function progress(stage: string, share: number): void {
  const message: Progress = { call: current, stage, share };
  postMessage(message);
}

function run(call: number, method: keyof Methods, args: never[]): void {
  current = call;
  try {
    const called = methods[method] as (...args: never[]) => unknown;
    postMessage({ call, result: called(...args) });
  } catch (error) {
    const isPanic = error instanceof WebAssembly.RuntimeError;
    const text = isPanic ? lastPanic() || String(error) : error instanceof Error ? error.message : String(error);
    postMessage({ call, error: text, isPanic });
  }
}

addEventListener("message", (event: MessageEvent) => {
  if (event.data.module) initSync({ module: event.data.module as WebAssembly.Module });
  else run(event.data.call, event.data.method, event.data.args);
});
