//! The files of a crate, and which of them imports from which.

use crate::source_file::{Declaration, Names, ReadError, SourceFile};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The files of a crate by their modules.
pub(crate) struct CrateFiles {
    files: BTreeMap<Names, SourceFile>,
}

/// For each file of a crate, those that it imports from.
pub(crate) struct Imports {
    /// The files' modules, as paths.
    pub(crate) modules: Vec<String>,
    /// For each file, by the number of another one, the paths that end there.
    pub(crate) of_file: Vec<BTreeMap<usize, BTreeSet<String>>>,
}

impl Imports {
    /// For each file, the numbers of those that it imports from.
    pub(crate) fn targets(&self) -> Vec<Vec<usize>> {
        self.of_file
            .iter()
            .map(|imports| imports.keys().copied().collect())
            .collect()
    }
}

/// A file of a crate on disk.
struct Place {
    path: PathBuf,
    module: Names,
    /// Where the files of its child modules lie.
    children: PathBuf,
}

impl CrateFiles {
    /// Reads the files of the crate with the root file `root`, without those that are compiled for tests alone.
    ///
    /// # Errors
    /// [`ReadError`], naming the file.
    pub(crate) fn read(root: &Path) -> Result<Self, ReadError> {
        let mut files = BTreeMap::new();
        let mut open = vec![Place {
            path: root.into(),
            module: Names::new(),
            children: folder_of(root),
        }];
        while let Some(place) = open.pop() {
            let file = SourceFile::read(&place.path, &place.module)?;
            for declaration in &file.declarations {
                open.push(place.child(declaration)?);
            }
            files.insert(place.module, file);
        }
        Ok(Self { files })
    }

    /// For each file those that it imports from, with the paths that do.
    pub(crate) fn imports(&self) -> Imports {
        let numbers: BTreeMap<&Names, usize> = self.files.keys().zip(0..).collect();
        let of_file = self.files.iter().map(|(module, file)| {
            let mut found: BTreeMap<usize, BTreeSet<String>> = BTreeMap::new();
            for mention in &file.mentions {
                match self.end_of(&mention.within, &mention.path, &mut Vec::new()) {
                    Some(end) if end.module != *module => {
                        found
                            .entry(numbers[&end.module])
                            .or_default()
                            .insert(mention.path.join("::"));
                    }
                    _ => {}
                }
            }
            found
        });
        let name = |module: &Names| match module.as_slice() {
            [] => "the root".to_owned(),
            names => names.join("::"),
        };
        Imports {
            modules: self.files.keys().map(name).collect(),
            of_file: of_file.collect(),
        }
    }

    /// The file that defines what `path` names in the module `within`; `None` where another crate does. `seen` are the questions that
    /// this one comes from: re-exports can name each other in a circle.
    fn end_of(
        &self,
        within: &[String],
        path: &[String],
        seen: &mut Vec<(Names, Names)>,
    ) -> Option<&SourceFile> {
        let question = (within.to_vec(), path.to_vec());
        if path.is_empty() || seen.contains(&question) {
            return None;
        }
        seen.push(question);
        let (mut module, mut rest) = begin_of(within, path);
        if rest.len() == path.len() && !self.files.contains_key(&joined(&module, &rest[0])) {
            let file = self.file_of(within);
            let import = file
                .imported
                .get(&path[0])
                .filter(|import| import[0] != path[0])?;
            return self.end_of(&file.module, &[import, &path[1..]].concat(), seen);
        }
        while let Some(name) = rest.first()
            && self.files.contains_key(&joined(&module, name))
        {
            module.push(name.clone());
            rest = &rest[1..];
        }
        let file = self.file_of(&module);
        Some(self.definer_of(file, rest, seen).unwrap_or(file))
    }

    /// The file that a file's imports and re-exports lead to for `rest`, the names behind its module; `None` where they do not.
    fn definer_of(
        &self,
        file: &SourceFile,
        rest: &[String],
        seen: &mut Vec<(Names, Names)>,
    ) -> Option<&SourceFile> {
        let (name, behind) = rest.split_first()?;
        if file.items.contains(name) {
            return None;
        }
        if let Some(import) = file.imported.get(name) {
            return self.end_of(&file.module, &[import, behind].concat(), seen);
        }
        file.globs.iter().find_map(|glob| {
            let end = self.end_of(&file.module, &[glob, rest].concat(), seen)?;
            end.items.contains(name).then_some(end)
        })
    }

    /// The file of a module: its own one, or the one with the inline module.
    fn file_of(&self, module: &[String]) -> &SourceFile {
        let depths = (0..=module.len()).rev();
        let mut files = depths.filter_map(|depth| self.files.get(&module[..depth]));
        files.next().expect("the root is a file of each crate")
    }
}

impl Place {
    /// Where the file of a child module lies.
    fn child(&self, declaration: &Declaration) -> Result<Self, ReadError> {
        let Declaration { within, name, path } = declaration;
        let module = joined(within, name);
        if let Some(path) = path {
            let path = folder_of(&self.path).join(path);
            let children = folder_of(&path);
            return Ok(Self {
                path,
                module,
                children,
            });
        }
        let inline = &within[self.module.len()..];
        let folder = inline
            .iter()
            .fold(self.children.clone(), |folder, name| folder.join(name));
        let children = folder.join(name);
        let candidates = [folder.join(format!("{name}.rs")), children.join("mod.rs")];
        match candidates.into_iter().find(|path| path.exists()) {
            Some(path) => Ok(Self {
                path,
                module,
                children,
            }),
            None => Err(ReadError::Missing {
                path: self.path.clone(),
                module: module.join("::"),
            }),
        }
    }
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().map(Path::to_path_buf).unwrap_or_default()
}

fn joined(module: &[String], name: &str) -> Names {
    [module, &[name.to_owned()]].concat()
}

/// The module that a path begins in, and its names behind `crate`, `self` and `super`.
fn begin_of<'a>(within: &[String], path: &'a [String]) -> (Names, &'a [String]) {
    let (mut module, mut rest) = (within.to_vec(), path);
    while let [first, behind @ ..] = rest {
        match first.as_str() {
            "crate" => module.clear(),
            "super" => drop(module.pop()),
            "self" => {}
            _ => break,
        }
        rest = behind;
    }
    (module, rest)
}

#[cfg(test)]
mod tests {
    use super::CrateFiles;
    use crate::circles::circles;
    use std::fs;

    /// How many files are in circles of a crate with these files, named by their modules.
    fn in_circles(files: &[(&str, &str)]) -> usize {
        let folder = tempfile::tempdir().unwrap();
        let children = files
            .iter()
            .filter(|(name, _)| !name.contains('/') && *name != "lib");
        let modules: String = children.map(|(name, _)| format!("mod {name};")).collect();
        fs::write(folder.path().join("lib.rs"), &modules).unwrap();
        for (name, text) in files {
            let path = folder.path().join(format!("{name}.rs"));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            let begin = if *name == "lib" { modules.as_str() } else { "" };
            fs::write(path, format!("{begin}{text}")).unwrap();
        }
        let read = CrateFiles::read(&folder.path().join("lib.rs")).unwrap();
        circles(&read.imports().targets())
            .iter()
            .map(Vec::len)
            .sum()
    }

    #[test]
    fn files_that_import_each_other_are_a_circle() {
        let [a, b] = [
            "use crate::b::B; pub struct A;",
            "use crate::a::A; pub struct B;",
        ];
        assert_eq!(in_circles(&[("a", a), ("b", b)]), 2);
        let a = "use crate::{b::B, c}; pub struct A;";
        let [b, c] = [
            "use crate::c::C; pub struct B;",
            "use super::a::A as X; pub struct C;",
        ];
        assert_eq!(in_circles(&[("a", a), ("b", b), ("c", c)]), 3);
        let [a, child] = [
            "mod c; use c::C; pub struct A;",
            "use super::A; pub struct C;",
        ];
        assert_eq!(in_circles(&[("a", a), ("a/c", child)]), 2);
    }

    #[test]
    fn a_path_in_code_is_an_import() {
        let b = "pub fn b() { super::a::a() }";
        assert_eq!(
            in_circles(&[("a", "pub fn a() { crate::b::b() }"), ("b", b)]),
            2
        );
        let a = "pub fn a() { assert!([1].len() == crate::b::b()) }";
        assert_eq!(in_circles(&[("a", a), ("b", b)]), 2);
        let a = "use crate::b as other; pub fn a() { other::b() }";
        assert_eq!(in_circles(&[("a", a), ("b", b)]), 2);
        let a = "pub fn a() -> Vec<crate::b::B> { Vec::new() }";
        assert_eq!(in_circles(&[("a", a), ("b", b)]), 2);
    }

    #[test]
    fn a_re_export_and_a_glob_are_followed_to_the_definition() {
        let files = [
            ("lib", "pub use a::A; pub use b::B;"),
            ("a", "use crate::B; pub struct A;"),
            ("b", "use crate::A; pub struct B;"),
        ];
        assert_eq!(in_circles(&files), 2);
        let one_way = [files[0], files[1], ("b", "pub struct B;")];
        assert_eq!(in_circles(&one_way), 0);
        let a = "use crate::b::*; pub struct A; impl A { fn f(_: B) {} }";
        assert_eq!(
            in_circles(&[("a", a), ("b", "use crate::a::A; pub struct B;")]),
            2
        );
        let globs = [
            ("lib", "pub use a::*; pub use b::*;"),
            files[1],
            ("b", "pub struct B;"),
        ];
        assert_eq!(in_circles(&globs), 0);
    }

    #[test]
    fn what_is_compiled_for_tests_alone_is_no_import() {
        let a = ("a", "use crate::b::B; pub struct A;");
        let b = "pub struct B; #[cfg(test)] mod tests { use crate::a::A; }";
        assert_eq!(in_circles(&[a, ("b", b)]), 0);
        let b = "pub struct B; impl B { #[cfg(all(test, unix))] fn a() { crate::a::a() } }";
        assert_eq!(in_circles(&[a, ("b", b)]), 0);
        let b = "pub struct B; #[cfg(not(test))] use crate::a::A;";
        assert_eq!(in_circles(&[a, ("b", b)]), 2);
    }

    #[test]
    fn comments_strings_attributes_and_visibilities_are_no_imports() {
        let a = ("a", "use crate::b::B; pub struct A;");
        let b = "/* crate::a::A */ // crate::a::A\n/// [`crate::a::A`]\n#[expect(crate::a::A)]\npub(in crate::a) struct B;
            const S: &str = \"crate::a::A\";";
        assert_eq!(in_circles(&[a, ("b", b)]), 0);
    }
}
