/** Messages between page and worker. */

/** A recording as a plot takes it. NaN stands for what is missing. */
export interface RecordingData {
  name: string;
  rows: number;
  time: Float64Array;
  reading: Float64Array;
  reference: Float64Array | undefined;
  unit: string;
  quantity: string | undefined;
}

/** Estimates of a recording, and their `estimates.csv`. */
export interface Series {
  time: Float64Array;
  strain: Float64Array;
  sd: Float64Array;
  csv: Uint8Array;
  warnings: string[];
}

/** Stage of a calibration. */
export interface Progress {
  call: number;
  stage: string;
  share: number;
}
