/** View of a live stream: strain and interval, state of the stream, counts, and controls. */

import type { SensorDescription, StreamSummary } from "../pkg/ohmstrain.js";
import { h } from "./dom";
import { Plot } from "./plots";

/** Seconds that the plot shows. */
const WINDOW_S = 30;
/** Points that are drawn at most: more than there are pixels. */
const MOST_POINTS = 800;
/** Words change no more often than this, ms. */
const WORDS_MS = 150;
/** A stream with up to so many rows a second is calm. */
const CALM = 300;
/** Last rows whose times tell how many there are in a second. */
const RECENT = 100;
/** Numbers of a row: time, reading, strain, deviation. */
const WIDTH = 4;

interface Actions {
  rest: () => void;
  zero: () => void;
  record: () => void;
  stop: () => void;
}

export class LiveView {
  readonly element = h("div", { class: "card" });
  /** Columns have been asked for. */
  asks = false;
  private readonly state = h("output", {}, "waiting");
  private readonly value = h("p", { class: "value" }, "–");
  private readonly message = h("p", { class: "hint", role: "status" });
  private readonly counts = h("p", { class: "hint" });
  private readonly stream = h("pre", { tabindex: 0, role: "region", "aria-label": "the stream as it comes" });
  private readonly question = h("div");
  private readonly recordButton: HTMLButtonElement;
  private readonly plot: Plot;
  private readonly columns: number[][] = [[], [], [], []];
  private isDue = false;
  private wordsAt = 0;
  private pending: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly sensor: SensorDescription,
    actions: Actions,
  ) {
    const button = (id: string, text: string, act: () => void) => h("button", { type: "button", id, click: act }, text);
    this.recordButton = button("record", "Record", actions.record);
    const isAngle = sensor.quantity === "angle_deg";
    this.plot = new Plot({
      title: isAngle ? "angle, live" : "strain, live",
      time: [],
      left: isAngle ? "angle, °" : "strain, %",
      band: { label: "95 %", low: [], high: [], colour: "band" },
      lines: [{ label: "strain", colour: "strain", values: [] }],
      height: 260,
      isLive: true,
    });
    this.element.append(
      this.state,
      this.value,
      this.plot.element,
      h(
        "div",
        { class: "row" },
        button("rest", "It is at rest: strain is zero", actions.rest),
        button("zero", "Re-zero: what it reads now is R₀", actions.zero),
        this.recordButton,
        button("stop", "Stop", actions.stop),
      ),
      this.message,
      this.counts,
      this.question,
      h("details", { open: true }, h("summary", {}, "The stream"), this.stream),
    );
  }

  status(text: string): void {
    this.state.textContent = text;
  }

  fail(text: string): void {
    this.message.className = "error";
    this.message.textContent = text;
  }

  showSummary(summary: StreamSummary): void {
    this.message.className = "hint";
    this.message.textContent = summary.message;
  }

  recording(name: string | undefined): void {
    this.recordButton.textContent = name ? `Stop recording ${name}` : "Record";
  }

  /** True if the rows are so few that one frame shows several of them. */
  get isCalm(): boolean {
    const times = this.columns[0] ?? [];
    return RECENT < CALM * ((times.at(-1) ?? 0) - (times.at(-1 - RECENT) ?? Number.NEGATIVE_INFINITY));
  }

  /** Takes rows, what there is to say, and the last lines. */
  take(rows: Float64Array, summary: StreamSummary, raw: string[]): void {
    const [times] = this.columns;
    for (let k = 0; k + WIDTH <= rows.length; k += WIDTH) {
      if ((rows[k] ?? 0) <= (times?.at(-1) ?? Number.NEGATIVE_INFINITY)) this.forget(times?.length ?? 0);
      for (let place = 0; place < WIDTH; place += 1) this.columns[place]?.push(rows[k + place] ?? Number.NaN);
    }
    const oldest = (times?.at(-1) ?? 0) - WINDOW_S;
    const old = times?.findIndex((time) => time >= oldest) ?? 0;
    // Not row by row: what is before the window is cut off now and then.
    if (old > (times?.length ?? 0) / 4) this.forget(old);
    if (performance.now() - this.wordsAt > WORDS_MS) this.words(summary, raw);
    else this.later(summary, raw);
    if (!this.isDue) requestAnimationFrame(() => this.draw());
    this.isDue = true;
  }

  private words(summary: StreamSummary, raw: string[]): void {
    clearTimeout(this.pending);
    this.pending = undefined;
    this.wordsAt = performance.now();
    if (summary.message !== this.message.textContent) this.showSummary(summary);
    const { rows, missing, badLines, restarts } = summary.counts;
    const columns = summary.columns.join(", ") || "no columns yet";
    this.counts.textContent = `${columns}: ${rows} rows, ${missing} missing, ${badLines} lines skipped, ${restarts} restarts`;
    this.stream.textContent = raw.join("\n");
    const [strain, half] = [this.columns[2]?.at(-1), 1.96 * (this.columns[3]?.at(-1) ?? 0)];
    if (strain === undefined) return;
    const [scale, unit] = this.sensor.quantity === "angle_deg" ? [1, "°"] : [100, " %"];
    this.value.textContent = `${(scale * strain).toFixed(2)} ± ${(scale * half).toFixed(2)}${unit}`;
  }

  /** The last words of a stream that pauses are shown, too. */
  private later(summary: StreamSummary, raw: string[]): void {
    clearTimeout(this.pending);
    this.pending = setTimeout(() => this.words(summary, raw), WORDS_MS);
  }

  /** Asks for the columns of a stream; `answered` returns what is wrong with the answer. */
  ask(choices: HTMLElement[], answered: () => Promise<string>): void {
    this.asks = true;
    const wrong = h("p", { class: "error", hidden: true });
    const answer = async () => {
      const text = await answered();
      wrong.hidden = text === "";
      wrong.textContent = text;
      if (text === "") this.question.replaceChildren();
    };
    this.question.replaceChildren(
      h("p", { class: "question", role: "alert" }, "The stream has no header: what are its columns?"),
      h("div", { class: "fields" }, ...choices),
      h("button", { type: "button", id: "columns", click: () => void answer() }, "Use these columns"),
      wrong,
    );
  }

  private forget(rows: number): void {
    for (const column of this.columns) column.splice(0, rows);
  }

  private draw(): void {
    const [times, , strains, sds] = this.columns;
    if (!times || !strains || !sds || times.length === 0) {
      this.isDue = false;
      return;
    }
    this.isDue = false;
    const scale = this.sensor.quantity === "angle_deg" ? 1 : 100;
    const stride = Math.ceil(times.length / MOST_POINTS);
    const time: number[] = [];
    const [low, strain, high]: [number[], number[], number[]] = [[], [], []];
    // The same rows again and again, so that the line does not flicker; the last one always.
    for (let k = (times.length - 1) % stride; k < times.length; k += stride) {
      const half = 1.96 * (sds[k] ?? 0);
      const value = strains[k] ?? Number.NaN;
      time.push(times[k] ?? 0);
      low.push(scale * (value - half));
      strain.push(scale * value);
      high.push(scale * (value + half));
    }
    this.plot.update({
      time,
      band: { label: "95 %", low, high, colour: "band" },
      lines: [{ label: "strain", colour: "strain", values: strain }],
    });
  }
}
