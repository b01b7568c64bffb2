use std::str::FromStr;

/// Prefix of the names in exported C code, so that two sensors in one program have different names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Prefix(String);

/// Prefix used in the templates.
pub const WRITTEN: &str = "ohmstrain";

impl Default for Prefix {
    fn default() -> Self {
        Self(WRITTEN.to_owned())
    }
}

impl FromStr for Prefix {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_name = text.starts_with(|c: char| c.is_ascii_lowercase())
            && text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
        if is_name {
            Ok(Self(text.to_owned()))
        } else {
            Err("expected small letters, digits and underscores, a letter first".to_owned())
        }
    }
}

impl Prefix {
    /// Returns the prefix of a part: `left` and `index` give `left_index`.
    pub fn of_part(&self, name: &str) -> Self {
        Self(format!("{}_{name}", self.0))
    }

    /// Replaces the prefix of the templates in a text or a file's name by this one.
    pub fn put_into(&self, text: &str) -> String {
        let Self(prefix) = self;
        if prefix == WRITTEN {
            return text.to_owned();
        }
        let upper = prefix.to_uppercase();
        let names = [
            ("OHMSTRAIN_", format!("{upper}_")),
            ("ohmstrain_", format!("{prefix}_")),
            ("src/ohmstrain.", format!("src/{prefix}.")),
            ("name=ohmstrain\n", format!("name={prefix}\n")),
            ("includes=ohmstrain.h", format!("includes={prefix}.h")),
            ("\"name\": \"ohmstrain\"", format!("\"name\": \"{prefix}\"")),
            ("name: ohmstrain\n", format!("name: {prefix}\n")),
            ("config OHMSTRAIN\n", format!("config {upper}\n")),
            ("CONFIG_OHMSTRAIN", format!("CONFIG_{upper}")),
            ("Examples → ohmstrain", format!("Examples → {prefix}")),
            ("\"ohmstrain.h\"", format!("\"{prefix}.h\"")),
        ];
        names.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
    }
}

#[cfg(test)]
mod tests {
    use super::Prefix;

    #[test]
    fn a_prefix_is_a_name_in_c() {
        for name in ["left", "finger_2"] {
            assert!(name.parse::<Prefix>().is_ok(), "{name}");
        }
        for name in ["", "2nd", "Left", "a-b", "_a", "é"] {
            assert!(name.parse::<Prefix>().is_err(), "{name}");
        }
    }
}
