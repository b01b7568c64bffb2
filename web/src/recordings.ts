/** Step 1: files, what was understood of them, questions and a plot. */

import type { Described } from "../pkg/ohmstrain.js";
import { byId, choice, field, h, save, sentences } from "./dom";
import type { Engine } from "./engine";
import { Plot } from "./plots";
import type { RecordingData } from "./protocol";
import { Answers } from "./answers";

/** A file as it was dropped. */
export interface Dropped {
  name: string;
  bytes: Uint8Array;
}

/** Files of one recording, what is said of them, and what was understood. */
export class Group {
  answers = new Answers();
  described: Described | undefined;
  recording: RecordingData | undefined;
  /** Why nothing can be understood. */
  error = "";
  readonly element = h("article", { class: "card" });
  private readonly survey = h("div");

  /** `channel` is the column of its readings, where the files have several. */
  constructor(
    readonly id: string,
    readonly files: Dropped[],
    private readonly engine: () => Promise<Engine>,
    private readonly changed: () => void,
    private readonly divide: (group: Group, answers: string[]) => void,
    readonly channel = "",
  ) {}

  /** Its files, and the channel. */
  get title(): string {
    const names = this.files.map((file) => file.name).join(" and ");
    return this.channel === "" ? names : `${names}, ${this.channel}`;
  }

  /** Reads the files again, with what is said of them. */
  async read(): Promise<void> {
    this.error = "";
    this.recording = undefined;
    this.survey.replaceChildren();
    try {
      const engine = await this.engine();
      const found = await engine.call("inspect", this.id, this.files, this.answers.flags());
      this.described = found.described;
      this.recording = found.recording;
      this.show();
      this.changed();
    } catch (error) {
      this.error = error instanceof Error ? error.message : String(error);
      this.show();
      this.changed();
    }
  }

  /** Looks at what was understood, which may take longer than a plot of it. */
  async look(): Promise<void> {
    if (!this.recording) return;
    const found = await (await this.engine()).call("survey", this.id).catch((): [string, string][] => []);
    this.survey.replaceChildren(sentences(found));
  }

  /** The recording as `ohmstrain import` writes it. */
  async csv(): Promise<Uint8Array> {
    return (await this.engine()).call("csv", this.id);
  }

  private show(): void {
    const focused = document.activeElement?.getAttribute("name");
    const { described } = this;
    const question = described?.question;
    this.element.replaceChildren(
      h("h3", {}, this.title),
      ...(this.error ? [h("p", { class: "error", role: "alert" }, this.error)] : []),
      ...(question ? [this.asked(question)] : []),
      ...(this.recording ? [plotOf(this.recording)] : []),
      this.survey,
      ...(described?.remarks.length ? [remarks(described.remarks)] : []),
      ...(described ? [this.columns(described)] : []),
      this.more(described),
      ...(this.recording ? [h("button", { type: "button", click: () => void this.download() }, "Download trace.csv")] : []),
    );
    if (focused) this.element.querySelector<HTMLElement>(`[name="${focused}"]`)?.focus();
  }

  private asked(question: { text: string; answers: string[] }): HTMLElement {
    const text = h("p", { class: "question", role: "alert" }, question.text);
    const isLength = (answer: string) => answer.startsWith("--gauge-length-mm");
    // A number is asked for below.
    if (question.answers.every(isLength)) return text;
    const options = question.answers.map((answer): [string, string] => [answer, answer]);
    const answers = choice("Answer", [["", "choose"], ...options], "", (answer) => {
      if (isLength(answer)) this.element.querySelector<HTMLInputElement>("[name=length]")?.focus();
      else this.say(() => this.answers.answer(answer));
    });
    answers.querySelector("select")?.setAttribute("name", "answer");
    const isChannel = (answer: string) => channelOf(answer) !== "";
    const channels = question.answers.every(isChannel) && question.answers.length > 1 ? question.answers : [];
    const each = h("button", { type: "button", click: () => this.divide(this, channels) }, `A recording of each of the ${channels.length}`);
    return h("div", { class: "asked" }, text, answers, channels.length > 0 && each);
  }

  private say(tell: () => void): void {
    tell();
    void this.read().then(() => this.look());
  }

  private columns(described: Described): HTMLElement {
    const rows = described.files.flatMap((file, index) => {
      const isOne = described.files.length === 1;
      return file.columns.map((column, place) => {
        const number = isOne ? String(place + 1) : `${index + 1}:${place + 1}`;
        return this.column(described, column, number, isOne ? "" : file.name);
      });
    });
    const head = ["#", "column", "taken for", "unit", "first", "last"].map((text) => h("th", { scope: "col" }, text));
    return h(
      "details",
      { open: true },
      h("summary", {}, "Columns"),
      ...described.files.map((file) => h("p", { class: "hint" }, `${file.name}: ${file.description}`)),
      h(
        "div",
        { class: "scroll", tabindex: 0, role: "region", "aria-label": `columns of ${this.title}` },
        h("table", {}, h("thead", {}, h("tr", {}, ...head)), h("tbody", {}, ...rows)),
      ),
    );
  }

  private column(
    described: Described,
    column: Described["files"][number]["columns"][number],
    number: string,
    file: string,
  ): HTMLElement {
    const name = column.heading || number;
    const [role, unit] = column.taken ?? ["", ""];
    const unsure = !column.taken && column.candidate ? `(${column.candidate}?)` : "–";
    const roles = described.roles.map((one): [string, string] => [one.name, one.name]);
    const takeFor = (wanted: string) => this.say(() => this.answers.column(number, role, wanted));
    const roleChoice = choice(`${name} is taken for`, [["", unsure], ...roles], role, takeFor, true);
    roleChoice.querySelector("select")?.setAttribute("name", `role ${number}`);
    const units = described.roles.find((one) => one.name === role)?.units ?? [];
    const options = (units.includes(unit) ? units : [unit, ...units]).map((one): [string, string] => [one, one]);
    const unitChoice = choice(`unit of ${name}`, options, unit, (it) => this.say(() => this.answers.unit(role, it)), true);
    unitChoice.querySelector("select")?.setAttribute("name", `unit ${number}`);
    return h(
      "tr",
      {},
      h("td", {}, number),
      h("td", { title: file }, column.heading, column.unit ? h("span", { class: "hint" }, ` ${column.unit}`) : ""),
      h("td", {}, roleChoice),
      h("td", {}, role ? unitChoice : ""),
      h("td", {}, column.first.slice(0, 24)),
      h("td", {}, column.last.slice(0, 24)),
    );
  }

  private more(described: Described | undefined): HTMLElement {
    const { answers } = this;
    const length = field("Length of the unstretched sensor, mm", answers.gaugeLength, (it) =>
      this.say(() => (answers.gaugeLength = it)), { inputmode: "decimal", name: "length" });
    const rate = field("Rows a second, if no column is a time", answers.rate, (it) => this.say(() => (answers.rate = it)), {
      inputmode: "decimal",
      name: "rate",
    });
    const others = field("Other flags of `ohmstrain import`", answers.others, (it) => this.say(() => (answers.others = it)), {
      name: "flags",
      spellcheck: "false",
    });
    const command = described?.flags ? `ohmstrain import ${this.files.map((file) => file.name).join(" ")} ${described.flags}` : "";
    const isAsked = Boolean(this.error || described?.question);
    return h(
      "details",
      { open: isAsked },
      h("summary", {}, "More that can be said of it"),
      h("div", { class: "fields" }, length, rate, others),
      command !== "" && h("p", { class: "hint" }, "The same on the command line: ", h("code", {}, command)),
    );
  }

  private async download(): Promise<void> {
    save("trace.csv", (await this.csv()) as BlobPart, "text/csv");
  }
}

function remarks(texts: string[]): HTMLElement {
  return h("ul", { class: "remarks" }, ...texts.map((text) => h("li", {}, text)));
}

/** The column of readings that an answer names; empty if it is another answer. */
export function channelOf(answer: string): string {
  return /^--column '?(?:resistance|ratio|adc)=(.+?)'?$/.exec(answer)?.[1] ?? "";
}

/** Readings, and the reference if there is one. */
export function plotOf(recording: RecordingData): HTMLElement {
  const isAngle = recording.quantity === "angle_deg";
  const scale = isAngle ? 1 : 100;
  const reference = recording.reference?.map((value) => value * scale);
  const right = isAngle ? "angle, °" : "strain, %";
  const { time, reading, unit, name, rows } = recording;
  const readings = { label: unit === "ohm" ? "Ω" : "R/R₀", colour: "reading", values: reading };
  const plot = new Plot({
    title: `${name}: ${rows} rows`,
    time,
    left: unit === "ohm" ? "reading, Ω" : "reading, R/R₀",
    ...(reference ? { right } : {}),
    lines: [readings, ...(reference ? [{ label: right, colour: "reference", values: reference, axis: "right" as const }] : [])],
  });
  return plot.element;
}

/** Place of the cards. */
export function show(groups: Group[]): void {
  byId("recordings").replaceChildren(...groups.map((group) => group.element));
}
