// Runs the package as somebody does who has just installed it: README.md's code, with a recording of its own.
import assert from "node:assert/strict";
import init, { Recording, Sensor, calibrate } from "ohmstrain";

await init();
const time = Float64Array.from({ length: 400 }, (_, k) => 0.1 * k);
const strain = time.map((t) => 0.15 - 0.15 * Math.cos(0.6 * t));
const ohm = strain.map((e) => 1600 * (1 + 1.9 * e - 2 * e * e));
const made = calibrate([new Recording(time, ohm, strain)], { estimator: "ekf" });
console.log(made.lines().map(([name, text]) => `${name.padEnd(13)}${text}`).join("\n"));
const sensor = Sensor.fromToml(made.sensor().toToml());
const filter = sensor.filter({ initialStrain: 0 });
const rows = Array.from(time, (t, k) => filter.step(t, ohm[k]));
const error = Math.max(...rows.map((row, k) => Math.abs(row.strain - strain[k])));
assert.ok(error < 0.03, `the filter is off by ${error}`);
assert.throws(() => filter.step(0, 1600), /time/);
console.log(`npm package: ${rows.length} rows filtered, at most ${error.toFixed(4)} off`);
