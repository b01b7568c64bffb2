//! Types of the structures that are handed to JavaScript.

use wasm_bindgen::prelude::*;

#[wasm_bindgen(typescript_custom_section)]
const TYPES: &str = r#"
/** Options of a calibration; each has a default. */
export interface Choices {
  /** `auto`, or the name of an estimator: `ekf` takes a second or two. */
  estimator?: string;
  /** Relaxing branches of the law, 0 to 4. */
  branches?: number;
  /** `auto`, `polynomial`, `decaying-exponential` or `tunnelling`. */
  gauge?: string;
  /** True to move a reference that is late. */
  align?: boolean;
  /** Only rows at this time, s, or later. */
  from?: number;
  /** Only rows before this time, s. */
  until?: number;
  /** Name of the sensor's file in sentences. */
  file?: string;
}

/** Options of a filter; each has a default. */
export interface Wishes {
  estimator?: string;
  /** Reading of the rested sensor now, in its unit. */
  restResistance?: number;
  initialStrain?: number;
  /** Squared innovations over their variance above this are outliers. */
  gate?: number;
}

/** A row of `estimates.csv`: numbers under the names of its columns, null where they are not known. */
export interface Estimate {
  time_s: number;
  strain?: number;
  strain_sd?: number;
  flags: string;
  [column: string]: number | string | null | undefined;
}

export interface SensorDescription {
  estimator: string;
  estimators: string[];
  quantity: "strain" | "angle_deg";
  unit: "ohm" | "ratio";
  /** Reading of the rested sensor in calibration. */
  rest: number;
  limits: [number, number];
  columns: string[];
}

/** Estimated cost of a filter on a chip. */
export interface Cost {
  instructions: number;
  flash: number;
  ram: number;
  stack: number;
}

/** State of a stream of lines from a board. */
export interface StreamSummary {
  counts: { rows: number; missing: number; badLines: number; restarts: number };
  message: string;
  /** Columns that were found; none before a header. */
  columns: string[];
  /** Lines above the header of a record. */
  metadata: string;
}

/** Findings about files. */
export interface Described {
  files: DescribedFile[];
  question: { text: string; answers: string[] } | null;
  remarks: string[];
  /** Flags of `ohmstrain import` for all of it. */
  flags: string;
  is_trace: boolean;
  roles: { name: string; units: string[] }[];
}

export interface DescribedFile {
  name: string;
  description: string;
  columns: DescribedColumn[];
}

export interface DescribedColumn {
  heading: string;
  unit: string;
  /** Role and unit. */
  taken: [string, string] | null;
  candidate: string | null;
  first: string;
  last: string;
}
"#;
