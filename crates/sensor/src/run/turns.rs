use ohmstrain_ekf::live::TurnWatch;

/// Times, s, at which the readings used by a filter turn, including the first and last reading of a recording.
#[derive(Debug, Default)]
pub struct Turns {
    at_s: Vec<f64>,
    /// Time of the last reading, and the time since the last turn at that moment, s.
    last: Option<(f64, f64)>,
}

/// Rounding of a time, relative.
const ROUNDING: f64 = 1e-9;

impl Turns {
    /// Takes the time, s, of a reading that was used, and the state of the filter's turn watch after it.
    pub(crate) fn see(&mut self, time_s: f64, watch: &TurnWatch<f64>) {
        let unturned_s = watch.since_turn_s();
        match self.last {
            None => self.at_s.push(time_s),
            // The watch restarts after a pause.
            Some((last_s, _)) if unturned_s == 0.0 && time_s > last_s => self.at_s.extend([last_s, time_s]),
            Some((last_s, before_s)) if unturned_s < (before_s + time_s - last_s) * (1.0 - ROUNDING) => {
                self.at_s.push(time_s - unturned_s);
            }
            Some(_) => {}
        }
        self.last = Some((time_s, unturned_s));
    }

    /// Returns the time, s, from the turn before `time_s` to the turn after; zero without a reading.
    #[must_use]
    pub fn around(&self, time_s: f64) -> f64 {
        let Some((last_s, _)) = self.last else { return 0.0 };
        // Times before the first reading, or after the last, belong to the nearest interval between turns.
        let turns = self.at_s.len();
        let next = self.at_s.partition_point(|at_s| *at_s <= time_s).max(1);
        let next = if time_s < last_s { next } else { turns };
        let after_s = self.at_s.get(next).copied().unwrap_or(last_s);
        self.at_s.get(next - 1).map_or(0.0, |before_s| after_s - before_s)
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::live::{TurnSeen, TurnWatch};

    use super::Turns;

    /// Readings rise until 4 s, fall until 6 s, are missing for half a minute, and rise until 40 s.
    #[test]
    fn rows_lie_between_the_turns_around_them() {
        let (mut watch, mut turns) = (TurnWatch::new(TurnSeen { turn: 0.05, longest_s: 20.0 }), Turns::default());
        assert_eq!(turns.around(1.0), 0.0);
        let mut last_s = 0.0;
        for k in (0..=6).chain(36..=40) {
            let time_s = f64::from(k);
            let rho = match k {
                0..=4 => 0.1 * time_s,
                5 | 6 => 0.8 - 0.1 * time_s,
                _ => 0.1 * (time_s - 36.0),
            };
            watch.see(time_s - last_s, rho);
            turns.see(time_s, &watch);
            last_s = time_s;
        }
        let around = [0.0, 3.5, 4.0, 5.5, 20.0, 37.0, 40.0, 50.0].map(|at_s| turns.around(at_s));
        assert_eq!(around, [4.0, 4.0, 2.0, 2.0, 30.0, 4.0, 4.0, 4.0]);
    }
}
