use crate::import::error::ImportError;
use crate::import::roles::{
    Align, Channel, Decision, FileColumn, Found, PerFile, Recipe, decide, is_stretch_without_zero, refer,
};
use crate::import::series::{Values, alternation};
use crate::import::table::Table;
use crate::import::words::units::SCALED;
use crate::import::words::{DecimalMark, Role};

/// Fraction of negative readings above which signs count as arbitrary.
const FEW_SIGNS: f64 = 0.1;

/// An import without open questions.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Answers that were given.
    given: Recipe,
    /// The answers with those of the preset.
    pub(crate) recipe: Recipe,
    pub(crate) decision: Decision,
    /// Conclusions from names or numbers that no flag stated.
    pub remarks: Vec<String>,
}

impl Plan {
    /// Decides by names, units and numbers everything that the recipe leaves open.
    ///
    /// # Errors
    /// [`ImportError::Question`] for the first open question.
    pub fn new(tables: &[Table], given: &Recipe) -> Result<Self, ImportError> {
        Self::of(&Found::of(tables), given.clone())
    }

    fn of(found: &Found, given: Recipe) -> Result<Self, ImportError> {
        let recipe = given.completed();
        let decision = decide(found, &recipe);
        match decision.questions.first() {
            Some(question) => Err(question.clone()),
            None => Ok(Self { given, recipe, remarks: decision.remarks.clone(), decision }),
        }
    }

    /// Makes the plan that `inspect` proposes. In addition to the decisions of [`new`](Self::new), it has a matching preset, arbitrary
    /// signs, alternating polarity, stretch ratios that are 1 at rest, and an alignment of two files' clocks by the motion.
    ///
    /// # Errors
    /// [`ImportError::Question`] for the first open question.
    pub fn propose(tables: &[Table], given: &Recipe) -> Result<Self, ImportError> {
        let found = Found::of(tables);
        let fits = found.preset.filter(|_| tables.len() == 1 && given.columns.is_empty());
        if let Some(preset) = given.preset.or(fits) {
            return Self::of(&found, Recipe { preset: Some(preset), ..given.clone() });
        }
        let align = given.align.or((tables.len() > 1).then_some(Align::Motion));
        let mut given = Recipe { align, ..given.clone() };
        if is_stretch_without_zero(&found, &given, &decide(&found, &given)) {
            given.zero.push((Role::Strain, 1.0));
        }
        let plan = Self::of(&found, given.clone())?;
        let values = Values::read(tables, plan.readings(), &given.missing)?.values;
        let recipe = with_signs(plan.recipe, plan.decision.readings[0].values.role, &values);
        Ok(Self { given: recipe.clone(), recipe, ..plan })
    }

    /// Returns the channel of the trace's readings.
    pub(crate) fn readings(&self) -> &Channel {
        &self.decision.readings[0].values
    }

    /// Returns the column of the reference, if there is one.
    pub(crate) fn reference(&self) -> Option<FileColumn> {
        self.decision.reference.as_ref().map(|reference| reference.values.place)
    }

    /// Returns the recipe of flags for all of this plan.
    #[must_use]
    pub fn recipe(&self, tables: &[Table]) -> Recipe {
        if self.given.preset.is_some() {
            return self.given.clone();
        }
        let mut out = Recipe { columns: Vec::new(), units: Vec::new(), ..self.given.clone() };
        for channel in &self.decision.channels() {
            out.columns.push((channel.role, refer(tables, channel.place)));
            out.units.push((channel.role, self.unit_text(channel).to_owned()));
        }
        // Columns that the user excluded stay excluded.
        out.columns.extend(self.given.columns.iter().filter(|(_, name)| name.is_none()).cloned());
        for (index, table) in tables.iter().enumerate() {
            let file = (tables.len() > 1).then_some(index + 1);
            let (layout, options) = (&table.layout, self.given.read_options(index));
            let says_mark = layout.decimal != DecimalMark::Point || layout.has_groups;
            if options.decimal.is_none() && says_mark {
                out.decimal.push(PerFile { file, value: layout.decimal });
            }
            if options.skip.is_none() && layout.skip > 0 {
                out.skip.push(PerFile { file, value: layout.skip });
            }
        }
        out
    }

    /// Returns the column of each role by its name in messages, with its file and unit.
    #[must_use]
    pub fn columns(&self, tables: &[Table]) -> Vec<(Role, usize, usize, String, &str)> {
        let describe = |channel: &Channel| {
            let FileColumn { file, column } = channel.place;
            (channel.role, file, column, tables[file].name(column), self.unit_text(channel))
        };
        self.decision.channels().iter().map(describe).collect()
    }

    /// Returns the unit as written in flags.
    fn unit_text(&self, channel: &Channel) -> &str {
        match channel.unit.name {
            SCALED => self.recipe.unit(channel.role).unwrap_or(SCALED),
            name => name,
        }
    }
}

/// Completes a recipe for meaningless signs: many negative readings, or signs that alternate from one to the next.
fn with_signs(recipe: Recipe, role: Role, readings: &[f64]) -> Recipe {
    let known = readings.iter().filter(|value| !value.is_nan()).count();
    let negative = readings.iter().filter(|value| **value < 0.0).count();
    // A few, such as -999, have another meaning, which raises a question.
    let are_arbitrary = role == Role::Resistance && negative as f64 > FEW_SIGNS * known as f64;
    let is_new = are_arbitrary && !recipe.magnitude.contains(&role);
    let sizes: Vec<f64> = readings.iter().map(|value| value.abs()).collect();
    Recipe {
        magnitude: recipe.magnitude.iter().copied().chain(is_new.then_some(role)).collect(),
        fold_polarity: recipe.fold_polarity || alternation(&sizes).is_some(),
        ..recipe
    }
}
