/// Writes a number of things in words.
///
/// ```
/// use ohmstrain_bench_data::counted;
/// assert_eq!([counted(1, "gap"), counted(0, "gap"), counted(3, "gap")], ["1 gap", "0 gaps", "3 gaps"]);
/// ```
#[must_use]
pub fn counted(count: impl TryInto<u64>, thing: &str) -> String {
    let count = count.try_into().unwrap_or(u64::MAX);
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}
