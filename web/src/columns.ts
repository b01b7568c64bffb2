/** Columns of a stream without a header: what its cells may be. */

/** Names of a column of a stream. */
export const STREAM_ROLES: [string, string][] = [
  ["", "nothing"],
  ["time_s", "time, s"],
  ["time_ms", "time, ms (millis())"],
  ["time_us", "time, µs (micros())"],
  ["resistance_ohm", "resistance, Ω"],
  ["resistance_ratio", "R/R₀"],
  ["adc", "converter code"],
  ["strain", "strain"],
  ["temperature_c", "temperature, °C"],
];

/** The cells of the last line that is all numbers, and those of the one before; nothing if there are not two. */
function lastTwo(lines: string[]): [number[], number[]] | undefined {
  const rows = lines.map((line) => line.split(",").map((cell) => (cell.trim() === "" ? Number.NaN : Number(cell))));
  const numbers = rows.filter((row) => row.every(Number.isFinite));
  const [before, last] = numbers.slice(-2);
  return before && last && before.length === last.length ? [before, last] : undefined;
}

/** A guess at the columns of lines: a rising whole number in front is a time, the first other column the resistance. */
export function guess(lines: string[]): string[] | undefined {
  const pair = lastTwo(lines);
  if (!pair) return undefined;
  const [before, last] = pair;
  const step = (last[0] ?? 0) - (before[0] ?? 0);
  const isWhole = Number.isInteger(last[0]) && Number.isInteger(before[0]);
  const hasTime = last.length > 1 && step > 0;
  const time = isWhole ? (step < 1000 ? "time_ms" : "time_us") : "time_s";
  return last.map((_, place) => {
    if (hasTime && place === 0) return time;
    return place === (hasTime ? 1 : 0) ? "resistance_ohm" : "";
  });
}

/** The header of a stream whose columns are these; what is nothing has a name that no column has. */
export function header(roles: string[]): string {
  return roles.map((role, place) => role || `unused_${place + 1}`).join(",");
}
