/** The page: files in, steps in their order. */

import "uplot/dist/uPlot.min.css";
import "./style.css";
import { showCalibration } from "./calibrate";
import { byId, h } from "./dom";
import { Engine } from "./engine";
import { restartLive, showLive } from "./live";
import { type Dropped, Group, channelOf, show } from "./recordings";
import { onUse, showRecords } from "./records_view";
import { state } from "./state";
import { showUse } from "./use";

let made = 0;

function changed(): void {
  showCalibration();
  showUse();
  showLive();
}

function group(files: Dropped[], channel = ""): Group {
  made += 1;
  return new Group(`recording ${made}`, files, () => state.reader(), changed, (one, answers) => void divide(one, answers), channel);
}

/** Puts a recording of each channel in the place of their files. */
async function divide(whole: Group, answers: string[]): Promise<void> {
  const channels = answers.map((answer) => {
    const one = group(whole.files, channelOf(answer));
    one.answers = whole.answers.copy();
    one.answers.answer(answer);
    return one;
  });
  state.groups.splice(state.groups.indexOf(whole), 1, ...channels);
  await Promise.all(channels.map((one) => one.read()));
  show(state.groups);
  changed();
  for (const one of channels) await one.look();
}

function say(text: string): void {
  byId("status").textContent = text;
}

/** Takes files: sensors apart from recordings, and several recordings apart from files of one. */
async function take(files: Dropped[]): Promise<void> {
  say(`reading ${files.map((file) => file.name).join(", ")}`);
  const isSensor = (file: Dropped) => new TextDecoder().decode(file.bytes.subarray(0, 9)) === "format = ";
  for (const file of files.filter(isSensor)) await useSensor(file);
  const others = files.filter((file) => !isSensor(file));
  const alone = others.map((file) => group([file]));
  await Promise.all(alone.map((one) => one.read()));
  const areRecordings = alone.length < 2 || alone.every((one) => one.recording?.reference);
  const groups = areRecordings ? alone : [group(others)];
  if (!areRecordings) await groups[0]?.read();
  state.groups.push(...groups);
  show(state.groups);
  changed();
  byId("clear").hidden = state.groups.length === 0;
  say("");
  for (const one of groups) await one.look();
}

async function useSensor(file: Dropped): Promise<void> {
  try {
    const engine = await Engine.start();
    const read = await engine.call("useSensor", new TextDecoder().decode(file.bytes), file.name);
    state.useSensor({ engine, ...read });
  } catch (error) {
    byId("errors").replaceChildren(h("p", { class: "error", role: "alert" }, (error as Error).message));
  }
}

async function takeFiles(list: FileList | null | undefined): Promise<void> {
  const files = Array.from(list ?? []);
  if (files.length === 0) return;
  byId("errors").replaceChildren();
  const read = async (file: File) => ({ name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) });
  await take(await Promise.all(files.map(read)));
}

function clear(): void {
  state.groups = [];
  show([]);
  changed();
  byId("clear").hidden = true;
}

function listen(): void {
  const zone = byId("drop");
  const input = byId("files") as HTMLInputElement;
  input.addEventListener("change", () => void takeFiles(input.files).then(() => (input.value = "")));
  for (const type of ["dragenter", "dragover"]) {
    window.addEventListener(type, (event) => {
      event.preventDefault();
      zone.classList.add("over");
    });
  }
  window.addEventListener("dragleave", () => zone.classList.remove("over"));
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    void takeFiles(event.dataTransfer?.files);
  });
  byId("example").addEventListener("click", () => void example());
  byId("clear").addEventListener("click", clear);
}

async function example(): Promise<void> {
  const { name, bytes } = await (await state.reader()).call("example", 1);
  await take([{ name, bytes }]);
}

listen();
state.onSensor(() => {
  showUse();
  restartLive();
});
onUse((name, bytes) => void take([{ name, bytes }]));
changed();
void showRecords();
void state.reader();
