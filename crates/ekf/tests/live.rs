//! A filter with all that stands around it, in single precision, as a microcontroller runs it.

use std::ops::Range;

use ohmstrain_ekf::live::{
    DoubtParts, FARTHEST_REST, Flag, Learned, LiveFilter, LiveParts, Protections, RestBounds, Sieve, StaticCurve,
    Unread,
};
use ohmstrain_ekf::{Compact, Evidence, Gaussian, SignSplit, SparseEkf, StepError};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, SensorLaw, StrainRange, SwitchedModel};

const DT_S: f32 = 0.01;
const LIMITS: StrainRange<f32> = StrainRange { lower: 0.0, upper: 0.33 };
const REST_READING: f32 = 1600.0;
/// Reading of the rested sensor in calibration.
const RESTED: f32 = 1550.0;

type Filter = LiveFilter<f32, SignSplit<f32, 1, 4, 8, Compact>, Learned<'static, f32>, 4, 10>;

fn filter() -> Filter {
    let branch =
        Branch { tau_s: 20.0, extend_gain: 0.6, retract_gain: -0.4, extend_gain_slope: 0.0, retract_gain_slope: 0.0 };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
        extend_viscosity_s: 0.02,
        retract_viscosity_s: -0.01,
        branches: [branch],
        range: LIMITS,
    };
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1).unwrap();
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
    let kernel = SparseEkf::new(SwitchedModel::new(law, motion, noise).unwrap(), DT_S).unwrap();
    LiveFilter::new(SignSplit::around(kernel, None, Evidence { limits: LIMITS, tempering: 1.0 }), parts())
}

fn parts() -> LiveParts<f32, Learned<'static, f32>> {
    let unread = Unread::new(1.0, 0.1, LIMITS);
    let doubt = DoubtParts {
        low: 0.0,
        high: 0.5,
        fastest_per_s: 0.5,
        longest_s: 600.0,
        per_reading: 0.66,
        start: 1e-3,
        most: unread.anywhere,
        unstated: 0.0,
        unread,
        rest: None,
        turns: None,
    };
    LiveParts {
        rest_reading: REST_READING,
        rested: RESTED,
        dt_s: DT_S,
        longest_step_s: f32::INFINITY,
        limits: LIMITS,
        strain_sd_scale: 1.0,
        reading_variance: 4e-6,
        known_variance: 1e-6,
        sieve: Sieve { plausible: (-0.5, 1.5), ..Sieve::open() },
        doubt,
        rest: RestBounds { low: None, high: None, start: None },
        learned: None,
    }
}

#[test]
fn a_reading_at_rest_that_cannot_be_this_sensors_is_refused_and_changes_nothing() {
    let farthest = FARTHEST_REST as f32;
    let far = [1e-38, 1.0, 0.999 * RESTED / farthest, 1.001 * RESTED * farthest, 1.6e6, f32::MAX];
    let none = [f32::NAN, f32::INFINITY, 0.0, -RESTED];
    let refused = far.map(|measured| (measured, StepError::ImplausibleRest));
    for (measured, error) in refused.into_iter().chain(none.map(|measured| (measured, StepError::NonFiniteReading))) {
        let mut filter = filter();
        filter.step(1700.0).unwrap();
        assert_eq!((filter.rest(measured), filter.rezero(measured)), (Err(error), Err(error)), "{measured}");
        let mut untouched = self::filter();
        untouched.step(1700.0).unwrap();
        assert_eq!(filter.step(1701.0), untouched.step(1701.0), "{measured}");
    }
    for measured in [RESTED / farthest, 0.9 * RESTED, RESTED * farthest] {
        let mut filter = filter();
        assert_eq!((filter.rest(measured), filter.rezero(measured)), (Ok(()), Ok(())), "{measured}");
        // The sensor rests.
        let reading = filter.relative(measured, 0.0);
        assert!((reading.value - (RESTED / REST_READING - 1.0)).abs() < 1e-6, "{measured}");
    }
}

/// No pause is too long: from none to more seconds than single precision has squares of. After an hour nothing is known but that the
/// strain is within its limits, which is there to be said; and the filter goes on.
#[test]
fn any_pause_is_passed() {
    let pauses = [0.0, 0.5, 7.0, 60.0, 3600.0, 86_400.0, 2.592e6, 1e9, 1e20, f32::MAX];
    let move_on = |filter: &mut Filter, rows: u8| {
        for k in 0..rows {
            filter.step(REST_READING * (1.2 + 0.1 * (0.01 * f32::from(k)).sin())).unwrap();
        }
    };
    for (running, pause_s) in [0, 200].into_iter().flat_map(|running| pauses.map(|pause_s| (running, pause_s))) {
        let mut filter = filter();
        move_on(&mut filter, running);
        let Gaussian { mean, variance } = filter.step_after(pause_s, None).unwrap().strain;
        let anywhere = LIMITS.variance_of_anywhere() + (mean - 0.165).powi(2);
        let times = variance / anywhere;
        assert!(times > 0.0 && times < 1.2 && (pause_s < 3600.0 || times > 0.99), "{running}, {pause_s} s: {times}");
        move_on(&mut filter, 200);
    }
    for (dt_s, error) in [(f32::INFINITY, StepError::NonFiniteTimeStep), (-1.0, StepError::NegativeTimeStep)] {
        assert_eq!(filter().step_after(dt_s, None), Err(error));
    }
}

/// A contact is loose for three seconds. The filter then gives the strain of one that had no reading since a time in the half second
/// before.
#[test]
fn readings_between_two_jumps_count_as_missing() {
    let sieve = Sieve { jump: 0.1, plausible: (-0.5, 3.0), ..Sieve::open() };
    let filter = || -> Filter { LiveFilter::new(*filter().estimator(), LiveParts { sieve, ..parts() }) };
    let reading = |row: u16| REST_READING * (1.2 + 0.1 * (0.01 * f32::from(row)).sin());
    let take = |filter: &mut Filter, rows: Range<u16>, more: f32| {
        for row in rows {
            filter.step(reading(row) + more).unwrap();
        }
    };
    let strain_without = |rows: u16| {
        let (mut filter, passed_s) = (filter(), DT_S * f32::from(501 - rows));
        take(&mut filter, 0..rows, 0.0);
        filter.step_after(passed_s, Some(filter.relative(reading(500), 0.0))).unwrap().strain.mean
    };
    let strain_after = |mut filter: Filter| {
        take(&mut filter, 0..200, 0.0);
        take(&mut filter, 200..500, REST_READING);
        filter.step(reading(500)).unwrap()
    };
    let nearest = |strain: f32| {
        let apart = (150..=200).map(|rows| (strain_without(rows) - strain).abs());
        apart.fold(f32::INFINITY, f32::min)
    };
    let after = strain_after(filter());
    assert!(nearest(after.strain.mean) < 1e-6 && after.flags.has(Flag::Recovering));
    let steady = Protections { second_look: false, ..Protections::ALL };
    assert!(nearest(strain_after(filter().protected_by(steady)).strain.mean) > 0.01);
}

/// A curve gives the strain of a reading. Where one is missing, or may be a spike, the filter's strain stands.
#[test]
fn a_curve_gives_the_strain_of_readings_that_are_no_spikes() {
    let curve = StaticCurve {
        centre: 0.3,
        half_range: 0.3,
        coefficients: [0.15, 0.16, -0.01, 0.005],
        range: LIMITS,
        variance: 1e-6,
    };
    let (mut plain, mut on_curve) = (filter(), filter().on_curve(Some(curve)));
    let mut counts = [0, 0];
    for k in 0..300_u16 {
        let rho = 0.2 + 0.1 * (0.02 * f32::from(k)).sin();
        let reading = match k {
            200..210 => None,
            250 => Some(REST_READING * (1.0 + rho + 0.3)),
            _ => Some(REST_READING * (1.0 + rho)),
        };
        let step = |filter: &mut Filter| match reading {
            Some(reading) => filter.step(reading).unwrap(),
            None => filter.predict().unwrap(),
        };
        let (without, with) = (step(&mut plain), step(&mut on_curve));
        assert_eq!(without.rate, with.rate, "{k}");
        let z = (rho - 0.3) / 0.3;
        let expected = 0.15 + 0.16 * z - 0.01 * z * z + 0.005 * z * z * z;
        if (200..210).contains(&k) || k == 250 {
            counts[0] += 1;
            assert_eq!(without.strain.mean, with.strain.mean, "{k}");
        } else {
            counts[1] += 1;
            // Rounding of the reading, relative to R₀, and of four terms.
            assert!((with.strain.mean - expected).abs() < 1e-6, "{k}: {} {expected}", with.strain.mean);
        }
    }
    assert_eq!(counts, [11, 289]);
}
