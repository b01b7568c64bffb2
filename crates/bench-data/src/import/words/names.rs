use crate::import::words::kinds::{folded, is_among, is_conductance};
use crate::import::words::role::Role;
use crate::import::words::units;

/// Units that belong to the name after a blank or an underscore: `resistance_ratio`, `Stage Strain`.
const WORDS: &str = "strain,ratio,fraction,frac,none,code,codes,count,counts,timestamp,datetime,day,days,tage";

/// Splits a heading into the bare name and the unit, if it has one.
pub(crate) fn take_apart(heading: &str) -> (String, Option<String>) {
    let heading = heading.trim();
    for (open, close) in [('(', ')'), ('[', ']'), ('{', '}'), ('<', '>')] {
        if let (Some(start), Some(end)) = (heading.rfind(open), heading.rfind(close))
            && start < end
            && (units::is_unit(&heading[start + 1..end]) || heading.ends_with(close))
            && !is_index(heading[start + 1..end].trim())
        {
            let name = format!("{}{}", &heading[..start], &heading[end + close.len_utf8()..]);
            return (name.trim().to_owned(), Some(cased(&name, heading[start + open.len_utf8()..end].trim())));
        }
    }
    // `time_ms`, `R kOhm`, `Time / s`, `Weg, mm`: the unit is after the last mark. `R/R0` is a name.
    const MARKS: [char; 4] = ['/', ',', '_', ' '];
    let last = |mark: &char| heading.rsplit_once(*mark).map(|(name, unit)| (*mark, name, unit));
    // A unit with a mark in it, `mm/mm`, comes before its own last part.
    let fractions = heading.match_indices(MARKS).map(|(at, mark)| (&heading[..at], mark, &heading[at + mark.len()..]));
    let fractions = fractions.filter(|(.., unit)| unit.contains('/'));
    let fractions = fractions.filter_map(|(name, mark, unit)| Some((mark.chars().next()?, name, unit)));
    for (mark, name, unit) in fractions.chain(MARKS.iter().filter_map(last)) {
        if units::is_unit(unit)
            && !is_among(WORDS, &unit.trim().to_lowercase())
            && (matches!(mark, '/' | ',' | '_') && !unit.is_empty() || unit.len() > 1 || is_letter_unit(name, unit))
            && !name.trim().is_empty()
            && (matches!(mark, '/' | ',') || is_sure_unit(name, unit.trim()))
        {
            let name = name.trim().trim_end_matches([',', '/', '_']).trim();
            return (name.to_owned(), Some(cased(name, unit.trim())));
        }
    }
    (heading.to_owned(), None)
}

/// Returns a unit as written; that of a conductance with the capital S of siemens.
fn cased(name: &str, unit: &str) -> String {
    let is_siemens = is_conductance(name) && matches!(unit.trim_start_matches(['m', 'u', 'µ', 'μ', 'n']), "s" | "S");
    if is_siemens { unit.replace('s', "S") } else { unit.to_owned() }
}

/// True if a text numbers columns of one kind: `strain_1`, `R (2)`.
fn is_index(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// True for the letter of a unit after a blank, where nothing else is meant: `Time h`, `Temperature K`.
fn is_letter_unit(name: &str, unit: &str) -> bool {
    let letters = match by_name(name.trim(), |_| true) {
        Some((Role::Time, _)) if name.trim() != "T" => "hs",
        Some((Role::Temperature, _)) => "kcf",
        _ => "",
    };
    letters.contains(&unit.to_lowercase())
}

/// Units that are also words of names: `R_min`, `strain_in`. So is every letter.
const SHORT_WORDS: [&str; 4] = ["min", "in", "grad", "day"];

/// True if the text after a blank or an underscore is a unit, and neither an index nor a part of the name. An ambiguous text is a unit if
/// the name's quantity is measured in it: `t_s`, `time_min`, `temp_c`. Volts are never ambiguous.
fn is_sure_unit(name: &str, unit: &str) -> bool {
    let lower = unit.to_lowercase();
    let is_letter = unit.len() == 1 && unit.starts_with(|c: char| c.is_ascii_alphabetic()) && lower != "v";
    if is_index(unit) {
        return false;
    }
    if !is_letter && !SHORT_WORDS.contains(&lower.as_str()) {
        return true;
    }
    match by_name(name, |_| true).map(|(role, _)| role) {
        // `R_k` is ambiguous: kiloohms, or one of several.
        Some(Role::Resistance) => false,
        // `T_C` is a temperature, not a time.
        Some(Role::Time) if name.trim() == "T" => units::unit(Role::Temperature, unit).is_some(),
        Some(role) => units::unit(role, unit).is_some(),
        None => lower != "k",
    }
}

/// Returns the unit of a quantity that stands anywhere in a heading as a word of its own: `resistance_kohm_1`, `StrainPercent`; none if
/// there are two. A letter is no such word.
pub(crate) fn unit_within(role: Role, heading: &str) -> Option<String> {
    let is_mark = |c: char| !c.is_alphanumeric() && !matches!(c, '%' | '‰' | '°');
    let is_unit = |word: &&str| {
        let is_letter = word.chars().count() == 1 && word.starts_with(char::is_alphabetic);
        let known = units::unit(role, word).filter(|unit| unit.scale != units::Scale::Stamp);
        let lower = word.to_lowercase();
        known.is_some()
            && !is_letter
            && !is_index(word)
            && !SHORT_WORDS.contains(&lower.as_str())
            && !is_among(WORDS, &lower)
    };
    let heading = heading.strip_prefix("% ").unwrap_or(heading);
    let mut found: Vec<&str> = heading.split(is_mark).filter(is_unit).collect();
    if found.is_empty() {
        found = heading.split(is_mark).flat_map(capitalised).filter(is_unit).collect();
    }
    found.dedup();
    if let [only] = found[..] { Some(only.to_owned()) } else { None }
}

/// Splits a word before its capital letters: `StrainPercent`.
fn capitalised(word: &str) -> Vec<&str> {
    let places = word.char_indices().filter(|(place, c)| *place > 0 && c.is_uppercase()).map(|(place, _)| place);
    let starts: Vec<usize> = std::iter::once(0).chain(places).collect();
    let ends = starts[1..].iter().copied().chain([word.len()]);
    starts.iter().zip(ends).map(|(start, end)| &word[*start..end]).collect()
}

/// Returns the end of a name that may be a unit or a part of the name: `res_k`, `strain_p`, `time_m`.
pub(crate) fn doubtful_unit(role: Role, heading: &str) -> Option<&str> {
    const DOUBTFUL: [(Role, &[&str]); 4] = [
        (Role::Time, &["m", "u", "µ", "n"]),
        (Role::Resistance, &["k", "m", "g"]),
        (Role::Ratio, &["p", "pc"]),
        (Role::Strain, &["p", "pc", "m", "u", "µ"]),
    ];
    if heading.starts_with("% ") {
        return Some("%");
    }
    let (_, end) = heading.trim().rsplit_once(['_', ' ', '-', '.'])?;
    let (_, ends) = DOUBTFUL.iter().find(|(of, _)| *of == role.quantity())?;
    ends.contains(&end.to_lowercase().as_str()).then_some(end)
}

/// Certainty that a name denotes a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sureness {
    /// Role by the unit alone, which other columns may share.
    Weak,
    /// Role by the name, except for an index or a short word after it.
    Indexed,
    /// Role by the name.
    Strong,
}

/// Whole names, in lower case and without accents, letters and digits only.
const WHOLE: &[(Role, &str)] = &[
    (Role::Time, "t,zeit,temps,tempo,micros,millis,seconds,sec,secs,ms,us,clock,tr,ts,xvalue"),
    (Role::Resistance, "r,rs,rx,rsensor,res,ohm,ohms,kohm,widerstand,sensor1r"),
    (Role::Ratio, "rr0,rrel,relr,normalizedr,rnorm,drr0,drr,δrr0,deltarr0,rr0r0"),
    (Role::Adc, "adc,adccode,adccounts,adcvalue,counts,analogread,analogvalue,analogin,analog"),
    (Role::Strain, "e,eps,ε,epsilon,dehnung,straintrue,λ,lambda,stretch"),
    (Role::Displacement, "p,x,d,pos,disp,displ,ext,weg,dl,δl,u,stretch"),
    (Role::Angle, "angle,theta,θ,winkel,phi,flexion"),
    (Role::Temperature, "temp,tempc,temperatur,tamb"),
];

/// Parts of names.
const PART: &[(Role, &str)] = &[
    (Role::Time, "time,timestamp,zeit,elapsed,datum,date,tiempo,时间,時間,시간"),
    (Role::Ratio, "resistance ratio,relative resistance,normalized resistance,normalised resistance,relative change"),
    (Role::Resistance, "resist,widerstand,conductanc,leitwert,电阻,電阻,抵抗,저항,电导,電導,컨덕턴스"),
    (Role::Adc, "adc,analogread"),
    (
        Role::Strain,
        "strain,dehnung,deformacion,deformation,deformazione,deformacao,stretch ratio,应变,應變,ひずみ,변형률,변형율",
    ),
    (
        Role::Displacement,
        "displacement,position,extension,elongation,travel,crosshead,stroke,verschiebung,deformation,deformacion,\
         desplazamiento,deplacement,allongement,位移,変位,변위",
    ),
    (Role::Angle, "angle,winkel,angulo,角度,각도"),
    (Role::Temperature, "temperature,temperatur,温度,溫度,온도"),
];

/// Returns the words of a name that are neither quantity nor unit: `thumb` of `Thumb angle (deg)`, `2` of `R2`.
pub(crate) fn stem(name: &str) -> Vec<String> {
    let folded = folded(name);
    let mut words: Vec<String> = Vec::new();
    let mut before = None;
    for c in folded.chars() {
        let is_new =
            before.is_none_or(|before: char| !before.is_alphanumeric() || before.is_numeric() != c.is_numeric());
        match words.last_mut() {
            _ if !c.is_alphanumeric() => {}
            Some(last) if !is_new => last.push(c),
            _ => words.push(c.to_string()),
        }
        before = Some(c);
    }
    words.retain(|word| by_name(word, |_| true).is_none() && !units::is_unit(word) || is_index(word));
    words.sort_unstable();
    words
}

/// Last words of the names of columns that state another column's uncertainty.
const UNCERTAINTIES: [&str; 10] =
    ["sd", "std", "stdev", "stddev", "sigma", "sem", "err", "error", "unc", "uncertainty"];

/// True if a name denotes another column's uncertainty: `strain_sd`.
fn is_uncertainty(name: &str) -> bool {
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.next_back().is_some_and(|last| UNCERTAINTIES.contains(&last)) && words.next().is_some()
}

/// True if a name denotes how fast a quantity changes, or contains one by chance: `strain_rate`, `Constraint`.
fn is_another(name: &str) -> bool {
    const RATES: [&str; 5] = ["rate", "speed", "velocity", "geschwindigkeit", "vitesse"];
    let folded = folded(name);
    let mut words = folded.split(|c: char| !c.is_alphanumeric());
    words.any(|word| RATES.iter().any(|rate| word.ends_with(rate))) || folded.contains("constrain")
}

/// Returns the role that a column's name and unit suggest, if any.
pub(crate) fn role(name: &str, unit: Option<&str>) -> Option<(Role, Sureness)> {
    if is_uncertainty(name) || is_another(name) {
        return None;
    }
    let fits = |role: Role| {
        // A unit of another quantity, `Position (V)`, excludes the role; no unit, or an unknown one, does not.
        unit.is_none_or(|unit| units::unit(role, unit).is_some() || !units::is_unit(unit))
    };
    by_name(name, fits).or_else(|| by_unit(name, unit?))
}

/// True if a heading is that of a measured quantity.
pub(crate) fn is_quantity(heading: &str) -> bool {
    let (name, unit) = take_apart(heading);
    matches!(role(&name, unit.as_deref()), Some((_, Sureness::Strong)))
}

/// Returns the role of a name among the fitting ones: by the whole name, a part of it, or the whole name apart from an index or a short
/// word after it.
fn by_name(name: &str, fits: impl Fn(Role) -> bool) -> Option<(Role, Sureness)> {
    let lower = folded(name);
    let spaced = lower.replace(['_', '-', '.'], " ");
    let whole = |name: &str| {
        let letters: String = name.chars().filter(|c| c.is_alphanumeric()).collect();
        WHOLE.iter().find(|(role, names)| is_among(names, &letters) && fits(*role))
    };
    let part = || PART.iter().find(|(role, parts)| parts.split(',').any(|part| spaced.contains(part)) && fits(*role));
    let strong = whole(&lower).or_else(part).map(|(role, _)| (*role, Sureness::Strong));
    strong.or_else(|| whole(without_index(&lower)?).map(|(role, _)| (*role, Sureness::Indexed)))
}

/// Removes the index, or the short word, that distinguishes a name from others: `R_1`, `R2`, `eps_k`, `R_min`. `R0` is the resistance at
/// rest; `u_1`, `p1`, `x1` are ambiguous.
fn without_index(name: &str) -> Option<&str> {
    let (bare, end, letters): (_, _, &[&str]) = match name.rsplit_once(['_', ' ', '-', '.']) {
        Some((bare, end)) => (bare.trim_end_matches('('), end.trim_end_matches(')'), &["r", "t", "x", "d", "e"]),
        None => {
            let bare = name.trim_end_matches(|c: char| c.is_ascii_digit());
            (bare, &name[bare.len()..], &["r", "t"])
        }
    };
    let end = end.trim_start_matches('(');
    let is_short = end.chars().count() == 1 || is_index(end) || SHORT_WORDS.contains(&end) || end == "max";
    let is_known = bare.len() > 1 || letters.contains(&bare);
    (is_short && is_known && (bare, end) != ("r", "0")).then_some(bare)
}

/// Returns the role by the unit. Only the sensor is measured in Ω, but many things in mm, degrees and seconds. `G (mS)` is a conductance.
fn by_unit(name: &str, unit: &str) -> Option<(Role, Sureness)> {
    if units::is_siemens(unit) && is_among("g,gs,gx,gsensor", &folded(name)) {
        return Some((Role::Resistance, Sureness::Strong));
    }
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
    fn an_uncertainty_has_no_role() {
        for name in ["strain_sd", "angle_sd", "Strain error", "R std", "displacement.err"] {
            assert_eq!(role(name, None), None, "{name}");
        }
        for name in ["strain_rate", "Strain rate", "Dehnungsgeschwindigkeit", "StrainRate", "Constraint"] {
            assert_eq!(role(name, None), None, "{name}");
        }
        assert!(role("strain", None).is_some() && role("angle_deg", None).is_some() && role("std", None).is_none());
    }

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
            ("strain_1", "strain_1", None),
            ("R (2)", "R (2)", None),
            ("Dehnung/1", "Dehnung", Some("1")),
            ("R_k", "R_k", None),
            ("R/k", "R", Some("k")),
            ("R_s", "R_s", None),
            ("t_s", "t", Some("s")),
            ("time_min", "time", Some("min")),
            ("R_min", "R_min", None),
            ("strain_c", "strain_c", None),
            ("temp_c", "temp", Some("c")),
            ("position_v", "position", Some("v")),
            ("length_m", "length", Some("m")),
            ("length_m1", "length_m1", None),
            ("force_n", "force", Some("n")),
            ("force_1", "force_1", None),
            ("conductance_us", "conductance", Some("uS")),
            ("Leitwert [mS]", "Leitwert", Some("mS")),
            ("time_us", "time", Some("us")),
            ("Déformation (%)", "Déformation", Some("%")),
        ];
        for (heading, name, unit) in cases {
            assert_eq!(take_apart(heading), (name.to_owned(), unit.map(str::to_owned)), "{heading}");
        }
    }

    #[test]
    fn a_unit_may_stand_anywhere_in_a_heading() {
        let cases = [
            (Role::Resistance, "resistance_kohm_1", Some("kohm")),
            (Role::Resistance, "resistance.kohm", Some("kohm")),
            (Role::Resistance, "Resistance..kOhm.", Some("kOhm")),
            (Role::Resistance, "kohm", Some("kohm")),
            (Role::Resistance, "R_k", None),
            (Role::Resistance, "R_min", None),
            (Role::Resistance, "ohm or kohm", None),
            (Role::Strain, "StrainPercent", Some("Percent")),
            (Role::Strain, "strain %", Some("%")),
            (Role::Strain, "strain_pct_cmd", Some("pct")),
            (Role::Strain, "strain_1", None),
            (Role::Strain, "strain ratio", None),
            (Role::Time, "time_ms_1", Some("ms")),
            (Role::Time, "timestamp", None),
            (Role::Displacement, "position in counts", None),
        ];
        for (role, heading, unit) in cases {
            assert_eq!(unit_within(role, heading).as_deref(), unit, "{heading}");
        }
    }

    #[test]
    fn a_stem_is_what_is_left_of_a_name() {
        for (one, other) in [("Thumb", "thumb angle"), ("R2", "Angle 2"), ("res_left-index", "left_index_strain")] {
            assert!(!stem(one).is_empty() && stem(one) == stem(other), "{one}: {:?} {:?}", stem(one), stem(other));
        }
        assert_ne!(stem("R1"), stem("angle2"));
        assert!(stem("Resistance").is_empty());
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
        for (name, unit, expected) in [
            ("Deformación", Some("%"), Role::Strain),
            ("déformation", Some("%"), Role::Strain),
            ("Deformation", Some("mm"), Role::Displacement),
            ("应变", None, Role::Strain),
            ("변형률", Some("%"), Role::Strain),
            ("analogRead", None, Role::Adc),
            ("电阻", Some("Ω"), Role::Resistance),
            ("Conductance", Some("uS"), Role::Resistance),
            ("G", Some("mS"), Role::Resistance),
            ("∆R/R₀", Some("%"), Role::Ratio),
            ("(R-R0)/R0", None, Role::Ratio),
            ("λ", None, Role::Strain),
            ("Temps", Some("s"), Role::Time),
        ] {
            assert_eq!(strong(name, unit), Some(expected), "{name}");
        }
        assert_eq!(strong("dt", Some("uS")), None);
        assert_eq!(role("Length", Some("mm")), Some((Role::Displacement, Sureness::Weak)));
    }
}
