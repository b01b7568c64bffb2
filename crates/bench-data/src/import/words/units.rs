use crate::import::words::number::{DecimalMark, Value, number, value};
use crate::import::words::role::Role;
use crate::metadata::{ResistanceUnit, StrainUnit};

/// Conversion of numbers in a unit to the trace's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
    /// Multiplication by a power of ten: the decimal mark moves, nothing is rounded.
    Shift(i32),
    /// Multiplication by a factor, plus an offset.
    Affine(f64, f64),
    /// Inverse of the number shifted like `Shift`: a conductance.
    Inverse(i32),
    /// The number shifted like `Shift`, plus one: changes relative to the resistance at rest.
    ChangeShift(i32),
    /// Text with a date or a time of day.
    Stamp,
}

impl Scale {
    /// Returns the number of digits by which the decimal mark moves.
    pub(crate) const fn shift(self) -> i32 {
        match self {
            Self::Shift(shift) | Self::ChangeShift(shift) | Self::Inverse(shift) => shift,
            Self::Affine(..) | Self::Stamp => 0,
        }
    }
}

/// A unit with its name in flags.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    pub name: &'static str,
    pub scale: Scale,
}

type Entry = (Role, &'static str, Scale, &'static [&'static str]);

/// Units by quantity: flag name, scale, spellings. Spellings are compared in lower case, except those of resistance that
/// begin with `m` or `M`, and those of conductance: `us` is a time.
const UNITS: &[Entry] = &[
    (Role::Time, "s", Scale::Shift(0), &["sec", "secs", "second", "seconds", "sek", "sekunden", "secondes"]),
    (Role::Time, "ms", Scale::Shift(-3), &["msec", "msecs", "millis", "millisecond", "milliseconds"]),
    (Role::Time, "us", Scale::Shift(-6), &["µs", "μs", "usec", "micros", "microsecond", "microseconds"]),
    (Role::Time, "ns", Scale::Shift(-9), &["nsec", "nanos", "nanosecond", "nanoseconds"]),
    (Role::Time, "min", Scale::Affine(60.0, 0.0), &["mins", "minute", "minutes", "minuten"]),
    (Role::Time, "h", Scale::Affine(3600.0, 0.0), &["hr", "hrs", "hour", "hours"]),
    (Role::Time, "days", Scale::Affine(86_400.0, 0.0), &["day", "tage"]),
    (Role::Time, "iso", Scale::Stamp, &["iso8601", "timestamp", "datetime", "hh:mm:ss", "utc"]),
    (Role::Time, "dmy", Scale::Stamp, &["dd.mm.yyyy", "dd/mm/yyyy"]),
    (Role::Time, "mdy", Scale::Stamp, &["mm/dd/yyyy"]),
    (Role::Resistance, "ohm", Scale::Shift(0), &["ω", "Ω", "ohms", "Ohm"]),
    (Role::Resistance, "kohm", Scale::Shift(3), &["kω", "kΩ", "kohms", "kilohm", "kiloohm", "k"]),
    (Role::Resistance, "megohm", Scale::Shift(6), &["MΩ", "Mω", "MOhm", "Mohm", "MOHM", "MOhms", "Mohms"]),
    (Role::Resistance, "milliohm", Scale::Shift(-3), &["mΩ", "mω", "mOhm", "mohm", "mOhms", "mohms"]),
    (Role::Resistance, "S", Scale::Inverse(0), &["siemens", "Siemens", "mho", "1/ohm", "1/Ohm", "1/Ω", "Ω⁻¹"]),
    (Role::Resistance, "mS", Scale::Inverse(-3), &["millisiemens", "mmho"]),
    (Role::Resistance, "uS", Scale::Inverse(-6), &["µS", "μS", "microsiemens", "umho", "µmho"]),
    (Role::Resistance, "nS", Scale::Inverse(-9), &["nanosiemens"]),
    (Role::Ratio, "1", Scale::Shift(0), &["-", "–", "r/r0", "ratio", "none"]),
    (Role::Ratio, "percent", Scale::Shift(-2), &["% of r0"]),
    (Role::Ratio, "change", Scale::ChangeShift(0), &["dr/r0", "δr/r0", "dr/r"]),
    (Role::Ratio, "change-percent", Scale::ChangeShift(-2), &["%", "pct"]),
    (Role::Adc, "1", Scale::Shift(0), &["-", "code", "codes", "count", "counts", "lsb"]),
    (Role::Strain, "1", Scale::Shift(0), &["-", "–", "mm/mm", "m/m", "strain", "frac", "fraction", "none", "ratio"]),
    (Role::Strain, "percent", Scale::Shift(-2), &["%", "pct", "perc", "prozent"]),
    (Role::Strain, "permille", Scale::Shift(-3), &["‰"]),
    (Role::Strain, "microstrain", Scale::Shift(-6), &["µε", "με", "ustrain", "µstrain", "µm/m", "um/m", "ppm"]),
    (Role::Displacement, "mm", Scale::Shift(0), &["millimeter", "millimetre", "millimeters", "millimetres"]),
    (Role::Displacement, "cm", Scale::Shift(1), &["centimeter", "centimetre"]),
    (Role::Displacement, "m", Scale::Shift(3), &["meter", "metre", "meters", "metres"]),
    (Role::Displacement, "um", Scale::Shift(-3), &["µm", "μm", "micron", "microns"]),
    (Role::Displacement, "inch", Scale::Affine(25.4, 0.0), &["in", "inches", "\""]),
    (Role::Angle, "deg", Scale::Shift(0), &["°", "degree", "degrees", "grad"]),
    (Role::Angle, "rad", Scale::Affine(180.0 / std::f64::consts::PI, 0.0), &["radian", "radians"]),
    (Role::Temperature, "celsius", Scale::Shift(0), &["°c", "c", "degc", "deg c", "℃"]),
    (Role::Temperature, "kelvin", Scale::Affine(1.0, -273.15), &["k"]),
    (Role::Temperature, "fahrenheit", Scale::Affine(5.0 / 9.0, -160.0 / 9.0), &["°f", "f", "degf"]),
];

/// Removes the brackets around a text.
fn bare(text: &str) -> &str {
    text.trim().trim_matches(['(', ')', '[', ']', '{', '}', '<', '>']).trim()
}

/// Returns the unit of a quantity with this spelling.
pub(crate) fn unit(role: Role, text: &str) -> Option<Unit> {
    let text = bare(text).replace('\u{2126}', "Ω");
    let lower = text.to_lowercase();
    let of_role = UNITS.iter().filter(|(of, ..)| *of == role.quantity());
    let mut found = of_role.filter(|(_, name, scale, spellings)| {
        let is_mega_or_milli = role == Role::Resistance && lower.starts_with('m') && *name != lower;
        let is_exact = is_mega_or_milli || matches!(scale, Scale::Inverse(_));
        let spelled = |spelling: &&str| if is_exact { **spelling == text } else { spelling.to_lowercase() == lower };
        *name == text || (*name == lower && !is_exact) || spellings.iter().any(spelled)
    });
    found.next().map(|(_, name, scale, _)| Unit { name, scale: *scale })
}

impl Role {
    /// Returns the names of its units in flags; none for a role whose numbers have no unit.
    #[must_use]
    pub fn units(self) -> Vec<&'static str> {
        UNITS.iter().filter(|(of, ..)| *of == self.quantity()).map(|(_, name, ..)| *name).collect()
    }
}

impl StrainUnit {
    /// Returns the unit with a spelling from a lab's file: `percent`, `%`, `fraction`, `mm/mm`. `None` for any other unit.
    #[must_use]
    pub fn spelled(text: &str) -> Option<Self> {
        match unit(Role::Strain, text)?.name {
            "1" => Some(Self::Fraction),
            "percent" => Some(Self::Percent),
            _ => None,
        }
    }
}

impl ResistanceUnit {
    /// Returns the unit with a spelling from a lab's file: `ohm`, `kΩ`, `kOhm`. `None` for any other unit.
    #[must_use]
    pub fn spelled(text: &str) -> Option<Self> {
        match unit(Role::Resistance, text)?.name {
            "ohm" => Some(Self::Ohm),
            "kohm" => Some(Self::Kohm),
            _ => None,
        }
    }
}

/// Returns the ohms of a number followed by a prefix or a unit, as instruments with automatic ranges write them: `1.28k`, `980.1 Ω`.
pub(crate) fn ohms(text: &str, mark: DecimalMark) -> Option<f64> {
    let end = text.rfind(|c: char| c.is_ascii_digit() || c == mark.character())? + 1;
    let shift = match text[end..].trim() {
        "" => return None,
        "k" | "K" => 3,
        "M" => 6,
        "m" => -3,
        "R" => 0,
        behind => match unit(Role::Resistance, behind)?.scale {
            Scale::Shift(shift) => shift,
            _ => return None,
        },
    };
    number(text[..end].trim(), mark, shift)
}

/// Returns the value of a text; ohms may have a prefix.
pub(crate) fn amount(cell: &str, mark: DecimalMark) -> Value {
    match value(cell, mark, 0, &[]) {
        Value::Text => ohms(cell, mark).map_or(Value::Text, Value::Number),
        known => known,
    }
}

/// Name of units without a name of their own.
pub(crate) const SCALED: &str = "scaled";

/// Returns a unit, or a multiple of one per unit of the column: `inch`, `4mm/V`, `-0.9deg/step`, `0.1ms`.
pub(crate) fn unit_or_scale(role: Role, text: &str) -> Option<Unit> {
    if let Some(unit) = unit(role, text) {
        return Some(unit);
    }
    let text = text.trim();
    let end = text.find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)))?;
    let times = text[..end].parse::<f64>().ok().filter(|times| times.is_finite() && *times != 0.0)?;
    let rest = &text[end..];
    let found = unit(role, rest).or_else(|| unit(role, rest.rsplit_once('/')?.0))?;
    let scale = match found.scale {
        Scale::Shift(shift) => Scale::Affine(times * 10_f64.powi(shift), 0.0),
        Scale::ChangeShift(shift) => Scale::Affine(times * 10_f64.powi(shift), 1.0),
        Scale::Affine(factor, offset) => Scale::Affine(times * factor, offset),
        Scale::Stamp | Scale::Inverse(_) => return None,
    };
    Some(Unit { name: SCALED, scale })
}

/// Returns an example of the scale for a reference that an instrument gives in volts or counts.
pub(crate) const fn scale_of_a_reference(role: Role) -> Option<&'static str> {
    match role {
        Role::Strain => Some("10percent/V"),
        Role::Displacement => Some("4mm/V"),
        Role::Angle => Some("36deg/V"),
        _ => None,
    }
}

/// True if a text is a unit of conductance with the case as written.
pub(crate) fn is_siemens(text: &str) -> bool {
    unit(Role::Resistance, text).is_some_and(|unit| matches!(unit.scale, Scale::Inverse(_)))
}

/// Returns the quantities for which a text is a unit.
pub(crate) fn quantities(text: &str) -> Vec<Role> {
    let mut roles: Vec<Role> = Vec::new();
    for (role, ..) in UNITS {
        if !roles.contains(role) && unit(*role, text).is_some() {
            roles.push(*role);
        }
    }
    roles
}

/// True if a text is a unit of anything that a lab measures.
pub(crate) fn is_unit(text: &str) -> bool {
    const OTHER: [&str; 26] = [
        "n", "kn", "mn", "g", "kg", "v", "mv", "µv", "uv", "a", "ma", "µa", "ua", "na", "w", "hz", "khz", "pa", "kpa",
        "mpa", "mm/s", "mm/min", "1/s", "%/s", "s/m", "lbf",
    ];
    let bare = bare(text);
    !quantities(bare).is_empty() || OTHER.contains(&bare.to_lowercase().as_str())
}

/// Returns the unit in which a count is a time since 1970, within this century, with steps of at most some seconds from row to row: `us`
/// for 1.7e15. Counts since the start of a device are smaller, or have larger steps.
pub(crate) fn epoch_unit(count: f64, step: f64) -> Option<&'static str> {
    const CENTURY_S: std::ops::Range<f64> = 9.46e8..4.1e9;
    const LONGEST_STEP_S: f64 = 10.0;
    let fits = |(_, per_second): &&(&str, f64)| {
        CENTURY_S.contains(&(count / per_second)) && step / per_second <= LONGEST_STEP_S
    };
    [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)].iter().find(fits).map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mega_is_not_milli() {
        let name = |text| unit(Role::Resistance, text).map(|unit| unit.name);
        assert_eq!(name("MOhm"), Some("megohm"));
        assert_eq!(name("mΩ"), Some("milliohm"));
        assert_eq!(name("[k\u{2126}]"), Some("kohm"));
        assert_eq!(name("(Ohm)"), Some("ohm"));
        assert_eq!(name("N"), None);
    }

    #[test]
    fn instruments_write_ohms_with_a_prefix() {
        for (text, ohm) in [("1.28k", 1280.0), ("1.1 kΩ", 1100.0), ("0.9M", 9e5), ("12R", 12.0), ("-1e1 Ohm", -10.0)] {
            assert_eq!(ohms(text, DecimalMark::Point), Some(ohm), "{text}");
        }
        assert_eq!(ohms("1,28k", DecimalMark::Comma), Some(1280.0));
        for text in ["1.28", "k", "3.2 s", "5 %", "1.2 mm", "R1"] {
            assert_eq!(ohms(text, DecimalMark::Point), None, "{text}");
        }
    }

    #[test]
    fn a_scale_is_so_much_of_a_unit_per_anything() {
        let scale = |role, text| unit_or_scale(role, text).map(|unit| unit.scale);
        assert_eq!(scale(Role::Displacement, "4mm/V"), Some(Scale::Affine(4.0, 0.0)));
        assert_eq!(scale(Role::Displacement, "-0.5 cm/V"), Some(Scale::Affine(-5.0, 0.0)));
        assert_eq!(scale(Role::Displacement, "2inch/turn"), Some(Scale::Affine(50.8, 0.0)));
        assert_eq!(scale(Role::Strain, "0.25%/step"), Some(Scale::Affine(0.0025, 0.0)));
        assert_eq!(scale(Role::Strain, "mm/mm"), Some(Scale::Shift(0)));
        for text in ["4/V", "V", "0mm/V", "4kg/V", "", "1e999mm/V"] {
            assert_eq!(scale(Role::Displacement, text), None, "{text}");
        }
    }

    #[test]
    fn every_unit_is_found_by_its_own_name() {
        for (role, name, scale, spellings) in UNITS {
            for text in [name].into_iter().chain(spellings.iter()) {
                assert_eq!(unit(*role, text), Some(Unit { name, scale: *scale }), "{text}");
            }
        }
    }
}
