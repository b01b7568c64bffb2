use crate::counted::counted;
use crate::import::table::Table;

impl Table {
    /// Describes the format, in words.
    #[must_use]
    pub fn description(&self) -> String {
        let layout = &self.layout;
        let mut words = vec![layout.format.clone()];
        words.extend(layout.encoding.map(str::to_owned));
        words.extend(layout.separator.map(|separator| format!("separated by {separator}")));
        if layout.separator.is_some() {
            words.push(format!("decimal mark `{}`", layout.decimal));
        }
        if layout.is_exchanged {
            words.push("rows and columns seem to be exchanged".to_owned());
        }
        if layout.values_in_turn {
            words.push("values in turn, a line each".to_owned());
        }
        if layout.skip > 0 {
            words.push(format!("{} above the header", counted(layout.skip, "line")));
        }
        words.push(match layout.header_lines {
            0 if self.has_names() => "names from the file itself".to_owned(),
            0 => "no header".to_owned(),
            1 => "1 header line".to_owned(),
            lines => format!("{lines} header lines"),
        });
        if layout.unit_line {
            words.push("a line of units".to_owned());
        }
        words.push(counted(self.len(), "row"));
        words.join(", ")
    }
}
