/** Step 4: a board on a USB cable, or a recording that is played; strain with its interval, and a record of the readings. */

import type { StreamSummary } from "../pkg/ohmstrain.js";
import { STREAM_ROLES, guess, header } from "./columns";
import { byId, choice, field, h } from "./dom";
import { LiveView } from "./live_view";
import { append } from "./records";
import { showRecords } from "./records_view";
import { type Listener, NO_SERIAL, type Source, hasSerial, openPort, play } from "./serial";
import { type SensorState, state } from "./state";

const BAUDS = ["9600", "19200", "38400", "57600", "115200", "230400", "250000", "500000", "921600", "1000000"];
/** Lines without a header after which columns are asked for. */
const LINES_WITHOUT = 8;
const RAW_LINES = 8;
/** Least time between updates from a calm stream, ms; it saves a battery, and nobody sees more. */
const CALM_MS = 90;

const chosen = { baud: "115200", frontEnd: "", recording: "", speed: "1" };
let source: Source | undefined;
let session: Session | undefined;

/** Ends what runs with another sensor, and draws the step. */
export function restartLive(): void {
  void stop();
  byId("live-result").replaceChildren();
  showLive();
}

/** Draws the step; it is drawn again whenever there are other recordings. */
export function showLive(): void {
  const place = byId("live-controls");
  const { current } = state;
  if (!current) {
    place.replaceChildren(...(hasSerial() ? [] : [h("p", { class: "hint" }, NO_SERIAL)]), h("p", { class: "hint" }, "Needs a sensor."));
    return;
  }
  const bauds = BAUDS.map((baud): [string, string] => [baud, `${baud} baud`]);
  const connect = h("button", { type: "button", class: "main", id: "connect", click: () => void start(current) }, "Connect a board");
  const port = [
    choice("Speed of the port", bauds, chosen.baud, (it) => (chosen.baud = it)),
    field("Electronics of converter codes", chosen.frontEnd, (it) => (chosen.frontEnd = it), {
      placeholder: "divider reference_ohm=10000 side=low bits=12",
    }),
  ];
  place.replaceChildren(
    ...(hasSerial() ? [h("div", { class: "fields" }, ...port), connect] : [h("p", { class: "hint" }, NO_SERIAL)]),
    player(current),
  );
}

/** Plays a recording. */
function player(current: SensorState): HTMLElement {
  const usable = state.groups.filter((group) => group.recording);
  if (usable.length === 0) return h("p", { class: "hint" }, "A recording of step 1 can be played here, too.");
  if (!usable.some((group) => group.id === chosen.recording)) chosen.recording = usable[0]?.id ?? "";
  const names = usable.map((group): [string, string] => [group.id, group.title]);
  const speeds = ["1", "2", "5", "10", "50"].map((it): [string, string] => [it, `${it} ×`]);
  return h(
    "div",
    { class: "fields" },
    choice("Recording", names, chosen.recording, (it) => (chosen.recording = it)),
    choice("Speed", speeds, chosen.speed, (it) => (chosen.speed = it)),
    h("button", { type: "button", id: "play", click: () => void start(current, chosen.recording) }, "Play it"),
  );
}

/** Ends what runs. */
async function stop(): Promise<void> {
  const [last, ended] = [source, session];
  source = undefined;
  session = undefined;
  await last?.stop();
  await ended?.end();
}

async function start(current: SensorState, recording?: string): Promise<void> {
  await stop();
  const next = new Session(current);
  try {
    await current.engine.call("streamOpen", undefined, chosen.frontEnd);
    session = next;
    byId("live-result").replaceChildren(next.view.element);
    if (recording === undefined) {
      source = await openPort(Number(chosen.baud), next);
      return;
    }
    const group = state.groups.find((one) => one.id === recording);
    if (!group?.recording) return;
    const csv = new TextDecoder().decode(await group.csv());
    source = play(csv, group.recording.time, Number(chosen.speed), next);
  } catch (error) {
    const text = error instanceof Error ? error.message : String(error);
    byId("live-result").replaceChildren(h("p", { class: "error", role: "alert" }, text));
  }
}

/** Lines on their way from a source through the worker to the plot and the record. */
class Session implements Listener {
  readonly view: LiveView;
  private waiting = "";
  private isTaking = false;
  private raw: string[] = [];
  private isHeaded = false;
  /** Name of the record that is being written, and how many parts it has. */
  private record: string | undefined;
  private parts = 1;
  private saving: Promise<void> = Promise.resolve();

  constructor(private readonly current: SensorState) {
    this.view = new LiveView(current.sensor, {
      rest: () => void this.tell("streamRest"),
      zero: () => void this.tell("streamZero"),
      record: () => void this.toggleRecord(),
      stop: () => void stop(),
    });
  }

  connected(name: string): void {
    this.view.status(`reading ${name}`);
  }

  away(why: string): void {
    const kept = this.record ? `; what was recorded is kept in ${this.record}` : "";
    this.view.status(`no more comes: ${why.replace(/\.$/, "")}${kept}`);
    if (this.record) void this.saving.then(showRecords);
  }

  lines(text: string, arrivedSeconds: number): void {
    this.waiting += text;
    this.raw = [...this.raw, ...text.split(/\r?\n/).filter((line) => line !== "")].slice(-RAW_LINES);
    if (!this.isTaking) void this.take(arrivedSeconds);
  }

  /** Ends the record. */
  async end(): Promise<void> {
    await this.saving;
    this.record = undefined;
    await showRecords();
  }

  private async take(arrivedSeconds: number): Promise<void> {
    this.isTaking = true;
    try {
      while (this.waiting !== "") {
        const text = this.waiting;
        this.waiting = "";
        const { rows, summary, recorded } = await this.current.engine.call("streamTake", text, arrivedSeconds);
        this.view.take(rows, summary, this.raw);
        if (summary.columns.length > 0) this.isHeaded = true;
        if (!this.isHeaded && summary.counts.badLines >= LINES_WITHOUT) this.askColumns();
        if (this.record) this.keepAll(this.record, recorded);
        if (this.view.isCalm) await new Promise((wake) => setTimeout(wake, CALM_MS));
      }
    } catch (error) {
      this.view.fail(error instanceof Error ? error.message : String(error));
      void stop();
    } finally {
      this.isTaking = false;
    }
  }

  /** A stream without a header: its columns are guessed, and can be said. */
  private askColumns(): void {
    const guessed = guess(this.raw);
    if (!guessed || this.view.asks) return;
    const roles = [...guessed];
    const choices = roles.map((role, place) =>
      choice(`Column ${place + 1}`, STREAM_ROLES, role, (it) => (roles[place] = it)),
    );
    this.view.ask(choices, async () => {
      try {
        await this.current.engine.call("streamOpen", header(roles), chosen.frontEnd);
        this.isHeaded = true;
        return "";
      } catch (error) {
        return error instanceof Error ? error.message : String(error);
      }
    });
  }

  private async tell(method: "streamRest" | "streamZero"): Promise<void> {
    try {
      const summary = await this.current.engine.call(method);
      this.view.showSummary(summary);
    } catch (error) {
      this.view.fail(error instanceof Error ? error.message : String(error));
    }
  }

  private async toggleRecord(): Promise<void> {
    if (this.record) {
      this.record = undefined;
      this.view.recording(undefined);
      await this.saving;
      await showRecords();
      return;
    }
    const summary: StreamSummary = await this.current.engine.call("streamSummary");
    if (summary.columns.length === 0) return;
    const name = `live-${new Date().toISOString().slice(0, 23).replaceAll(/[:.]/g, "-")}.csv`;
    this.parts = 1;
    this.keep(name, `${summary.metadata}${summary.columns.join(",")}\n`);
    this.record = name;
    this.view.recording(name);
  }

  /** Stores rows of a record; the second text and later ones are records of their own, after a restart of the clock or another header. */
  private keepAll(record: string, [rows, ...others]: string[]): void {
    if (rows) this.keep(record, rows);
    for (const other of others) {
      const earlier = this.record ?? record;
      this.parts += 1;
      this.record = record.replace(/(-part\d+)?\.csv$/, `-part${this.parts}.csv`);
      // The list shows the earlier record, which is complete now.
      this.saving = this.saving.then(showRecords);
      this.keep(this.record, other);
      this.view.recording(this.record);
      this.view.status(`another clock or header: recording to ${this.record}; ${earlier} is kept`);
    }
  }

  /** Stores rows, one piece after the other. */
  private keep(record: string, text: string): void {
    this.saving = this.saving
      .then(() => append(record, text))
      .catch((error: Error) => this.view.fail(`cannot record: ${error.message}`));
  }
}
