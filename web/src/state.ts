/** State of the page: recordings, a sensor, and listeners for changes. */

import type { SensorDescription } from "../pkg/ohmstrain.js";
import { Engine } from "./engine";
import type { Group } from "./recordings";

/** A sensor, and the worker that runs it. */
export interface SensorState {
  engine: Engine;
  toml: string;
  sensor: SensorDescription;
  /** The recording that it was calibrated on, if it was here. */
  calibratedOn?: string | undefined;
}

let reader: Promise<Engine> | undefined;
const listeners: (() => void)[] = [];

export const state = {
  groups: [] as Group[],
  current: undefined as SensorState | undefined,

  /** The worker that reads files; another one if it was broken. */
  async reader(): Promise<Engine> {
    const engine = await reader;
    if (engine && !engine.isBroken) return engine;
    reader = Engine.start();
    return reader;
  },

  /** Another sensor. */
  useSensor(next: SensorState): void {
    if (state.current && state.current.engine !== next.engine) state.current.engine.terminate();
    state.current = next;
    for (const listener of listeners) listener();
  },

  /** Calls this whenever there is another sensor. */
  onSensor(listener: () => void): void {
    listeners.push(listener);
  },
};
