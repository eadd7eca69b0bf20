//! `report.html`: the diagnosis with its pictures as one self-contained file (Plotly.js inside).

use std::collections::BTreeMap;

use diagnosis::Diagnosis;
use diagnosis::report::{Report, advice};
use serde_json::{Value, json};

use crate::picture::plotly_js;

/// Significant digits of the figures in the page; the full ones are in `diagnosis.json`.
const DIGITS: usize = 5;

/// The page. `diagnosis_json` is what `diagnosis.json` holds, `drives` names where the drives came
/// from, `overlay` is the text of the extended truck file, `example` what was hidden and the trip that
/// closes the loop.
pub(super) fn page(
    found: &Diagnosis,
    diagnosis_json: &Value,
    report: &Report,
    drives: &str,
    overlay: Option<&str>,
    example: Option<Value>,
) -> String {
    let advice: BTreeMap<&str, &str> = found.causes.iter().map(|c| (c.id, advice(c.id))).collect();
    let figures = serde_json::to_value(report).map_or(Value::Null, rounded);
    let data = json!({
        "diagnosis": diagnosis_json,
        "report": figures,
        "advice": advice,
        "drives": drives,
        "overlay": overlay,
        "example": example.map_or(Value::Null, rounded),
    });
    // the data last: what users named may look like a placeholder
    include_str!("page/page.html")
        .replace("{{style}}", include_str!("page/page.css"))
        .replace("{{script}}", include_str!("page/page.js"))
        .replace("{{plotly}}", &plotly_js())
        .replace("{{data}}", &data.to_string().replace("</", "<\\/"))
}

/// All numbers to [`DIGITS`] significant digits.
fn rounded(value: Value) -> Value {
    match value {
        Value::Number(n) if n.is_f64() => {
            n.as_f64().map_or(Value::Number(n), |x| crate::cmd::rounded(x, DIGITS).into())
        }
        Value::Array(values) => values.into_iter().map(rounded).collect(),
        Value::Object(map) => map.into_iter().map(|(k, v)| (k, rounded(v))).collect(),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_short_and_close() {
        let text = rounded(json!({ "a": [0.123456789, -98765.4321, 0.0, 7] })).to_string();
        assert_eq!(text, r#"{"a":[0.12346,-98765.0,0.0,7]}"#);
    }
}
