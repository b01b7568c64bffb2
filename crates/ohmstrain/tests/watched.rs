//! A filter with remarks for a person who watches.

use ohmstrain::trace::WatchedFilter;
use ohmstrain::{Estimate, Flags, Known, Sensor, TemperatureParams};
use ohmstrain_bench_data::simulate::{Chamber, Material, Protocol, SimulationSettings, simulate};
use ohmstrain_bench_data::{Line, LineParser, Metadata, Reading, Row, Trace};

fn sensor() -> Sensor {
    Sensor::from_toml(include_str!("../examples/sensor.toml")).unwrap()
}

fn row(time_s: f64, ohm: f64) -> Row {
    let reading = Reading { value: ohm, sd_ohm: None, code: None, saturated: false };
    Row { line: 1, time_s, reading, reference: f64::NAN, reference_sd: f64::NAN, temperature_c: f64::NAN }
}

/// Takes readings, five a second from `start_s` on, and returns the last estimate.
fn takes(filter: &mut WatchedFilter, start_s: f64, readings: impl IntoIterator<Item = f64>) -> Estimate {
    let mut last = None;
    for (k, ohm) in (0_u32..).zip(readings) {
        let estimate = filter.step(&row(start_s + 0.2 * f64::from(k), ohm)).unwrap();
        filter.remark(&estimate, "z").unwrap();
        last = Some(estimate);
    }
    last.unwrap()
}

/// Readings around that of the rested sensor, 1600 Ω.
fn rested(count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(|k| 1600.0 + f64::from(k % 3))
}

/// After a zero, a strain known before it is not told again, and one that is to come is.
#[test]
fn a_zero_forgets_strains_known_before_it() {
    let sensor = sensor();
    let known = [Known::new(1.0, 0.2), Known::new(30.0, 0.1)];
    let wanted = sensor.filter().known(&known);
    let mut filter = WatchedFilter::new(wanted, 0).unwrap();
    takes(&mut filter, 0.0, rested(50));
    // Two each of 1600, 1601 and 1602 Ω in the last second.
    assert_eq!(filter.zero(wanted), "R0 is 1601 now, the median of 6 readings; it starts again at zero");
    let after = takes(&mut filter, 10.0, rested(1));
    assert!(after.strain.abs() < 0.01, "{}", after.strain);
    let told = takes(&mut filter, 30.0, rested(1));
    assert!((told.strain - 0.1).abs() < 0.01, "{}", told.strain);
}

/// The last five known readings are the zero if fewer came within a second, as with gaps; a second zero at once has the
/// same ones. Without a reading, before the first one or after another header, nothing changes, and the sentence says so.
#[test]
fn a_zero_needs_five_known_readings_or_takes_the_last() {
    let sensor = sensor();
    let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
    let none = "R0 stays as it was: there is no reading yet";
    assert_eq!(filter.zero(sensor.filter()), none);
    takes(&mut filter, 0.0, [f64::NAN; 3]);
    assert_eq!(filter.zero(sensor.filter()), none);
    // At 1.0 to 2.2 s; then none for 2 s, and two at 4.2 and 4.4 s.
    takes(&mut filter, 1.0, [1590.0, 1591.0, 1592.0, 1593.0, 1600.0, 1601.0, 1605.0]);
    takes(&mut filter, 2.4, [f64::NAN; 9]);
    takes(&mut filter, 4.2, [1606.0, 1607.0]);
    // The last five begin at 1.8 s.
    let last_five = "R0 is 1605 now, the median of 5 readings over 2.6 s; it starts again at zero";
    assert_eq!([filter.zero(sensor.filter()), filter.zero(sensor.filter())], [last_five; 2]);
    let after = takes(&mut filter, 4.6, [1605.0]);
    let fresh = sensor.filter().rest_resistance(1605.0).initial_strain(0.0).build().unwrap().step(4.6, 1605.0).unwrap();
    assert_eq!((after.strain, after.strain_sd), (fresh.strain, fresh.strain_sd));
    filter.begin(sensor.filter(), false).unwrap();
    assert_eq!(filter.zero(sensor.filter()), none);
}

/// A reading that cannot be R₀ is refused in words; the filter and its R₀ stay.
#[test]
fn a_zero_far_from_the_calibration_changes_nothing() {
    let sensor = sensor();
    let strain_of = |zeroed: bool| {
        let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
        takes(&mut filter, 0.0, [20_000.0; 10]);
        if zeroed {
            let said = filter.zero(sensor.filter());
            assert!(said.starts_with("R0 stays as it was: "), "{said}");
        }
        takes(&mut filter, 2.0, rested(5)).strain
    };
    assert_eq!(strain_of(true), strain_of(false));
}

/// The median of the first readings is R₀, also for a filter that begins anew; a zero among them has the last word.
#[test]
fn the_first_readings_give_r0_unless_a_person_does() {
    let sensor = sensor();
    // The first five are 160 Ω larger.
    let shifted = || (0_u32..).zip(rested(10)).map(|(k, ohm)| 1.3 * ohm + if k < 5 { 160.0 } else { 0.0 });
    let strain_of = |zeroed: bool| {
        let mut filter = WatchedFilter::new(sensor.filter(), 10).unwrap();
        takes(&mut filter, 0.0, shifted().take(5));
        if zeroed {
            filter.zero(sensor.filter());
        }
        takes(&mut filter, 1.0, shifted().skip(5));
        filter.begin(sensor.filter(), false).unwrap();
        takes(&mut filter, 0.0, shifted()).strain
    };
    let given = |rest: f64| {
        let mut filter = sensor.filter().rest_resistance(rest).build().unwrap();
        let rows = (0_u32..).zip(shifted());
        rows.map(|(k, ohm)| filter.step(0.2 * f64::from(k), ohm).unwrap().strain).last().unwrap()
    };
    // In order of size the last five come first: the middle of ten is between the largest of them, 1602 Ω times 1.3, and the least of
    // the first five, 1600 Ω times 1.3, and 160 Ω. The middle of those alone is 1601 Ω times 1.3, and 160 Ω.
    assert_eq!(strain_of(false), given(0.5 * (1.3 * 1602.0 + (1.3 * 1600.0 + 160.0))));
    assert_eq!(strain_of(true), given(1.3 * 1601.0 + 160.0));
}

/// Twenty readings in the wrong unit are remarked upon, once.
#[test]
fn the_unit_of_the_first_readings_is_doubted_once() {
    let sensor = sensor();
    let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
    let mut remarks = Vec::new();
    for (k, ohm) in (0_u32..).zip(rested(40)) {
        let estimate = filter.step(&row(0.2 * f64::from(k), 1e-3 * ohm)).unwrap();
        remarks.extend(filter.remark(&estimate, "z").unwrap().map(|remark| (k, remark)));
    }
    let of_unit: Vec<u32> = remarks
        .iter()
        .filter(|(_, remark)| remark.contains("kΩ") || remark.contains("kohm"))
        .map(|(k, _)| *k)
        .collect();
    assert_eq!(of_unit, [19], "{remarks:?}");
}

/// The effect of the chamber, as if a calibration knew it exactly.
const EFFECT: TemperatureParams = TemperatureParams {
    reference_c: 25.0,
    lower_c: 10.0,
    upper_c: 40.0,
    rest_per_k: 0.003,
    rest_per_k_sd: 0.0,
    gain_per_k: -0.002,
    gain_per_k_sd: 0.0,
};

/// The sensor, calibrated with a thermometer.
fn warmed_sensor() -> Sensor {
    let mut params = sensor().params().clone();
    params.temperature = Some(EFFECT);
    Sensor::from_params(params).unwrap()
}

/// A recording in a climate chamber: times, readings and temperatures. The first two temperatures are missing, and later one in four.
fn chamber() -> Vec<[f64; 3]> {
    let chamber = Chamber { low_c: 20.0, high_c: 30.0, period_s: 100.0, ..Chamber::default() };
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        sample_rate_hz: 5.0,
        chamber: Some(chamber),
        ..SimulationSettings::new(Material::Ecoflex0030, Protocol::Mixed { duration_s: 200.0 })
    };
    let trace = simulate(&settings).unwrap();
    let temperature_c = trace.temperature_c.unwrap();
    let known = |k: usize| if k < 2 || k % 4 == 1 { f64::NAN } else { temperature_c[k] };
    (0..1000).map(|k| [trace.time_s[k], trace.readings.values[k], known(k)]).collect()
}

/// Row at which the clock is taken to restart; it has no temperature.
const RESTART: usize = 701;

/// Filters lines under a header, as terminal and page do; returns the estimates, and the remark on the header.
fn streamed(header: &str, lines: impl Iterator<Item = String>) -> (Vec<Estimate>, Option<&'static str>) {
    let sensor = warmed_sensor();
    let mut parser = LineParser::new("the port", Metadata::default());
    let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
    assert_eq!(parser.take(header.as_bytes()), Ok(Line::Header));
    let remark = filter.begin(sensor.filter(), parser.has_temperature()).unwrap();
    let estimates = lines.enumerate().map(|(k, line)| {
        if k == RESTART {
            filter.begin(sensor.filter(), parser.has_temperature()).unwrap();
        }
        let Ok(Line::Row(row)) = parser.take(line.as_bytes()) else { panic!("{line}") };
        filter.step(&row).unwrap()
    });
    (estimates.collect(), remark)
}

/// Estimates of these readings by a sensor without an effect of temperature.
fn plain(rows: &[(f64, f64)]) -> Vec<Estimate> {
    let of = |rows: &[(f64, f64)]| -> Vec<Estimate> {
        let mut filter = sensor().filter().build().unwrap();
        rows.iter().map(|(time_s, ohm)| filter.step(*time_s, *ohm).unwrap()).collect()
    };
    [of(&rows[..RESTART]), of(&rows[RESTART..])].concat()
}

/// Readings with temperatures are those at the calibration's temperature, by R(T) = R₀ (1 + α_R ΔT) (1 + ρ (1 + α_ρ ΔT)). A missing
/// temperature is the one before it, also after a restart.
#[test]
fn a_stream_with_temperatures_is_converted() {
    let rest = sensor().params().rest_reading;
    let mut last_c = EFFECT.reference_c;
    let converted = chamber().into_iter().map(|[time_s, ohm, celsius]| {
        last_c = if celsius.is_nan() { last_c } else { celsius };
        let above_k = last_c - 25.0;
        let rho = (ohm / (rest * (1.0 + 0.003 * above_k)) - 1.0) / (1.0 - 0.002 * above_k);
        (time_s, rest * (1.0 + rho))
    });
    let expected = plain(&converted.collect::<Vec<_>>());
    let cell = |celsius: f64| if celsius.is_nan() { String::new() } else { celsius.to_string() };
    let lines = chamber().into_iter().map(|[time_s, ohm, celsius]| format!("{time_s},{ohm},{}", cell(celsius)));
    let (found, remark) = streamed("time_s,resistance_ohm,temperature_c", lines);
    assert_eq!(remark, None);
    for (found, expected) in found.iter().zip(&expected) {
        let apart = |of: fn(&Estimate) -> f64| (of(found) - of(expected)).abs();
        // The two conversions differ by a few roundings, 1e-15 of a reading; the filter may amplify them a thousandfold.
        let apart = apart(|row| row.strain) + apart(|row| row.strain_sd) + apart(|row| row.resistance.unwrap() / 2e3);
        assert!(apart < 1e-11, "{} s: {apart}", found.time_s);
    }
}

/// A record has the readings as they came, beside their temperatures: filtered later, it gives the strains that were shown.
#[test]
fn a_record_is_converted_once() {
    let cell = |number: f64| if number.is_nan() { String::new() } else { number.to_string() };
    let header = "time_s,resistance_ohm,temperature_c";
    let sent: Vec<String> =
        chamber().into_iter().map(|[time_s, ohm, celsius]| format!("{time_s},{ohm},{}", cell(celsius))).collect();

    let sensor = warmed_sensor();
    let mut parser = LineParser::new("the port", Metadata::default());
    let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
    parser.take(header.as_bytes()).unwrap();
    filter.begin(sensor.filter(), parser.has_temperature()).unwrap();
    let mut shown = Vec::new();
    let mut record = vec![["time_s"].into_iter().chain(parser.recorded_columns()).collect::<Vec<_>>().join(",")];
    for line in &sent {
        let Ok(Line::Row(row)) = parser.take(line.as_bytes()) else { panic!("{line}") };
        shown.push(filter.step(&row).unwrap().strain);
        record.push([row.time_s].into_iter().chain(parser.recorded(&row)).map(cell).collect::<Vec<_>>().join(","));
    }
    assert_eq!(record[0], header);
    assert_eq!(record[1..], sent);

    let trace = Trace::read(record.join("\n").as_bytes(), "record.csv").unwrap();
    let converted = sensor.at_reference_temperature(&trace.readings.values, trace.temperature_c.as_ref().unwrap());
    let mut again = sensor.filter().build().unwrap();
    let strains = trace.time_s.iter().zip(&converted).map(|(time_s, ohm)| again.step(*time_s, *ohm).unwrap().strain);
    assert_eq!(strains.collect::<Vec<_>>(), shown);
}

/// Without temperatures, strains are those of the readings as they are. Their variance is larger by what a reading, evenly distributed over
/// the calibrated range, changes at temperatures that are evenly distributed over the calibration's; also after a zero.
#[test]
fn a_stream_without_temperatures_has_wider_intervals() {
    let params = sensor().params().clone();
    let rho = |reading: f64| reading / params.rest_reading - 1.0;
    let (low, high) = (rho(params.validity.reading_lower), rho(params.validity.reading_upper));
    let square_per_k = |rho: f64| (0.003 * (1.0 + rho) - 0.002 * rho).powi(2);
    // Simpson's rule is exact for a square; 30 K evenly distributed have the variance 30²/12.
    let mean_square = (square_per_k(low) + 4.0 * square_per_k(0.5 * (low + high)) + square_per_k(high)) / 6.0;
    let expected = mean_square * 30.0 * 30.0 / 12.0 * (params.limits.span() / (high - low)).powi(2);
    let check = |wide: &Estimate, plain: &Estimate| {
        assert_eq!(wide.strain, plain.strain, "{} s", wide.time_s);
        let more = wide.strain_sd.powi(2) - plain.strain_sd.powi(2);
        assert!((more / expected - 1.0).abs() < 1e-6, "{} s: {more}, {expected}", wide.time_s);
    };

    let rows: Vec<_> = chamber().into_iter().map(|[time_s, ohm, _]| (time_s, ohm)).collect();
    let lines = rows.iter().map(|(time_s, ohm)| format!("{time_s},{ohm}"));
    let (wide, remark) = streamed("time_s,resistance_ohm", lines);
    assert_eq!(remark, Some("no column temperature_c: intervals are wider"));
    // Intervals are as wide as they can be where a flag says why.
    let rows = wide.iter().zip(plain(&rows)).filter(|(wide, _)| wide.flags == Flags::NONE);
    let compared = rows.map(|(wide, plain)| check(wide, &plain)).count();
    assert!(compared > 800, "{compared}");

    let zeroed = |sensor: &Sensor| {
        let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
        filter.begin(sensor.filter(), false).unwrap();
        takes(&mut filter, 0.0, rested(20));
        assert!(filter.zero(sensor.filter()).starts_with("R0 is 1601 now"));
        takes(&mut filter, 4.0, rested(20))
    };
    check(&zeroed(&warmed_sensor()), &zeroed(&sensor()));
}

/// A rest before the first row also holds if a header comes between.
#[test]
fn a_rest_before_the_header_is_that_of_the_first_row() {
    let sensor = sensor();
    let first = |rests: bool| {
        let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
        if rests {
            filter.rest().unwrap();
        }
        filter.begin(sensor.filter(), false).unwrap();
        takes(&mut filter, 0.0, [2300.0])
    };
    assert!(first(true).strain < 0.01 && first(false).strain > 0.05, "{} {}", first(true).strain, first(false).strain);
}
