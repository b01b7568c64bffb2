/** Step 2: calibration in a worker of its own, with progress and an end to it; then what it came to. */

import { byId, choice, field, h, sentences, warnings } from "./dom";
import { Cancelled, Engine } from "./engine";
import { Plot } from "./plots";
import type { Group } from "./recordings";
import { type SensorState, state } from "./state";

const ESTIMATORS: [string, string][] = [
  ["auto", "auto (a minute or two)"],
  ["ekf", "ekf (a second or two)"],
  ["sign-split", "sign-split"],
  ["hypotheses", "hypotheses"],
  ["static-cubic", "static-cubic"],
];

const chosen = { estimator: "auto", from: "", until: "", align: false, channel: "" };
let running: Engine | undefined;

/** Draws the step; it is drawn again whenever the recordings change. */
export function showCalibration(): void {
  const known = state.groups.filter((group) => group.recording?.reference);
  const channels = [...new Set(known.map((group) => group.channel))];
  if (!channels.includes(chosen.channel)) chosen.channel = channels[0] ?? "";
  const usable = known.filter((group) => group.channel === chosen.channel);
  const start = h("button", { type: "button", class: "main", id: "start", click: () => void calibrate(usable) }, "Calibrate");
  start.disabled = usable.length === 0;
  const align = h("input", { type: "checkbox", checked: chosen.align, change: () => (chosen.align = align.checked) });
  const choose = (channel: string) => {
    chosen.channel = channel;
    showCalibration();
  };
  byId("calibrate-controls").replaceChildren(
    h(
      "div",
      { class: "fields" },
      channels.length > 1 && choice("Sensor", channels.map((name) => [name, name || "one channel"]), chosen.channel, choose),
      choice("Estimator", ESTIMATORS, chosen.estimator, (it) => (chosen.estimator = it)),
      field("From, s", chosen.from, (it) => (chosen.from = it), { inputmode: "decimal", placeholder: "start" }),
      field("Until, s", chosen.until, (it) => (chosen.until = it), { inputmode: "decimal", placeholder: "end" }),
      h("label", { class: "check" }, align, "move a reference that is late (--align)"),
    ),
    usable.length === 0
      ? h("p", { class: "hint" }, "Needs a recording with a reference: strain, displacement or angle.")
      : h("p", { class: "hint" }, `On ${usable.map((group) => group.title).join(", ")}.`),
    ...(channels.length > 1 ? [h("p", { class: "hint" }, "Each channel is a sensor of its own: calibrate one, download what it gives, then the next.")] : []),
    start,
  );
}

/** A number of a field, or nothing. */
function seconds(text: string, name: string): number | undefined {
  if (text.trim() === "") return undefined;
  const number = Number(text.replace(",", "."));
  if (!Number.isFinite(number)) throw new Error(`${name}: expected seconds, found \`${text}\``);
  return number;
}

async function calibrate(groups: Group[]): Promise<void> {
  const result = byId("calibrate-result");
  const bar = h("progress", { max: 1, "aria-label": "calibration" });
  const stage = h("output", {}, "reading");
  const cancel = h("button", { type: "button", click: () => running?.terminate() }, "Cancel");
  result.replaceChildren(h("div", { class: "progress" }, bar, stage, cancel));
  cancel.focus();
  const engine = await Engine.start();
  running = engine;
  engine.onProgress = (words, share) => {
    stage.textContent = words;
    if (words === "fitting noise and motion") bar.value = share;
    else bar.removeAttribute("value");
  };
  try {
    const [from, until] = [seconds(chosen.from, "--from"), seconds(chosen.until, "--until")];
    for (const group of groups) await engine.call("load", group.id, group.recording?.name ?? "", await group.csv());
    const ids = groups.map((group) => group.id);
    const { estimator, align } = chosen;
    const limits = { ...(from === undefined ? {} : { from }), ...(until === undefined ? {} : { until }) };
    const made = await engine.call("calibrate", ids, { estimator, align, file: "sensor.toml", ...limits });
    state.useSensor({ engine, ...made, calibratedOn: groups[0]?.id });
    result.replaceChildren(...closing(made));
    byId("verdict").focus();
  } catch (error) {
    engine.terminate();
    const text = error instanceof Error ? error.message : String(error);
    const isCancelled = error instanceof Cancelled;
    result.replaceChildren(h("p", { class: isCancelled ? "hint" : "error", role: "alert" }, text));
    byId("start").focus();
  } finally {
    running = undefined;
  }
}

interface Closing extends Pick<SensorState, "toml" | "sensor"> {
  lines: [string, string][];
  advice: string[];
  warnings: string[];
  isBetter: boolean | undefined;
  leftOut: Float64Array;
}

function closing(made: Closing): (HTMLElement | Node)[] {
  const verdict = h("div", { id: "verdict", tabindex: -1, class: made.isBetter === false ? "worse" : "better" });
  verdict.append(sentences(made.lines));
  const advice = made.advice.length > 1 ? [h("h3", {}, "What to record next"), list(made.advice)] : [];
  const warned = warnings(made.warnings);
  return [verdict, ...(warned ? [warned] : []), ...leftOut(made), ...advice];
}

function list(texts: string[]): HTMLElement {
  return h("ol", {}, ...texts.map((text) => h("li", {}, text)));
}

/** Estimates of each quarter by the fit to the others, one plot for each recording. */
function leftOut(made: Closing): HTMLElement[] {
  const rows = made.leftOut.length / 6;
  const column = (index: number) => made.leftOut.subarray(index * rows, (index + 1) * rows);
  const [of, time, truth, strain, sd, cubic] = [0, 1, 2, 3, 4, 5].map(column) as [
    Float64Array, Float64Array, Float64Array, Float64Array, Float64Array, Float64Array,
  ];
  const isAngle = made.sensor.quantity === "angle_deg";
  const scale = isAngle ? 1 : 100;
  const plots: HTMLElement[] = [];
  for (let from = 0; from < rows; ) {
    let end = from;
    while (end < rows && of[end] === of[from]) end += 1;
    const part = (values: Float64Array) => values.subarray(from, end).map((value) => value * scale);
    const [strains, sds] = [part(strain), part(sd)];
    const plot = new Plot({
      title: "Left out: each quarter, estimated by what was fitted to the others",
      time: time.subarray(from, end),
      left: isAngle ? "angle, °" : "strain, %",
      band: { label: "95 %", low: strains.map((e, k) => e - 1.96 * (sds[k] ?? 0)), high: strains.map((e, k) => e + 1.96 * (sds[k] ?? 0)), colour: "band" },
      lines: [
        { label: "static cubic", colour: "cubic", values: part(cubic), width: 1 },
        { label: "strain", colour: "strain", values: strains },
        { label: "reference", colour: "reference", values: part(truth), dash: [5, 3] },
      ],
    });
    plots.push(plot.element);
    from = end;
  }
  return plots;
}
