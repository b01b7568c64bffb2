use crate::import::roles::Role;
use crate::import::units;

/// Units that are part of the name behind a blank or an underscore: `resistance_ratio`, `Stage Strain`.
const WORDS: [&str; 14] = [
    "strain",
    "ratio",
    "fraction",
    "frac",
    "none",
    "code",
    "codes",
    "count",
    "counts",
    "timestamp",
    "datetime",
    "day",
    "days",
    "tage",
];

/// A heading taken apart: the bare name, and the unit if it has one.
pub(crate) fn take_apart(heading: &str) -> (String, Option<String>) {
    let heading = heading.trim();
    for (open, close) in [('(', ')'), ('[', ']'), ('{', '}'), ('<', '>')] {
        if let (Some(start), Some(end)) = (heading.rfind(open), heading.rfind(close))
            && start < end
            && (units::is_unit(&heading[start + 1..end]) || heading.ends_with(close))
        {
            let name = format!("{}{}", &heading[..start], &heading[end + close.len_utf8()..]);
            return (name.trim().to_owned(), Some(heading[start + open.len_utf8()..end].trim().to_owned()));
        }
    }
    // `time_ms`, `R kOhm`, `Time / s`, `Weg, mm`: a unit behind the last mark. `R/R0` is a name.
    for mark in ['/', ',', '_', ' '] {
        if let Some((name, unit)) = heading.rsplit_once(mark)
            && units::is_unit(unit)
            && !WORDS.contains(&unit.trim().to_lowercase().as_str())
            && unit.len() > 1 - usize::from(matches!(mark, '/' | ',' | '_'))
            && !name.trim().is_empty()
        {
            let name = name.trim().trim_end_matches([',', '/', '_']).trim();
            return (name.to_owned(), Some(unit.trim().to_owned()));
        }
    }
    (heading.to_owned(), None)
}

/// How sure a name is of a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sureness {
    /// The unit alone says so, and could say so of something else too.
    Weak,
    /// The name says so.
    Strong,
}

/// Whole names, in lower case, letters and digits only.
const WHOLE: &[(Role, &[&str])] = &[
    (
        Role::Time,
        &["t", "zeit", "temps", "micros", "millis", "seconds", "sec", "ms", "us", "clock", "tr", "ts", "xvalue"],
    ),
    (Role::Resistance, &["r", "rs", "rx", "rsensor", "res", "ohm", "ohms", "kohm", "widerstand", "sensor1r"]),
    (Role::Ratio, &["rr0", "rrel", "relr", "normalizedr", "rnorm", "drr0", "drr", "δrr0", "deltarr0"]),
    (Role::Adc, &["adc", "adccode", "adccounts", "adcvalue", "counts"]),
    (Role::Strain, &["e", "eps", "ε", "epsilon", "dehnung", "straintrue"]),
    (Role::Displacement, &["p", "x", "d", "pos", "disp", "displ", "ext", "weg", "dl", "δl", "u"]),
    (Role::Angle, &["angle", "theta", "θ", "winkel", "phi", "flexion"]),
    (Role::Temperature, &["temp", "tempc", "temperatur", "tamb"]),
];

/// Parts of names.
const PART: &[(Role, &[&str])] = &[
    (Role::Time, &["time", "timestamp", "zeit", "elapsed", "datum", "date"]),
    (
        Role::Ratio,
        &[
            "resistance ratio",
            "relative resistance",
            "normalized resistance",
            "normalised resistance",
            "relative change",
        ],
    ),
    (Role::Resistance, &["resist", "widerstand"]),
    (Role::Adc, &["adc"]),
    (Role::Strain, &["strain", "dehnung"]),
    (
        Role::Displacement,
        &["displacement", "position", "extension", "elongation", "travel", "crosshead", "stroke", "verschiebung"],
    ),
    (Role::Angle, &["angle", "winkel"]),
    (Role::Temperature, &["temperature", "temperatur"]),
];

/// The role that a column's name and unit give it, if any.
pub(crate) fn role(name: &str, unit: Option<&str>) -> Option<(Role, Sureness)> {
    let lower = name.trim().to_lowercase();
    let letters: String = lower.chars().filter(|c| c.is_alphanumeric()).collect();
    let spaced = lower.replace(['_', '-', '.'], " ");
    let fits = |role: &Role| {
        // A unit of something else, `Position (V)`, takes the role away; no unit, or an unknown one, does not.
        unit.is_none_or(|unit| units::unit(*role, unit).is_some() || !units::is_unit(unit))
    };
    let whole = WHOLE.iter().find(|(role, names)| names.contains(&letters.as_str()) && fits(role));
    let part = || PART.iter().find(|(role, parts)| parts.iter().any(|part| spaced.contains(part)) && fits(role));
    let named = whole.or_else(part).map(|(role, _)| (*role, Sureness::Strong));
    named.or_else(|| by_unit(unit?))
}

/// Ω is measured of the sensor alone; mm, degrees and seconds of many things.
fn by_unit(unit: &str) -> Option<(Role, Sureness)> {
    let roles = units::quantities(unit);
    match roles[..] {
        [Role::Resistance] => Some((Role::Resistance, Sureness::Strong)),
        [role @ (Role::Displacement | Role::Angle | Role::Time)] => Some((role, Sureness::Weak)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_come_apart() {
        let cases = [
            ("Time (s)", "Time", Some("s")),
            ("Displacement [mm]", "Displacement", Some("mm")),
            ("R (kOhm)", "R", Some("kOhm")),
            ("time_ms", "time", Some("ms")),
            ("resistance_ohm", "resistance", Some("ohm")),
            ("Weg, mm", "Weg", Some("mm")),
            ("t/s", "t", Some("s")),
            ("Zeit", "Zeit", None),
            ("R/R0", "R/R0", None),
            ("resistance_ratio", "resistance_ratio", None),
            ("Stage Strain", "Stage Strain", None),
            ("Sensor A", "Sensor A", None),
        ];
        for (heading, name, unit) in cases {
            assert_eq!(take_apart(heading), (name.to_owned(), unit.map(str::to_owned)), "{heading}");
        }
    }

    #[test]
    fn names_have_roles_unless_their_unit_is_another_s() {
        let strong = |name, unit| role(name, unit).filter(|(_, how)| *how == Sureness::Strong).map(|(role, _)| role);
        assert_eq!(strong("Time", Some("s")), Some(Role::Time));
        assert_eq!(strong("R/R0", None), Some(Role::Ratio));
        assert_eq!(strong("resistance_ratio", None), Some(Role::Ratio));
        assert_eq!(strong("Sensor A", Some("kΩ")), Some(Role::Resistance));
        assert_eq!(strong("Strain", Some("%")), Some(Role::Strain));
        assert_eq!(strong("Position", Some("V")), None);
        assert_eq!(strong("Force", Some("N")), None);
        assert_eq!(role("Length", Some("mm")), Some((Role::Displacement, Sureness::Weak)));
    }
}
