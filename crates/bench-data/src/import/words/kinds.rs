//! Kinds of a quantity that its name distinguishes: a resistance or its inverse, a strain or a stretch ratio, a ratio or a change.

/// Converts a name to lower case, without accents, with plain digits and one kind of delta. Umlauts stay: they are letters.
pub(crate) fn folded(name: &str) -> String {
    const PLAIN: [(&str, char); 9] = [
        ("áàâã", 'a'),
        ("éèêë", 'e'),
        ("íìî", 'i'),
        ("óòôõ", 'o'),
        ("úùû", 'u'),
        ("ç", 'c'),
        ("ñ", 'n'),
        ("∆", 'δ'),
        ("₀", '0'),
    ];
    let plain = |c: char| PLAIN.iter().find(|(accented, _)| accented.contains(c)).map_or(c, |(_, plain)| *plain);
    name.trim().to_lowercase().chars().map(plain).collect()
}

/// True if a word is in a comma-separated list.
pub(crate) fn is_among(list: &str, word: &str) -> bool {
    list.split(',').any(|known| known == word)
}

/// True if the name of a column denotes the inverse of a resistance.
pub(crate) fn is_conductance(name: &str) -> bool {
    let folded = folded(name);
    ["conductanc", "leitwert", "电导", "電導", "컨덕턴스"].iter().any(|part| folded.contains(part))
}

/// True if a strain's name denotes a stretch ratio: the length over that at rest.
pub(crate) fn is_stretch_ratio(name: &str) -> bool {
    let letters: String = folded(name).chars().filter(|c| c.is_alphanumeric()).collect();
    is_among("λ,lambda,stretchratio,stretch", &letters) || letters.contains("stretchratio")
}

/// True if a name denotes a change relative to the resistance at rest, `dR/R0`, not a ratio, `R/R0`.
pub(crate) fn is_change(name: &str) -> bool {
    let folded = folded(name);
    let plain: String = folded.chars().filter(|c| !c.is_whitespace()).collect();
    folded.starts_with(['d', 'δ']) || folded.contains("change") || plain.contains("-r0") || plain.ends_with("r0-1")
}

/// True if a resistance's name denotes its change since rest, `ΔR`.
pub(crate) fn is_difference(name: &str) -> bool {
    let folded = folded(name);
    let letters: String = folded.chars().filter(|c| c.is_alphanumeric()).collect();
    let is_delta = |rest: &str| rest.starts_with('r') && !rest.starts_with("ro");
    let behind = ["delta", "diff", "δ"].iter().find_map(|start| letters.strip_prefix(start));
    behind.is_some_and(is_delta) || letters == "dr" || letters.starts_with("dresist") || folded.contains("change")
}
