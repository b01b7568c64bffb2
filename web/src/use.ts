/** Step 3: a recording through the sensor; files to take along; firmware. */

import { zipSync, strToU8 } from "fflate";
import type { Cost } from "../pkg/ohmstrain.js";
import { byId, choice, field, h, save, warnings } from "./dom";
import { Plot } from "./plots";
import type { RecordingData, Series } from "./protocol";
import type { Group } from "./recordings";
import { type SensorState, state } from "./state";

const BUDGETS: [string, string][] = [
  ["", "all of it, as on a computer"],
  ["lean", "lean: 15 000 instructions a step (Arduino Zero and larger)"],
  ["board=uno", "Arduino Uno"],
  ["board=nano", "Arduino Nano"],
  ["board=nano33", "Arduino Nano 33 IoT"],
  ["board=nano33ble", "Arduino Nano 33 BLE"],
  ["board=teensy40", "Teensy 4.0"],
  ["board=esp32", "ESP32"],
  ["board=esp32c3", "ESP32-C3"],
  ["board=rp2040", "Raspberry Pi Pico (RP2040)"],
  ["board=stm32f1", "Blue Pill (STM32F103C8)"],
  ["board=stm32f4", "Black Pill (STM32F411CE)"],
  ["board=stm32l4", "Nucleo-L432KC"],
];

const chosen = { recording: "", target: "c", budget: "", step: "" };

/** Draws the step. */
export function showUse(): void {
  const { current } = state;
  const place = byId("use-controls");
  if (!current) {
    place.replaceChildren(h("p", { class: "hint" }, "Calibrate, or drop a sensor.toml that you have."));
    byId("use-result").replaceChildren();
    byId("firmware").replaceChildren();
    return;
  }
  // A channel's sensor is that of its own recordings.
  const channel = state.groups.find((group) => group.id === current.calibratedOn)?.channel ?? "";
  const isOwn = (group: Group) => channel === "" || group.channel === "" || group.channel === channel;
  const usable = state.groups.filter((group) => group.recording && isOwn(group));
  if (!usable.some((group) => group.id === chosen.recording)) chosen.recording = usable.at(-1)?.id ?? "";
  const names = usable.map((group): [string, string] => [group.id, group.title]);
  const estimate = h("button", { type: "button", class: "main", click: () => void use(current) }, "Filter and smooth");
  estimate.disabled = usable.length === 0;
  place.replaceChildren(
    h("p", {}, `Sensor: ${current.sensor.estimator}, R₀ ${current.sensor.rest.toPrecision(4)} ${current.sensor.unit}. `),
    h(
      "div",
      { class: "row" },
      h("button", { type: "button", id: "save-sensor", click: () => save("sensor.toml", current.toml) }, "Download sensor.toml"),
    ),
    usable.length === 0
      ? h("p", { class: "hint" }, "Drop a recording in step 1, with or without a reference: it is filtered and smoothed here.")
      : h("div", { class: "fields" }, choice("Recording", names, chosen.recording, (it) => (chosen.recording = it))),
    estimate,
  );
  byId("use-result").replaceChildren();
  showFirmware(current, usable);
}

/** The sensor's worker with a recording in it. */
async function loaded(current: SensorState, group: Group): Promise<RecordingData> {
  return current.engine.call("load", group.id, group.recording?.name ?? "", await group.csv());
}

function fail(place: HTMLElement, error: unknown): void {
  place.replaceChildren(h("p", { class: "error", role: "alert" }, error instanceof Error ? error.message : String(error)));
}

async function use(current: SensorState): Promise<void> {
  const place = byId("use-result");
  const group = state.groups.find((one) => one.id === chosen.recording);
  if (!group) return;
  place.replaceChildren(h("output", {}, "filtering and smoothing"));
  try {
    const recording = await loaded(current, group);
    const { filtered, smoothed } = await current.engine.call("estimate", group.id);
    place.replaceChildren(
      ...[warnings(filtered.warnings)].filter((it) => it !== undefined),
      estimates(current, recording, filtered, smoothed).element,
      h(
        "div",
        { class: "row" },
        download("estimates.csv", filtered.csv, "Download estimates.csv (filtered)"),
        download("smoothed.csv", smoothed.csv, "Download smoothed.csv"),
        h("button", { type: "button", click: () => void report(current, group, place) }, "Download report and figures"),
      ),
    );
  } catch (error) {
    fail(place, error);
  }
}

function download(name: string, bytes: Uint8Array, text: string): HTMLElement {
  return h("button", { type: "button", click: () => save(name, bytes as BlobPart, "text/csv") }, text);
}

function estimates(current: SensorState, recording: RecordingData, filtered: Series, smoothed: Series): Plot {
  const isAngle = current.sensor.quantity === "angle_deg";
  const scaled = (values: Float64Array) => (isAngle ? values : values.map((value) => 100 * value));
  const [strain, sd] = [scaled(filtered.strain), scaled(filtered.sd)];
  const reference = recording.reference ? scaled(recording.reference) : undefined;
  return new Plot({
    title: `${recording.name}: filtered and smoothed`,
    time: filtered.time,
    left: isAngle ? "angle, °" : "strain, %",
    band: { label: "95 %", low: strain.map((e, k) => e - 1.96 * (sd[k] ?? 0)), high: strain.map((e, k) => e + 1.96 * (sd[k] ?? 0)), colour: "band" },
    lines: [
      { label: "filtered", colour: "strain", values: strain },
      { label: "smoothed", colour: "smoothed", values: scaled(smoothed.strain) },
      ...(reference ? [{ label: "reference", colour: "reference", values: reference, dash: [5, 3] }] : []),
    ],
  });
}

async function report(current: SensorState, group: Group, place: HTMLElement): Promise<void> {
  try {
    const { html, figures } = await current.engine.call("report", group.id);
    const files: Record<string, Uint8Array> = { "report.html": strToU8(html) };
    for (let k = 0; k + 1 < figures.length; k += 2) files[`figures/${figures[k]}`] = strToU8(figures[k + 1] ?? "");
    save("report.zip", zipSync(files) as BlobPart, "application/zip");
  } catch (error) {
    fail(place, error);
  }
}

/** Median time between rows, s. */
function usualStep(time: Float64Array): number {
  const steps = time.slice(1).map((later, k) => later - (time[k] ?? 0)).sort();
  return steps[Math.floor(steps.length / 2)] ?? 0.01;
}

function showFirmware(current: SensorState, usable: Group[]): void {
  const time = usable.find((group) => group.id === chosen.recording)?.recording?.time;
  if (chosen.step === "") chosen.step = time ? String(Number(usualStep(time).toPrecision(3))) : "0.01";
  const result = h("div", { id: "firmware-result" });
  const make = () => void firmware(current, result);
  byId("firmware").replaceChildren(
    h("h3", {}, "Firmware"),
    h(
      "div",
      { class: "fields" },
      choice("Language", [["c", "C99, with an Arduino sketch"], ["rust", "Rust, no_std"]], chosen.target, (it) => {
        chosen.target = it;
      }),
      choice("Board or budget", BUDGETS, chosen.budget, (it) => (chosen.budget = it)),
      field("Time between two readings, s", chosen.step, (it) => (chosen.step = it), { inputmode: "decimal" }),
    ),
    h("button", { type: "button", id: "make-firmware", click: make }, "Make firmware"),
    result,
  );
}

async function firmware(current: SensorState, place: HTMLElement): Promise<void> {
  try {
    const { target, budget, step } = chosen;
    const made = await current.engine.call("firmware", target, Number(step.replace(",", ".")), budget);
    const files: Record<string, Uint8Array> = {};
    for (let k = 0; k + 1 < made.files.length; k += 2) files[`ohmstrain/${made.files[k]}`] = strToU8(made.files[k + 1] ?? "");
    const zip = zipSync(files);
    place.replaceChildren(
      h("p", {}, made.words),
      costs(made.cost),
      h("button", { type: "button", id: "save-firmware", click: () => save("ohmstrain-firmware.zip", zip as BlobPart) }, "Download ohmstrain-firmware.zip"),
    );
  } catch (error) {
    fail(place, error);
  }
}

function costs(cost: Cost): HTMLElement {
  const row = (name: string, value: number, unit: string) =>
    h("tr", {}, h("th", { scope: "row" }, name), h("td", { class: "number" }, value.toLocaleString("en")), h("td", {}, unit));
  return h(
    "table",
    { class: "costs" },
    h("caption", {}, "Its cost on a Cortex-M4F, estimated"),
    h(
      "tbody",
      {},
      row("instructions a step", cost.instructions, ""),
      row("flash", cost.flash, "bytes"),
      row("RAM", cost.ram, "bytes"),
      row("of it stack", cost.stack, "bytes"),
    ),
  );
}
