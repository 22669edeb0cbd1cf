//! Checks the workspace from its sources: each crate and folder uses only those that its layer allows, the files of a
//! crate do not import each other in circles, and every path in the main documents exists.
//!
//! The rules are the tables of ARCHITECTURE.md, section "Layers".

mod sources;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use sources::{Crate, Use};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Reads all crates of the workspace.
fn crates() -> Vec<Crate> {
    let mut names: Vec<String> = std::fs::read_dir(root().join("crates"))
        .expect("a folder of crates")
        .map(|entry| entry.expect("a readable folder").file_name().to_string_lossy().into_owned())
        .filter(|name| root().join("crates").join(name).join("src").is_dir())
        .collect();
    names.sort();
    let mut crates: Vec<Crate> =
        names.iter().map(|name| Crate::read(name, &root().join("crates").join(name).join("src"))).collect();
    crates.push(Crate::read("variational", &root().join("src")));
    crates
}

/// Maps each crate (`vi-core`) and each folder of a crate (`vi-solvers/linear`) to what it may use: the rows of the
/// tables.
type Rules = BTreeMap<String, BTreeSet<String>>;

/// Reads the rows "| `name` | `other`, `other` |" of the section "Layers" of a document.
fn rules(document: &str) -> Rules {
    let section = document.split("\n## ").find(|section| section.starts_with("Layers\n"));
    let section = section.expect("ARCHITECTURE.md has a section \"Layers\"");
    let names = |cell: &str| -> Vec<String> {
        cell.split('`').skip(1).step_by(2).map(|name| name.trim_end_matches('/').to_owned()).collect()
    };
    let mut rules = Rules::new();
    for row in section.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').collect();
        let [of, may_use, ..] = cells[..] else { panic!("a row with one cell: {row}") };
        let of = names(of).remove(0);
        // In the second column, folders are named without their crate.
        let crate_of = of.split_once('/').map(|(name, _)| name.to_owned());
        let full =
            |name: String| crate_of.as_ref().map_or(name.clone(), |crate_of| format!("{crate_of}/{name}"));
        rules.insert(of, names(may_use).into_iter().map(full).collect());
    }
    rules
}

/// Returns the crate and the folder of a file: ("vi-solvers", "vi-solvers/linear").
fn place(file: &str) -> (&str, String) {
    let mut parts = file.splitn(3, '/');
    let name = parts.next().unwrap_or("");
    let folder = parts.next().unwrap_or("").trim_end_matches(".rs");
    (name, format!("{name}/{folder}"))
}

/// Returns the uses that the rules do not allow, with the reason.
fn breaches<'a>(uses: &'a [Use], rules: &Rules) -> Vec<(&'a Use, String)> {
    let mut breaches = Vec::new();
    for one in uses {
        let ((from_crate, from), (to_crate, to)) = (place(&one.from), place(&one.to));
        if from_crate != to_crate {
            let allowed = rules.get(from_crate).is_some_and(|allowed| allowed.contains(to_crate));
            if !allowed {
                breaches.push((one, format!("{from_crate} may not use {to_crate}")));
            }
        } else if from != to && rules.contains_key(&to) {
            // A file beside the folders of its crate, such as `error.rs`, may use none of them.
            let allowed = rules.get(&from).is_some_and(|allowed| allowed.contains(&to));
            if !allowed {
                breaches.push((one, format!("{from} may not use {to}")));
            }
        }
    }
    breaches
}

/// Returns the uses that belong to a circle of files, i.e. from whose target a chain of uses leads back.
fn circles(uses: &[Use]) -> Vec<&Use> {
    let mut next: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for one in uses {
        next.entry(&one.from).or_default().insert(&one.to);
    }
    let leads_back = |one: &&Use| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![one.to.as_str()]);
        while let Some(file) = open.pop() {
            if file == one.from {
                return true;
            }
            if seen.insert(file) {
                open.extend(next.get(file).into_iter().flatten());
            }
        }
        false
    };
    uses.iter().filter(leads_back).collect()
}

fn describe(one: &Use) -> String {
    format!("{} uses {} of {}", one.from, one.path, one.to)
}

#[test]
fn crates_and_folders_use_only_what_architecture_md_says() {
    let (all, rules) = (crates(), rules(&read("ARCHITECTURE.md")));
    for one in &all {
        assert!(rules.contains_key(&one.name), "ARCHITECTURE.md, \"Layers\": no row for {}", one.name);
    }
    let uses: Vec<Use> = all.iter().flat_map(|one| one.uses(&all)).collect();
    let found = breaches(&uses, &rules);
    let found: Vec<String> = found.iter().map(|(one, why)| format!("{}: {why}", describe(one))).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let all = crates();
    for one in &all {
        let uses = one.uses(std::slice::from_ref(one));
        let found: Vec<String> = circles(&uses).into_iter().map(describe).collect();
        assert!(found.is_empty(), "circles of imports in {}:\n{}", one.name, found.join("\n"));
    }
}

#[test]
fn files_import_from_the_file_that_defines_a_name() {
    let all = crates();
    for one in &all {
        let uses = one.uses(std::slice::from_ref(one));
        let found: Vec<String> = uses.iter().filter(|one| one.through_root).map(describe).collect();
        assert!(found.is_empty(), "imports through the root of {}:\n{}", one.name, found.join("\n"));
    }
}

/// Returns the words of a document that name a file or folder of the repository.
fn named_paths(document: &str) -> Vec<String> {
    const ROOTS: [&str; 12] = [
        "crates", "src", "tests", "docs", "examples", "scenes", "meshes", "benches", "fuzz", "python", ".ci",
        ".github",
    ];
    let words = document.split(|c: char| c.is_whitespace() || "`()[]\"',;|".contains(c));
    let words = words.map(|word| word.trim_end_matches(['.', ':', '/']).split('#').next().unwrap_or(""));
    words
        .filter(|word| !word.contains(['<', '*', '…', '=', '{']))
        .filter(|word| {
            let first = word.split('/').next().unwrap_or("");
            let is_below = word.contains('/') && (ROOTS.contains(&first) || first.starts_with("vi-"));
            is_below || [".rs", ".md"].iter().any(|end| word.ends_with(end) && !word.contains("://"))
        })
        .map(str::to_owned)
        .collect()
}

/// Returns whether a path named in a document exists: from the root, as `vi-solvers/linear/factor.rs` below `crates/`,
/// or as a bare file name anywhere in `crates/` or `src/`.
fn exists(path: &str, bare_names: &BTreeSet<String>) -> bool {
    let below_crates = path.split_once('/').map(|(name, rest)| format!("crates/{name}/src/{rest}"));
    let module = below_crates.as_ref().map(|path| format!("{path}.rs"));
    root().join(path).exists()
        || below_crates.into_iter().chain(module).any(|path| root().join(path).exists())
        || (!path.contains('/') && bare_names.contains(path))
}

fn file_names(folder: &Path, names: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("a readable folder").path();
        if path.is_dir() {
            file_names(&path, names);
        } else if let Some(name) = path.file_name() {
            names.insert(name.to_string_lossy().into_owned());
        }
    }
}

#[test]
fn every_path_in_the_main_documents_exists() {
    let mut names = BTreeSet::new();
    for folder in ["crates", "src", "docs", "tests"] {
        file_names(&root().join(folder), &mut names);
    }
    let mut missing = Vec::new();
    for document in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let paths = named_paths(&read(document));
        assert!(paths.len() > 3, "{document}: {paths:?}");
        missing.extend(
            paths.iter().filter(|path| !exists(path, &names)).map(|path| format!("{document}: {path}")),
        );
    }
    assert!(missing.is_empty(), "paths that do not exist:\n{}", missing.join("\n"));
}

/// Makes up a crate of four files: `low/a.rs`, `low/b.rs`, `high.rs` and a root that re-exports.
fn made_up(changed: &[(&str, &str)]) -> Crate {
    let mut files = BTreeMap::from([
        ("lib.rs", "//! Root.\nmod high;\nmod low;\npub use high::High;\npub use low::a::A;\n"),
        ("low.rs", "pub(crate) mod a;\npub(crate) mod b;\n"),
        (
            "low/a.rs",
            "/// Not crate::high::High.\npub struct A;\nconst TEXT: &str = \"crate::high::High\";\n",
        ),
        ("low/b.rs", "use crate::low::a::{self, A};\npub fn b(x: A) -> a::A { x }\n"),
        ("high.rs", "use crate::low::b::b;\npub struct High;\n#[cfg(test)]\nmod tests { use super::*; }\n"),
    ]);
    files.extend(changed.iter().copied());
    let files: Vec<_> = files.into_iter().map(|(path, text)| (path.to_owned(), text.to_owned())).collect();
    Crate::new("made-up", &files)
}

fn uses_of(changed: &[(&str, &str)]) -> Vec<Use> {
    let made = made_up(changed);
    made.uses(std::slice::from_ref(&made))
}

#[test]
fn a_sound_tree_is_accepted() {
    let uses = uses_of(&[]);
    let pairs: BTreeSet<_> = uses.iter().map(|one| (&one.from[8..], &one.to[8..])).collect();
    assert_eq!(pairs, BTreeSet::from([("low/b.rs", "low/a.rs"), ("high.rs", "low/b.rs")]));
    assert!(circles(&uses).is_empty() && uses.iter().all(|one| !one.through_root));
    let table = "# Title\n\n## Layers\n\n| `made-up/low` | |\n| `made-up/high` | `low` |\n";
    assert!(breaches(&uses, &rules(table)).is_empty());
}

#[test]
fn a_broken_rule_is_found() {
    let table = "# Title\n\n## Layers\n\n| `made-up/low` | |\n| `made-up/high` | `low` |\n\n## Other\n";
    // The breach is in a `use` line, in a path, behind an alias, or hidden by a re-export of the root.
    for line in [
        "use crate::high::High;",
        "fn f() { crate::high::High; }",
        "use crate::high as top; fn f(_: top::High) {}",
        "use super::super::high::High;",
        "use crate::High;",
    ] {
        let uses = uses_of(&[("low/a.rs", &format!("pub struct A;\n{line}\n"))]);
        let found = breaches(&uses, &rules(table));
        assert!(!found.is_empty(), "{line}: {uses:?}");
        assert!(found.iter().all(|(_, why)| why == "made-up/low may not use made-up/high"), "{line}");
        // Three files import each other in a circle.
        let files: BTreeSet<_> = circles(&uses).into_iter().map(|one| &one.from[8..]).collect();
        assert_eq!(files, BTreeSet::from(["high.rs", "low/a.rs", "low/b.rs"]), "{line}");
        assert_eq!(uses.iter().any(|one| one.through_root), line == "use crate::High;", "{line}");
    }
}

#[test]
fn a_crate_that_uses_another_without_a_row_is_found() {
    let other = Crate::new("vi-other", &[("lib.rs".to_owned(), "pub struct Other;".to_owned())]);
    let all = [made_up(&[("low/a.rs", "pub struct A(vi_other::Other);\n")]), other];
    let uses = all[0].uses(&all);
    let rule = |row: &str| rules(&format!("\n## Layers\n{row}\n"));
    assert_eq!(breaches(&uses, &rule("| `made-up` | |")).len(), 1);
    assert!(breaches(&uses, &rule("| `made-up` | `vi-other` |")).is_empty());
}
