//! A file of tests that its program does not name would be left out without a word.

#[test]
fn every_file_of_tests_is_in_its_program() {
    let metadata = cargo_metadata::MetadataCommand::new().no_deps().exec().unwrap();
    let mut looked_up = 0;
    for package in &metadata.packages {
        let folder = package.manifest_path.with_file_name("tests/all");
        let Ok(main) = std::fs::read_to_string(folder.join("main.rs")) else { continue };
        for file in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            let name = file.file_stem().unwrap().to_str().unwrap();
            let line = format!("mod {name};");
            assert!(name == "main" || main.lines().any(|l| l == line), "{}", file.display());
            looked_up += 1;
        }
    }
    assert!(looked_up > 100, "{looked_up} files");
}
