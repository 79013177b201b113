//! What one file of a crate defines, declares and names.

use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{
    Attribute, Expr, ExprLit, ImplItem, Item, ItemMod, ItemUse, Lit, Macro, Meta, Token, UseTree,
    Visibility,
};
use thiserror::Error;

/// Why a file is not read.
#[derive(Debug, Error)]
pub(crate) enum ReadError {
    #[error("cannot read {}: {source}", .path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{} is no Rust that is understood: {source}", .path.display())]
    Syntax { path: PathBuf, source: syn::Error },
    #[error("{}: the file of module {module} is missing", .path.display())]
    Missing { path: PathBuf, module: String },
}

/// The names of a path or of a module, outermost first.
pub(crate) type Names = Vec<String>;

/// A path of `use` or in code.
pub(crate) struct Mention {
    /// The module that has it: the file's own one, or an inline module of the file.
    pub(crate) within: Names,
    /// The path as written; the last name of a glob is `*`.
    pub(crate) path: Names,
}

/// A module in a file of its own.
pub(crate) struct Declaration {
    /// The module that declares it: the file's own one, or an inline module of the file.
    pub(crate) within: Names,
    /// Its name.
    pub(crate) name: String,
    /// The value of its attribute `path`.
    pub(crate) path: Option<String>,
}

/// What one file defines, declares and names outside of tests.
pub(crate) struct SourceFile {
    /// The file's own module; empty for the crate's root.
    pub(crate) module: Names,
    /// Names of the items that it defines.
    pub(crate) items: BTreeSet<String>,
    /// Names that it imports or re-exports, with their paths.
    pub(crate) imported: BTreeMap<String, Names>,
    /// The modules of `use module::*`.
    pub(crate) globs: Vec<Names>,
    /// All paths that it has, those of `use` included.
    pub(crate) mentions: Vec<Mention>,
    /// Modules in files of their own.
    pub(crate) declarations: Vec<Declaration>,
}

impl SourceFile {
    /// Reads the file at `path`, which is the module `module`.
    ///
    /// # Errors
    /// [`ReadError::Unreadable`], [`ReadError::Syntax`].
    pub(crate) fn read(path: &Path, module: &[String]) -> Result<Self, ReadError> {
        let text = fs::read_to_string(path).map_err(|source| ReadError::Unreadable {
            path: path.into(),
            source,
        })?;
        let parsed = syn::parse_file(&text).map_err(|source| ReadError::Syntax {
            path: path.into(),
            source,
        })?;
        let mut reader = Reader {
            file: Self {
                module: module.to_vec(),
                items: BTreeSet::new(),
                imported: BTreeMap::new(),
                globs: Vec::new(),
                mentions: Vec::new(),
                declarations: Vec::new(),
            },
            within: module.to_vec(),
            bodies: 0,
        };
        reader.visit_file(&parsed);
        Ok(reader.file)
    }
}

/// Walks through a file and notes what it finds.
struct Reader {
    file: SourceFile,
    /// The module under way.
    within: Names,
    /// Items that are open around the place under way, modules apart.
    bodies: usize,
}

impl Reader {
    fn mention(&mut self, path: Names) {
        let within = self.within.clone();
        self.file.mentions.push(Mention { within, path });
    }

    /// Notes the paths of a use tree that begin with `prefix`.
    fn note_use(&mut self, tree: &UseTree, prefix: &[String]) {
        let joined = |name: &syn::Ident| [prefix, &[name.to_string()]].concat();
        match tree {
            UseTree::Path(inner) => self.note_use(&inner.tree, &joined(&inner.ident)),
            UseTree::Group(group) => {
                for inner in &group.items {
                    self.note_use(inner, prefix);
                }
            }
            UseTree::Glob(_) => {
                if self.is_at_module_level() {
                    self.file.globs.push(prefix.to_vec());
                }
                self.mention([prefix, &["*".to_owned()]].concat());
            }
            UseTree::Name(last) if last.ident == "self" => {
                let name = prefix.last().cloned().unwrap_or_default();
                self.note_import(name, prefix.to_vec());
            }
            UseTree::Name(last) => self.note_import(last.ident.to_string(), joined(&last.ident)),
            UseTree::Rename(last) if last.ident == "self" => {
                self.note_import(last.rename.to_string(), prefix.to_vec());
            }
            UseTree::Rename(last) => self.note_import(last.rename.to_string(), joined(&last.ident)),
        }
    }

    fn note_import(&mut self, name: String, path: Names) {
        if self.is_at_module_level() {
            self.file.imported.insert(name, path.clone());
        }
        self.mention(path);
    }

    /// Whether the place under way is in the file's own module, and in no item of it.
    fn is_at_module_level(&self) -> bool {
        self.bodies == 0 && self.within == self.file.module
    }

    /// Notes the paths among the tokens of a macro, whose grammar is its own.
    fn note_tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut colons) = (Names::new(), 0);
        for tree in tokens {
            match tree {
                TokenTree::Punct(mark) if mark.as_char() == ':' => {
                    colons += 1;
                    continue;
                }
                TokenTree::Ident(name) if colons == 2 && !path.is_empty() => {
                    path.push(name.to_string());
                }
                TokenTree::Ident(name) => {
                    self.note_path(std::mem::replace(&mut path, vec![name.to_string()]));
                }
                TokenTree::Group(group) => {
                    self.note_path(std::mem::take(&mut path));
                    self.note_tokens(group.stream());
                }
                TokenTree::Punct(_) | TokenTree::Literal(_) => {
                    self.note_path(std::mem::take(&mut path));
                }
            }
            colons = 0;
        }
        self.note_path(path);
    }

    /// Notes a path in code; a single name says nothing of a module.
    fn note_path(&mut self, path: Names) {
        if path.len() > 1 {
            self.mention(path);
        }
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast Item) {
        if attributes_of(item).iter().any(is_for_tests_alone) {
            return;
        }
        if self.bodies == 0 {
            self.file.items.extend(name_of(item));
        }
        let is_module = matches!(item, Item::Mod(_) | Item::Use(_));
        self.bodies += usize::from(!is_module);
        visit::visit_item(self, item);
        self.bodies -= usize::from(!is_module);
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        let attributes: &[Attribute] = match item {
            ImplItem::Const(item) => &item.attrs,
            ImplItem::Fn(item) => &item.attrs,
            ImplItem::Type(item) => &item.attrs,
            _ => &[],
        };
        if !attributes.iter().any(is_for_tests_alone) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, module: &'ast ItemMod) {
        let name = module.ident.to_string();
        if let Some((_, items)) = &module.content {
            self.within.push(name);
            for item in items {
                self.visit_item(item);
            }
            self.within.pop();
        } else {
            let path = module.attrs.iter().find_map(path_attribute);
            let within = self.within.clone();
            self.file
                .declarations
                .push(Declaration { within, name, path });
        }
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.note_use(&item.tree, &[]);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.note_path(
            path.segments
                .iter()
                .map(|segment| segment.ident.to_string())
                .collect(),
        );
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, invocation: &'ast Macro) {
        self.visit_path(&invocation.path);
        self.note_tokens(invocation.tokens.clone());
    }

    fn visit_attribute(&mut self, _: &'ast Attribute) {}

    fn visit_visibility(&mut self, _: &'ast Visibility) {}
}

/// The name that an item defines in its module.
fn name_of(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::TraitAlias(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        _ => return None,
    };
    Some(name.to_string())
}

fn attributes_of(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::ForeignMod(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::TraitAlias(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

/// Whether an attribute is a `cfg` that holds in tests only.
fn is_for_tests_alone(attribute: &Attribute) -> bool {
    attribute.path().is_ident("cfg")
        && attribute
            .parse_args::<Meta>()
            .is_ok_and(|condition| needs_test(&condition))
}

fn needs_test(condition: &Meta) -> bool {
    match condition {
        Meta::Path(path) => path.is_ident("test"),
        Meta::List(list) if list.path.is_ident("all") => list
            .parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated)
            .is_ok_and(|all| all.iter().any(needs_test)),
        _ => false,
    }
}

/// The file that an attribute `path` names.
fn path_attribute(attribute: &Attribute) -> Option<String> {
    match &attribute.meta {
        Meta::NameValue(pair) if pair.path.is_ident("path") => match &pair.value {
            Expr::Lit(ExprLit {
                lit: Lit::Str(text),
                ..
            }) => Some(text.value()),
            _ => None,
        },
        _ => None,
    }
}
