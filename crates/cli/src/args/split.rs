use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use super::finite;

/// Split of a recording's rows into those that calibrate and those that are scored: a share of the first rows, or, reversed, of the last ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    share: f64,
    reversed: bool,
}

/// Share that `reversed` alone stands for.
const HALF: f64 = 0.5;

impl Split {
    /// Rows that calibrate, of so many.
    pub fn training(self, rows: usize) -> Range<usize> {
        let trained = (rows as f64 * self.share) as usize;
        if self.reversed { rows - trained..rows } else { 0..trained }
    }

    /// Rows that are scored, of so many: the others.
    pub fn scored(self, rows: usize) -> Range<usize> {
        let training = self.training(rows);
        if self.reversed { 0..training.start } else { training.end..rows }
    }
}

impl FromStr for Split {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (share, reversed) = match text.split_once(':') {
            Some((share, "reversed")) => (share, true),
            _ if text == "reversed" => return Ok(Self { share: HALF, reversed: true }),
            _ => (text, false),
        };
        let between = finite(share).ok().filter(|share| *share > 0.0 && *share < 1.0);
        let share = between.ok_or("expected a share between 0 and 1, SHARE:reversed or reversed")?;
        Ok(Self { share, reversed })
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}{}", self.share, if self.reversed { ":reversed" } else { "" })
    }
}

#[cfg(test)]
mod tests {
    use super::Split;

    #[test]
    fn every_row_calibrates_or_is_scored() {
        let rows = |text: &str| {
            let split: Split = text.parse().unwrap();
            (split.training(10), split.scored(10), split.to_string())
        };
        assert_eq!(rows("0.4"), (0..4, 4..10, "0.4".into()));
        assert_eq!(rows("0.4:reversed"), (6..10, 0..6, "0.4:reversed".into()));
        assert_eq!(rows("reversed"), (5..10, 0..5, "0.5:reversed".into()));
        assert!(["1", "0", "NaN", "0.4:backwards", ":reversed"].iter().all(|text| text.parse::<Split>().is_err()));
    }
}
