//! Answers about files: the flags of `ohmstrain import` in the syntax of a shell.

use std::fmt::Display;
use std::str::FromStr;

use ohmstrain_bench_data::import::{Recipe, Role};

/// Parses the recipe from flags.
pub fn recipe(flags: &str) -> Result<Recipe, String> {
    let words = shlex::split(flags).ok_or("expected flags with closing quotes, found an open one")?;
    let mut recipe = Recipe::default();
    let mut words = words.into_iter();
    while let Some(flag) = words.next() {
        if flag == "--fold-polarity" {
            recipe.fold_polarity = true;
            continue;
        }
        let (flag, value) = match flag.split_once('=') {
            Some((flag, value)) if flag.starts_with("--") => (flag.to_owned(), value.to_owned()),
            _ => {
                let value = words.next().ok_or_else(|| format!("{flag}: expected a value, found none"))?;
                (flag, value)
            }
        };
        say(&mut recipe, &flag, &value).map_err(|error| format!("{flag}: {error}"))?;
    }
    Ok(recipe)
}

/// Takes one flag and its value.
fn say(recipe: &mut Recipe, flag: &str, value: &str) -> Result<(), String> {
    match flag {
        "--column" => recipe.columns.push(of_role(value, parsed)?),
        "--unit" => recipe.units.push(of_role(value, |unit| Ok(unit.to_owned()))?),
        "--decimal" => recipe.decimal.push(parsed(value)?),
        "--skip" => recipe.skip.push(parsed(value)?),
        "--sheet" => recipe.sheet = Some(value.to_owned()),
        "--missing" => recipe.missing.push(value.to_owned()),
        "--magnitude" => recipe.magnitude.push(parsed(value)?),
        "--drop-zeros" => recipe.drop_zeros.push(parsed(value)?),
        "--zero" => recipe.zero.push(of_role(value, parsed)?),
        "--align" => recipe.align = Some(parsed(value)?),
        "--where" => recipe.rows.push(parsed(value)?),
        "--recording" => recipe.recording = Some(counted(value)?),
        "--rate-hz" => recipe.rate_hz = Some(positive(value)?),
        "--gauge-length-mm" => recipe.gauge_length_mm = Some(positive(value)?),
        "--front-end" => recipe.front_end = Some(parsed(value)?),
        "--joint" => recipe.joint = Some(parsed(value)?),
        "--preset" => recipe.preset = Some(parsed(value)?),
        _ => return Err("expected a flag of `ohmstrain import`".into()),
    }
    Ok(())
}

/// Splits `ROLE=VALUE`.
fn of_role<T>(text: &str, value: impl FnOnce(&str) -> Result<T, String>) -> Result<(Role, T), String> {
    let (role, rest) = text.split_once('=').ok_or("expected ROLE=VALUE")?;
    Ok((role.parse()?, value(rest)?))
}

fn parsed<T: FromStr<Err: Display>>(text: &str) -> Result<T, String> {
    text.parse().map_err(|error: T::Err| format!("{error}, found `{text}`"))
}

/// Parses a number that counts from 1.
fn counted(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|number| *number > 0).ok_or_else(|| format!("expected a number from 1 on, found `{text}`"))
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| format!("expected a positive number, found `{text}`"))
}
