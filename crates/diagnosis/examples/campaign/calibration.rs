//! Cases as lines that a machine reads, and over any number of them: stated probability against
//! observed frequency, coverage of the intervals cause by cause.

use std::collections::BTreeMap;
use std::path::Path;

use diagnosis::Diagnosis;
use serde::{Deserialize, Serialize};

use super::plot::{self, Panel, Series};
use super::support::effects::Effect;
use super::truth::{Interval, intervals};

/// One case of a run, a line that begins with `{`.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Case {
    pub(crate) family: u32,
    pub(crate) kind: String,
    pub(crate) seed: u64,
    pub(crate) case: usize,
    pub(crate) hidden: Vec<String>,
    pub(crate) verdict: String,
    /// Named causes and their rivals: id, stated probability, whether it was hidden.
    pub(crate) stated: Vec<(String, f64, bool)>,
    pub(crate) intervals: Vec<Interval>,
}

impl Case {
    pub(crate) fn of(
        (family, kind, seed, case): (u32, &str, u64, usize),
        hidden: &[Effect],
        d: &Diagnosis,
    ) -> Self {
        let words = hidden.iter().map(|e| match e {
            Effect::Cause { id, .. } => (*id).to_owned(),
            Effect::Outside { kind, .. } => format!("{kind:?}"),
            Effect::SecondOutside { kind, .. } => format!("{kind:?}"),
        });
        let words: Vec<String> = words.collect();
        let named = d.causes.iter().map(|c| (c.id, c.probability));
        let rivals = d.causes.iter().flat_map(|c| &c.confused_with).map(|r| (r.id, r.probability));
        // A rival of two causes is stated twice: the larger one counts.
        let mut stated: BTreeMap<&str, f64> = BTreeMap::new();
        for (id, p) in named.chain(rivals) {
            let most = stated.entry(id).or_insert(p);
            *most = most.max(p);
        }
        let stated =
            stated.into_iter().map(|(id, p)| (id.to_owned(), p, words.iter().any(|w| w == id)));
        Self {
            family,
            kind: kind.to_owned(),
            seed,
            case,
            stated: stated.collect(),
            verdict: format!("{:?}", d.verdict),
            intervals: intervals(family, hidden, d),
            hidden: words,
        }
    }
}

/// The cases in the output of runs; other lines are for people.
pub(crate) fn read(text: &str) -> Result<Vec<Case>, serde_json::Error> {
    text.lines().filter(|l| l.starts_with('{')).map(serde_json::from_str).collect()
}

/// Stated probabilities and whether the cause was hidden (1 or 0). Where the true cause was taken
/// away no probability of the catalogue can be right.
fn stated(cases: &[Case]) -> Vec<(f64, f64)> {
    let judged = cases.iter().filter(|c| c.kind != "deleted");
    judged.flat_map(|c| &c.stated).map(|s| (s.1, f64::from(u8::from(s.2)))).collect()
}

/// One of ten bins of stated probability.
struct Bin {
    index: usize,
    count: f64,
    /// Means of what was stated and of what was so.
    stated: f64,
    seen: f64,
}

impl Bin {
    /// 90 % interval of the frequency behind the observed one (Wilson, J. Am. Stat. Assoc. 22, 1927).
    fn interval(&self) -> [f64; 2] {
        const Z: f64 = 1.645;
        let (n, p) = (self.count, self.seen);
        let middle = (p + 0.5 * Z * Z / n) / (1.0 + Z * Z / n);
        let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + 0.25 * Z * Z / (n * n)).sqrt();
        [middle - half, middle + half]
    }
}

/// The bins that hold anything.
fn bins(stated: &[(f64, f64)]) -> Vec<Bin> {
    let of = |index: usize| {
        let here = || stated.iter().filter(move |s| ((s.0 * 10.0) as usize).min(9) == index);
        let count = here().count() as f64;
        let mean = |f: fn(&(f64, f64)) -> f64| here().map(f).sum::<f64>() / count;
        (count > 0.0).then(|| Bin { index, count, stated: mean(|s| s.0), seen: mean(|s| s.1) })
    };
    (0..10).filter_map(of).collect()
}

/// Observed over stated frequency, as a picture.
pub(crate) fn draw(cases: &[Case], path: &Path) -> std::io::Result<()> {
    let bins = bins(&stated(cases));
    let points = |f: fn(&Bin) -> f64| bins.iter().map(|b| (b.stated, f(b))).collect::<Vec<_>>();
    let line = vec![(0.0, 0.0), (1.0, 1.0)];
    let intervals = bins.iter().map(|b| {
        let points = b.interval().map(|y| (b.stated, y)).to_vec();
        Series { name: "", points, line: true }
    });
    let mut series = vec![
        Series { name: "as stated", points: line, line: true },
        Series {
            name: "causes and rivals, 90 % interval",
            points: points(|b| b.seen),
            line: false,
        },
    ];
    series.extend(intervals);
    let title = format!("{} cases, {} probabilities", cases.len(), stated(cases).len());
    let (x, y) = ("stated probability", "hidden");
    plot::write(path, &[Panel { title: &title, x, y, series }])
}

/// Ten bins, scores, and coverage per cause, as text.
pub(crate) fn report(cases: &[Case]) -> String {
    let mut out = format!("{} cases\n\n", cases.len());
    let stated = stated(cases);
    let count = stated.len().max(1) as f64;
    out += "stated probability, observed frequency\n";
    let mut error = 0.0;
    for Bin { index, count: n, stated: mean, seen } in bins(&stated) {
        error += n / count * (mean - seen).abs();
        let (low, high) = (index as f64 / 10.0, (index + 1) as f64 / 10.0);
        out += &format!("{low:.1} to {high:.1}: {n:4} stated, mean {mean:.3}, hidden {seen:.3}\n");
    }
    let mean =
        |f: &dyn Fn(f64, f64) -> f64| stated.iter().map(|s| f(s.0, s.1)).sum::<f64>() / count;
    let brier = mean(&|p, y| (p - y) * (p - y));
    // A probability is stated with two digits: 0 and 1 are within half of the last one.
    let loss = mean(&|p, y| {
        let p = p.clamp(0.005, 0.995);
        -(y * p.ln() + (1.0 - y) * (1.0 - p).ln())
    });
    out += &format!(
        "{} stated: Brier score {brier:.4}, log loss {loss:.4} nats, expected calibration error {error:.4}\n",
        stated.len()
    );
    let mut causes: BTreeMap<(&str, &str), Vec<&Interval>> = BTreeMap::new();
    for i in cases.iter().flat_map(|c| &c.intervals) {
        causes.entry((&i.id, &i.key)).or_default().push(i);
    }
    let all: Vec<&&Interval> = causes.values().flatten().collect();
    let covered = |list: &mut dyn Iterator<Item = &&Interval>| list.filter(|i| i.covers()).count();
    out += &format!(
        "\n90 % intervals that cover: {} of {}\n",
        covered(&mut all.iter().copied()),
        all.len()
    );
    out += "cause, key: covered, sigmas off, found over hidden\n";
    for ((id, key), list) in &causes {
        let off: Vec<String> = list.iter().map(|i| format!("{:.1}", i.off())).collect();
        let part: Vec<String> = list.iter().map(|i| format!("{:.2}", i.found / i.hidden)).collect();
        out += &format!(
            "{id}, {key}: {} of {}; {}; {}\n",
            covered(&mut list.iter()),
            list.len(),
            off.join(" "),
            part.join(" ")
        );
    }
    out
}
