//! Every command of README and docs: the program's own are run as they stand there (shortened:
//! no dashboard, a bounded duration), the others are looked up. A block that cannot run here says
//! why in a comment before it: `<!-- not run: REASON -->`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::support::{program, server};

/// Simulated time of a run and of traffic that do not say how long, s.
const SHORT_S: &str = "15";
/// Longest simulated time that is driven of a run that says how long, s.
const LONGEST_S: f64 = 60.0;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// README, the pages of docs, and their results.
fn pages() -> Vec<PathBuf> {
    let mut pages = vec![workspace().join("README.md"), workspace().join("examples/README.md")];
    for folder in ["docs", "docs/results"] {
        let entries = std::fs::read_dir(workspace().join(folder)).unwrap();
        let found = entries.map(|e| e.unwrap().path());
        pages.extend(found.filter(|p| p.extension().is_some_and(|e| e == "md")));
    }
    pages.sort();
    pages
}

/// A command of a page.
#[derive(Debug)]
struct Command {
    /// Page and line.
    place: String,
    words: Vec<String>,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    /// In a block: it is meant to be typed.
    Block,
    /// In a block that cannot run here, and why.
    NotRun(String),
    /// In a sentence: often a pattern with brackets.
    Inline,
}

/// What begins a command that is looked at.
const BEGINS: [&str; 2] = ["sim-server", "cargo"];

fn commands(page: &Path) -> Vec<Command> {
    let text = std::fs::read_to_string(page).unwrap();
    let name = page.strip_prefix(workspace()).unwrap().display().to_string();
    let mut found = Vec::new();
    let mut block: Option<Option<Kind>> = None;
    let (mut reason, mut begun): (Option<String>, Option<(usize, String)>) = (None, None);
    for (i, line) in text.lines().enumerate() {
        if let Some(language) = line.trim_start().strip_prefix("```") {
            let shell = matches!(language.trim(), "" | "sh" | "bash" | "console");
            block = match block {
                Some(_) => None,
                None => Some(shell.then(|| reason.take().map_or(Kind::Block, Kind::NotRun))),
            };
            reason = None;
            continue;
        }
        let why = line.strip_prefix("<!-- not run: ").and_then(|l| l.strip_suffix(" -->"));
        if let Some(why) = why {
            reason = Some(why.to_owned());
        }
        let kind = match &block {
            Some(kind) => kind.clone(),
            None if line.starts_with("    ") => {
                Some(reason.clone().map_or(Kind::Block, Kind::NotRun))
            }
            None => None,
        };
        if let Some(kind) = kind {
            let (at, before) = begun.take().unwrap_or((i + 1, String::new()));
            let whole = format!("{before}{}", line.trim());
            if let Some(start) = whole.strip_suffix('\\') {
                begun = Some((at, start.to_owned()));
            } else {
                found.extend(command(&whole, format!("{name}:{at}"), kind));
            }
        } else if block.is_none() {
            for text in line.split('`').skip(1).step_by(2) {
                found.extend(command(text, format!("{name}:{}", i + 1), Kind::Inline));
            }
        }
    }
    found
}

fn command(text: &str, place: String, kind: Kind) -> Option<Command> {
    let text = text.split(" # ").next().unwrap_or(text);
    let words: Vec<String> =
        text.split_whitespace().map(|w| w.trim_matches('"').to_owned()).collect();
    let begins = words.first().is_some_and(|w| BEGINS.contains(&w.as_str()));
    let bare = words.len() == 1 && kind == Kind::Inline;
    (begins && !bare).then_some(Command { place, words, kind })
}

impl Command {
    /// What the program is given, if it is our program.
    fn arguments(&self) -> Option<&[String]> {
        if self.words[0] == "sim-server" {
            return Some(&self.words[1..]);
        }
        let ours = self.words[1] == "run" && self.option("-p") == Some("sim-server");
        let end = self.words.iter().position(|w| w == "--").unwrap_or(self.words.len() - 1);
        (ours && self.option("--example").is_none()).then(|| &self.words[end + 1..])
    }

    /// Values of an option of cargo's.
    fn options<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a str> {
        let own = self.words.split(|w| w == "--").next().unwrap_or_default();
        own.windows(2).filter(move |w| w[0] == name).map(|w| w[1].as_str())
    }

    fn option<'a>(&'a self, name: &'a str) -> Option<&'a str> {
        self.options(name).next()
    }
}

/// The arguments with what keeps them short.
fn shortened(arguments: &[String]) -> Vec<String> {
    let mut arguments = arguments.to_vec();
    if arguments.is_empty() {
        arguments.push("run".to_owned());
    }
    let lacks = |name: &str, arguments: &[String]| !arguments.iter().any(|a| a == name);
    if arguments[0] == "run" && lacks("--headless", &arguments) {
        arguments.push("--headless".to_owned());
    }
    if ["run", "traffic"].contains(&arguments[0].as_str()) && lacks("--duration", &arguments) {
        arguments.extend(["--duration", SHORT_S].map(str::to_owned));
    }
    let duration = arguments.iter().position(|a| a == "--duration");
    if let (Some(at), "run") = (duration, arguments[0].as_str()) {
        let says_s = arguments.get(at + 1).and_then(|s| s.parse::<f64>().ok());
        if says_s.is_some_and(|s| s > LONGEST_S) {
            arguments[at + 1] = LONGEST_S.to_string();
        }
    }
    arguments
}

/// The program's commands in blocks, in the order of their page, in one folder per page that holds
/// `examples` and the logs of `tests`.
#[test]
fn the_commands_of_the_pages_run_as_they_stand_there() {
    let no_sumo = traffic_client::sumo::Programs::find(None).err();
    let mut ran = 0;
    for page in pages() {
        let folder = tempfile::tempdir().unwrap();
        for at in ["examples", "tests"] {
            std::os::unix::fs::symlink(workspace().join(at), folder.path().join(at)).unwrap();
        }
        for command in commands(&page) {
            let Some(arguments) = command.arguments() else { continue };
            let shown = command.words.join(" ");
            match (&command.kind, &no_sumo) {
                (Kind::Inline, _) => continue,
                (Kind::NotRun(why), _) => {
                    eprintln!("not run: {} `{shown}`: {why}", command.place);
                    continue;
                }
                (Kind::Block, Some(why)) if arguments.iter().any(|a| a == "sumo") => {
                    eprintln!("not run: {} `{shown}`: {why}", command.place);
                    continue;
                }
                (Kind::Block, _) => {}
            }
            let arguments = shortened(arguments);
            let output = program().args(&arguments).current_dir(&folder).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{} `{shown}`: {said}", command.place);
            ran += 1;
        }
    }
    assert!(ran >= 15, "{ran} commands");
}

/// Flags of a command of the program, from its help.
fn flags(help: &mut BTreeMap<String, String>, command: &str) -> String {
    let words: Vec<&str> = command.split_whitespace().chain(["--help"]).collect();
    let text = help.entry(command.to_owned()).or_insert_with(|| {
        let output = server(&words);
        assert!(output.status.success(), "{command} --help");
        String::from_utf8(output.stdout).unwrap()
    });
    text.clone()
}

/// Every flag that a page names in a command of ours exists, also in sentences.
#[test]
fn every_flag_that_a_page_names_exists() {
    let mut help = BTreeMap::new();
    let mut looked_up = 0;
    for command in pages().iter().flat_map(|p| commands(p)) {
        let Some(arguments) = command.arguments() else { continue };
        let letter = |c: char| c.is_ascii_lowercase() || c == '-';
        let is_word = |w: &&String| !w.starts_with('-') && w.chars().all(letter);
        let ours: Vec<&str> = arguments.iter().take_while(is_word).map(String::as_str).collect();
        let name = match ours.as_slice() {
            [a @ ("map" | "scenario" | "experiment" | "truck" | "can" | "drives"), b, ..] => {
                format!("{a} {b}")
            }
            [a, ..] => (*a).to_owned(),
            [] => "run".to_owned(),
        };
        let known = flags(&mut help, &name);
        for word in arguments {
            let letters = |c: char| c.is_ascii_lowercase() || c == '-' || c.is_ascii_digit();
            for flag in word.split(|c| !letters(c)).filter(|f| f.starts_with("--") && f.len() > 2) {
                let found = known.split(|c| !letters(c)).any(|f| f == flag);
                assert!(found, "{}: {name} has no {flag}", command.place);
                looked_up += 1;
            }
        }
    }
    assert!(looked_up > 30, "{looked_up} flags");
}

/// Folder of a package of the workspace.
fn package(name: &str) -> Option<PathBuf> {
    let crates = std::fs::read_dir(workspace().join("crates")).unwrap().map(|e| e.unwrap().path());
    let others = ["python", "tests"].map(|f| workspace().join(f));
    crates.chain(others).find(|folder| {
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
        manifest.lines().any(|line| line == format!("name = \"{name}\""))
    })
}

/// `cargo bench`, `cargo test` and examples take minutes: that what they name exists is checked.
#[test]
fn every_example_test_and_bench_that_a_page_names_exists() {
    let mut looked_up = 0;
    for command in pages().iter().flat_map(|p| commands(p)) {
        let Some(name) = command.option("-p").filter(|_| command.words[0] == "cargo") else {
            continue;
        };
        let folder = package(name);
        let folder = folder.unwrap_or_else(|| panic!("{}: no package {name}", command.place));
        for (flag, under) in
            [("--example", "examples"), ("--test", "tests"), ("--bench", "benches")]
        {
            for target in command.options(flag) {
                let file = folder.join(under).join(format!("{target}.rs"));
                let main = folder.join(under).join(target).join("main.rs");
                let found = file.exists() || main.exists();
                assert!(found, "{}: no {target} in {under}", command.place);
                looked_up += 1;
            }
        }
        // `--test all FILE::` is a file of those that `all` puts together
        for (file, _) in command.words.iter().filter_map(|word| word.split_once("::")) {
            let file = folder.join("tests/all").join(format!("{file}.rs"));
            assert!(file.exists(), "{}: no {}", command.place, file.display());
        }
    }
    assert!(looked_up > 20, "{looked_up} targets");
}
