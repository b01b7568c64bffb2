//! R₀ of another day.

use ohmstrain_ekf::live::{RestBounds, RestFollower};

/// The same in resistances: R₀ goes to where the reading is an end of the range, in a step that is implicit in time.
fn followed(bounds: (f64, f64), rows: impl Iterator<Item = (f64, f64)>) -> Vec<f64> {
    let (mut rest, mut last, mut since_s) = (1.0_f64, f64::NAN, 0.0);
    let one = |(dt_s, resistance): (f64, f64)| {
        let is_news = !last.is_nan() && resistance != last;
        since_s = if last.is_nan() { 0.0 } else { since_s + dt_s };
        last = resistance;
        let (least, most) = (bounds.0 * rest, bounds.1 * rest);
        let wanted = if resistance > most { resistance / bounds.1 } else { resistance / bounds.0 };
        if is_news && !(least..=most).contains(&resistance) && 0.5 < wanted && wanted < 2.0 {
            let dt_s = f64::min(since_s, 2.0);
            let time_s = if (wanted - 1.0).abs() > (rest - 1.0).abs() { 40.0 } else { 1.0 };
            rest = (rest + dt_s / time_s * wanted) / (1.0 + dt_s / time_s);
        }
        since_s = if is_news { 0.0 } else { since_s };
        rest - 1.0
    };
    rows.map(one).collect()
}

#[test]
fn r0_follows_as_a_play_with_a_lag() {
    let mut x = 1_u32;
    let mut random = || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(x >> 8) / f64::from(1 << 24)
    };
    // Slow motion within 0.6 to 3 R₀, repetitions, spikes of ten times, pauses.
    let rows: Vec<(f64, f64)> = (0..20_000)
        .map(|k| {
            let slow = 1.8 + 1.2 * (0.003 * f64::from(k)).sin() * (0.0001 * f64::from(k)).cos();
            let resistance = if random() < 0.01 { 10.0 * slow } else { (50.0 * slow).round() / 50.0 };
            (if random() < 0.01 { 30.0 } else { 0.05 }, resistance)
        })
        .collect();
    let expected = followed((0.95, 2.2), rows.iter().copied());
    let mut follower = RestFollower::<f64>::new(RestBounds { low: Some(0.95 - 1.0), high: Some(2.2 - 1.0) });
    let mut farthest = (0.0_f64, 0.0_f64);
    for ((dt_s, resistance), expected) in rows.into_iter().zip(expected) {
        follower.see(dt_s, resistance - 1.0);
        assert!((follower.off() - expected).abs() < 1e-9, "{} {expected}", follower.off());
        farthest = (farthest.0.min(expected), farthest.1.max(expected));
    }
    // It went both ways.
    assert!(farthest.0 < -0.1 && farthest.1 > 0.1, "{farthest:?}");
}
