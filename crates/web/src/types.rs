//! Types of the structures that are handed to JavaScript.

use wasm_bindgen::prelude::*;

#[wasm_bindgen(typescript_custom_section)]
const TYPES: &str = r#"
/** What is left to choose in a calibration; each has a default. */
export interface Choices {
  /** `auto`, or the name of an estimator: `ekf` takes a second or two. */
  estimator?: string;
  /** Relaxing branches of the law, 0 to 4. */
  branches?: number;
  /** `auto`, `polynomial`, `decaying-exponential` or `tunnelling`. */
  gauge?: string;
  /** Whether a reference that is late is moved. */
  align?: boolean;
  /** Only rows at this time, s, or later. */
  from?: number;
  /** Only rows before this time, s. */
  until?: number;
  /** What sentences call the sensor's file. */
  file?: string;
}

/** How a filter is to be; each has a default. */
export interface Wishes {
  estimator?: string;
  /** What the rested sensor reads now, in its unit. */
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
  /** What the rested sensor read in calibration. */
  rest: number;
  limits: [number, number];
  columns: string[];
}

/** What a filter costs on a chip, estimated. */
export interface Cost {
  instructions: number;
  flash: number;
  ram: number;
  stack: number;
}

/** What there is to say of the lines of a board. */
export interface StreamSummary {
  counts: { rows: number; missing: number; badLines: number; restarts: number };
  message: string;
  /** Columns that were found; none before a header. */
  columns: string[];
  /** Lines above the header of a record. */
  metadata: string;
}

/** What stands in files. */
export interface Described {
  files: DescribedFile[];
  question: { text: string; answers: string[] } | null;
  remarks: string[];
  /** Flags of `ohmstrain import` that say all of it. */
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
