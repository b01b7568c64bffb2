//! Remarks of an import on files rather than columns: on skipped parts, and on how they were read.

use crate::counted::counted;
use crate::import::trace::build::Work;

impl Work<'_> {
    /// Adds remarks on files from which nothing is taken.
    pub(crate) fn mention_unused(&mut self) {
        let taken = self.plan.decision.readings.iter().chain(&self.plan.decision.reference);
        let used: Vec<usize> = taken.map(|timed| timed.values.place.file).collect();
        for table in (0..self.tables.len()).filter(|table| !used.contains(table)) {
            self.remark(table, "nothing is taken from this file");
        }
    }

    /// Adds remarks on lines that are not rows, and on rows that lack cells.
    pub(crate) fn mention_passed_over(&mut self) {
        for (index, table) in self.tables.iter().enumerate() {
            let layout = &table.layout;
            if layout.is_exchanged {
                self.remark(index, "rows and columns seem to be exchanged: each line is taken for a column");
            }
            if layout.values_in_turn {
                let columns = table.columns.len();
                self.remark(
                    index,
                    format!("a line is a value of one of {columns} quantities in turn: {columns} lines are a row"),
                );
            }
            if let Some(given) = layout.given_names {
                let (names, columns) = (counted(given, "name"), counted(table.columns.len(), "column"));
                self.remark(index, format!("{names} above {columns}: taken for those of the first columns"));
            }
            if let Some(line) = layout.first_text_line {
                let lines = counted(layout.text_lines, "line");
                let which = if layout.text_lines > 1 { "of which the first is" } else { "which is" };
                self.remark(index, format!("{lines} among or behind the data passed over, {which} line {line}"));
            }
            if layout.short_lines > 0 {
                let rows = counted(layout.short_lines, "row");
                let what = "with fewer cells than there are columns: the last ones are taken for missing";
                self.remark(index, format!("{rows} {what}"));
            }
        }
    }
}
