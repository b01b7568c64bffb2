use ohmstrain_ekf::Influence;

/// Parses an influence of surprising readings: `none`, `redescending:K`, `huber:K` or `student-t:DOF`.
///
/// ```
/// assert_eq!(ohmstrain::influence("huber:2"), Ok(ohmstrain::Influence::Huber { threshold: 2.0 }));
/// ```
///
/// # Errors
/// The expected texts.
pub fn influence(text: &str) -> Result<Influence<f64>, String> {
    if text == "none" {
        return Ok(Influence::Full);
    }
    let parsed = text.split_once(':').and_then(|(kind, number)| {
        let number: f64 = number.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0)?;
        match kind {
            "huber" => Some(Influence::Huber { threshold: number }),
            "redescending" => Some(Influence::Redescending { threshold: number }),
            "student-t" => Some(Influence::StudentT { degrees_of_freedom: number }),
            _ => None,
        }
    });
    parsed.ok_or_else(|| "expected none, or redescending:K, huber:K or student-t:DOF with a positive number".into())
}
