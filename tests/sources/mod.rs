//! Reads the imports of Rust sources without a compiler: modules, definitions, `use` lines and paths.
#![allow(unreachable_pub, reason = "a module of a test")]

mod tokens;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use tokens::{Item, items};

/// A module, as names from the root of its crate: `schemes/gauss.rs` is ["schemes", "gauss"], `lib.rs` is [].
pub type Module = Vec<String>;

/// The sources of a crate.
#[derive(Default)]
pub struct Crate {
    pub name: String,
    files: BTreeMap<Module, File>,
}

#[derive(Default)]
struct File {
    path: String,
    definitions: BTreeSet<String>,
    /// Names brought in by `use`, re-exports included, with the paths that they stand for.
    names: BTreeMap<String, Vec<String>>,
    /// Paths of glob imports, `use path::*`.
    globs: Vec<Vec<String>>,
    /// Paths of imports and other paths, without re-exports.
    paths: Vec<Vec<String>>,
}

/// The use, in one file, of a name that another file defines.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Use {
    /// `crate-name/path/of/file.rs`.
    pub from: String,
    pub to: String,
    /// The path as written.
    pub path: String,
    /// Whether the path reaches the name through a re-export of the crate's root.
    pub through_root: bool,
}

impl Crate {
    /// Makes a crate from its files, each a pair (path below `src/`, text).
    pub fn new(name: &str, sources: &[(String, String)]) -> Self {
        let mut files = BTreeMap::new();
        let mut tests = Vec::new();
        for (path, text) in sources {
            let module = module_of(path);
            let mut file = File { path: format!("{name}/{path}"), ..File::default() };
            for item in items(text) {
                match item {
                    Item::Definition(name) => drop(file.definitions.insert(name)),
                    Item::TestModule(name) => tests.push([&module[..], &[name]].concat()),
                    Item::Use { path, name, is_public } => {
                        if name == "*" {
                            file.globs.push(path.clone());
                        } else {
                            file.names.insert(name, path.clone());
                        }
                        if !is_public {
                            file.paths.push(path);
                        }
                    }
                    Item::Path(path) => file.paths.push(path),
                }
            }
            files.insert(module, file);
        }
        files.retain(|module, _| !tests.iter().any(|test| module.starts_with(test)));
        Self { name: name.to_owned(), files }
    }

    /// Reads the crate whose sources are in `folder`.
    pub fn read(name: &str, folder: &Path) -> Self {
        let mut sources = Vec::new();
        collect(folder, folder, &mut sources);
        assert!(!sources.is_empty(), "no sources in {}", folder.display());
        Self::new(name, &sources)
    }

    /// Returns the module that defines what `path` names in `module` of this crate, and the crate that it belongs to:
    /// this one or another of `all`.
    fn resolve<'a>(
        &'a self,
        all: &'a [Crate],
        module: &Module,
        path: &[String],
    ) -> Option<(&'a Crate, Module)> {
        self.resolve_within(all, module, path, 0)
    }

    fn resolve_within<'a>(
        &'a self,
        all: &'a [Crate],
        module: &Module,
        path: &[String],
        depth: usize,
    ) -> Option<(&'a Crate, Module)> {
        if depth > 8 {
            return None;
        }
        let (first, rest) = path.split_first()?;
        let child = [&module[..], std::slice::from_ref(first)].concat();
        let absolute: Vec<String> = match first.as_str() {
            "crate" => rest.to_vec(),
            "self" => [&module[..], rest].concat(),
            "super" => {
                let up = path.iter().take_while(|name| *name == "super").count();
                [&module[..module.len().saturating_sub(up)], &path[up..]].concat()
            }
            _ if self.files.contains_key(&child) => [&module[..], path].concat(),
            _ => {
                if let Some(other) = all.iter().find(|other| other.name.replace('-', "_") == *first) {
                    return other.find(all, rest, depth);
                }
                // Resolves a module or type under the name that an import gave it.
                let brought = self.files.get(module)?.names.get(first)?;
                if rest.is_empty() || brought == path {
                    return None;
                }
                let whole = [&brought[..], rest].concat();
                return self.resolve_within(all, module, &whole, depth + 1);
            }
        };
        self.find(all, &absolute, depth)
    }

    /// Returns the module that defines what an absolute path names.
    fn find<'a>(&'a self, all: &'a [Crate], path: &[String], depth: usize) -> Option<(&'a Crate, Module)> {
        let length = (0..=path.len()).rev().find(|&length| self.files.contains_key(&path[..length]))?;
        let (module, rest) = (path[..length].to_vec(), &path[length..]);
        let file = &self.files[&module];
        let Some(name) = rest.first() else { return Some((self, module)) };
        if !file.definitions.contains(name) {
            if let Some(brought) = file.names.get(name) {
                return self.resolve_within(all, &module, brought, depth + 1);
            }
            for glob in &file.globs {
                let found = self.resolve_within(all, &module, glob, depth + 1);
                if let Some((other, inner)) = found
                    && let file = &other.files[&inner]
                    && (file.definitions.contains(name) || file.names.contains_key(name))
                {
                    return other.find(all, &[&inner[..], rest].concat(), depth + 1);
                }
            }
        }
        Some((self, module))
    }

    /// Returns every use of a name that another file of `all` defines. The declaration of a module is not a use, nor is
    /// a re-export.
    pub fn uses(&self, all: &[Crate]) -> Vec<Use> {
        let mut uses = BTreeSet::new();
        for (module, file) in &self.files {
            for path in &file.paths {
                let Some((other, target)) = self.resolve(all, module, path) else { continue };
                let to = &other.files[&target].path;
                if *to == file.path {
                    continue;
                }
                let is_root_name = path.len() >= 2 && path[0] == "crate" && {
                    let root = &self.files[&Module::new()];
                    root.names.contains_key(&path[1]) && !self.files.contains_key(&path[1..2])
                };
                uses.insert(Use {
                    from: file.path.clone(),
                    to: to.clone(),
                    path: path.join("::"),
                    through_root: is_root_name && other.name == self.name,
                });
            }
        }
        uses.into_iter().collect()
    }
}

fn module_of(path: &str) -> Module {
    let stem = path.trim_end_matches(".rs").trim_end_matches("/mod");
    if stem == "lib" { Vec::new() } else { stem.split('/').map(str::to_owned).collect() }
}

fn collect(root: &Path, folder: &Path, out: &mut Vec<(String, String)>) {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            collect(root, &path, out);
        } else if path.extension().is_some_and(|end| end == "rs") && path != root.join("main.rs") {
            let name = path.strip_prefix(root).expect("below the root").to_string_lossy().replace('\\', "/");
            out.push((name, std::fs::read_to_string(&path).expect("text")));
        }
    }
}
