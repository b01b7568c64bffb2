/** Plots over time: what is drawn, its colours, and zooming by mouse, touch and keyboard. */

import uPlot from "uplot";
import { h } from "./dom";

/** A line of a plot. */
export interface Line {
  label: string;
  /** Name of a colour of the style sheet. */
  colour: string;
  values: ArrayLike<number>;
  /** Side of its axis. */
  axis?: "left" | "right";
  width?: number;
  dash?: number[];
  /** Points only. */
  isPoints?: boolean;
}

export interface PlotInput {
  title: string;
  time: ArrayLike<number>;
  left: string;
  right?: string;
  lines: Line[];
  /** Between these two columns, an interval of 95 %. */
  band?: { label: string; low: ArrayLike<number>; high: ArrayLike<number>; colour: string };
  height?: number;
  /** Numbers come and go: no tools to zoom with. */
  isLive?: boolean;
}

const STEP = 0.2;

/** A plot in an element of its own; it follows the element's width and the scheme of colours. */
export class Plot {
  readonly element: HTMLElement;
  private plot: uPlot | undefined;
  private readonly box = h("div", { class: "plot-box" });

  constructor(private readonly input: PlotInput) {
    const button = (text: string, label: string, act: () => void) =>
      h("button", { type: "button", class: "small", "aria-label": `${label}: ${input.title}`, click: act }, text);
    this.element = h(
      "figure",
      { class: "plot" },
      h("figcaption", {}, input.title),
      this.box,
      !input.isLive && h(
        "div",
        { class: "plot-tools" },
        button("+", "zoom in", () => this.zoom(0.5)),
        button("−", "zoom out", () => this.zoom(2)),
        button("←", "earlier", () => this.shift(-STEP)),
        button("→", "later", () => this.shift(STEP)),
        button("all", "show all", () => this.all()),
        h("span", { class: "hint" }, "drag to zoom, double-click for all"),
      ),
    );
    new ResizeObserver(() => this.fit()).observe(this.box);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
  }

  /** Draws other numbers. */
  update(columns: Partial<Pick<PlotInput, "time" | "lines" | "band">>): void {
    Object.assign(this.input, columns);
    this.plot?.setData(data(this.input));
  }

  private fit(): void {
    const width = this.box.clientWidth;
    if (width === 0) return;
    if (this.plot) this.plot.setSize({ width, height: this.height() });
    else this.plot = new uPlot(options(this.input, width, this.height()), data(this.input), this.box);
  }

  private height(): number {
    return this.input.height ?? (this.box.clientWidth < 500 ? 220 : 300);
  }

  private redraw(): void {
    this.plot?.destroy();
    this.plot = undefined;
    this.fit();
  }

  private limits(): [number, number] {
    const { min, max } = this.plot?.scales["x"] ?? {};
    return [min ?? 0, max ?? 1];
  }

  private zoom(factor: number): void {
    const [min, max] = this.limits();
    const half = ((max - min) * factor) / 2;
    this.plot?.setScale("x", { min: (min + max) / 2 - half, max: (min + max) / 2 + half });
  }

  private shift(share: number): void {
    const [min, max] = this.limits();
    const by = (max - min) * share;
    this.plot?.setScale("x", { min: min + by, max: max + by });
  }

  private all(): void {
    const { time } = this.input;
    this.plot?.setScale("x", { min: time[0] ?? 0, max: time[time.length - 1] ?? 1 });
  }
}

/** uPlot takes null for what is missing. */
function known(values: ArrayLike<number>): (number | null)[] {
  return Array.from(values, (value) => (Number.isNaN(value) ? null : value));
}

function data({ time, lines, band }: PlotInput): uPlot.AlignedData {
  const bounds = band ? [known(band.low), known(band.high)] : [];
  return [Array.from(time), ...bounds, ...lines.map((line) => known(line.values))];
}

/** A colour of the style sheet. */
export function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

function digits(_: uPlot, value: number | null): string {
  return value === null || value === undefined ? "–" : value.toPrecision(4);
}

function options(input: PlotInput, width: number, height: number): uPlot.Options {
  const axis = (scale: string, label: string, side: 1 | 2 | 3): uPlot.Axis => ({
    scale,
    label,
    side,
    stroke: colour("ink"),
    grid: { show: side !== 1, stroke: colour("grid"), width: 1 },
    ticks: { stroke: colour("grid"), width: 1 },
    font: "12px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif",
    labelSize: 18,
    size: side === 2 ? 34 : 52,
  });
  const bound = (label: string): uPlot.Series => ({ label, scale: "left", stroke: "transparent", value: digits });
  const bounds = input.band ? [bound("95 % from"), bound("to")] : [];
  const lines = input.lines.map(
    (line): uPlot.Series => ({
      label: line.label,
      scale: line.axis ?? "left",
      stroke: colour(line.colour),
      width: line.isPoints ? 0 : (line.width ?? 1.5),
      points: { show: line.isPoints ?? false, size: 3 },
      ...(line.dash ? { dash: line.dash } : {}),
      value: digits,
    }),
  );
  const right = input.right ? [axis("right", input.right, 1)] : [];
  return {
    width,
    height,
    scales: { x: { time: false } },
    axes: [axis("x", "time, s", 2), axis("left", input.left, 3), ...right],
    series: [{ label: "s", value: digits }, ...bounds, ...lines],
    bands: input.band ? [{ series: [2, 1], fill: colour(input.band.colour) }] : [],
    cursor: { show: !input.isLive, drag: { x: true, y: false } },
    legend: { show: !input.isLive },
  };
}
