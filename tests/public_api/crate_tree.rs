//! The modules of a crate with their items, and what a name in one of them refers to.

use std::collections::BTreeMap;
use std::path::Path;

use syn::{Attribute, Item, ItemMacro, UseTree, Visibility};

use crate::expand::expand;
use crate::print::text;

pub(crate) type ModulePath = Vec<String>;

/// Where an item is defined, and its name there.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Definition {
    pub(crate) module: ModulePath,
    pub(crate) name: String,
}

pub(crate) struct Use {
    pub(crate) path: Vec<String>,
    /// The name it gets here, or `*`.
    pub(crate) name: String,
    pub(crate) public: bool,
    pub(crate) condition: Vec<String>,
}

#[derive(Default)]
pub(crate) struct Module {
    pub(crate) items: Vec<Item>,
    pub(crate) uses: Vec<Use>,
    pub(crate) public: bool,
    /// Features it depends on.
    pub(crate) condition: Vec<String>,
}

pub(crate) struct Crate {
    pub(crate) modules: BTreeMap<ModulePath, Module>,
    /// Macros of all modules, for those that another module imports.
    macros: BTreeMap<String, ItemMacro>,
}

impl Crate {
    pub(crate) fn read(src: &Path) -> Self {
        let mut new = Self {
            modules: BTreeMap::new(),
            macros: BTreeMap::new(),
        };
        collect_macros(src, &mut new.macros);
        let root = parse(&src.join("lib.rs"));
        new.add(
            Vec::new(),
            root,
            Module {
                public: true,
                ..Module::default()
            },
            Some(src),
        );
        new
    }

    pub(crate) fn parse(source: &str) -> Self {
        let mut new = Self {
            modules: BTreeMap::new(),
            macros: BTreeMap::new(),
        };
        let items = syn::parse_file(source).unwrap().items;
        new.add(
            Vec::new(),
            items,
            Module {
                public: true,
                ..Module::default()
            },
            None,
        );
        new
    }

    fn add(&mut self, path: ModulePath, items: Vec<Item>, mut module: Module, folder: Option<&Path>) {
        let mut macros: BTreeMap<String, ItemMacro> = BTreeMap::new();
        for item in items {
            if for_tests(attributes(&item)) {
                continue;
            }
            match item {
                Item::Mod(child) => {
                    let name = child.ident.to_string();
                    let inner = Module {
                        public: matches!(child.vis, Visibility::Public(_)),
                        condition: [module.condition.clone(), conditions(&child.attrs)].concat(),
                        ..Module::default()
                    };
                    let folder = folder.map(|f| f.join(&name));
                    let items = match child.content {
                        Some((_, items)) => items,
                        None => {
                            let folder = folder.as_ref().expect("a module without a body has a file");
                            let file = folder.with_extension("rs");
                            parse(&if file.exists() {
                                file
                            } else {
                                folder.join("mod.rs")
                            })
                        }
                    };
                    let path = [path.clone(), vec![name]].concat();
                    self.add(path, items, inner, folder.as_deref());
                }
                Item::Use(item) => {
                    let public = matches!(item.vis, Visibility::Public(_));
                    let condition = conditions(&item.attrs);
                    flatten(&item.tree, &mut Vec::new(), &mut |path, name| {
                        let condition = condition.clone();
                        module.uses.push(Use {
                            path,
                            name,
                            public,
                            condition,
                        });
                    });
                }
                Item::Macro(item) => match &item.ident {
                    Some(name) => {
                        macros.insert(name.to_string(), item);
                    }
                    None => {
                        self.expand_items(&macros, &item.mac, &mut module.items);
                    }
                },
                Item::Impl(mut item) => {
                    let called = |i: &syn::ImplItem| matches!(i, syn::ImplItem::Macro(_));
                    if item.trait_.is_none() && item.items.iter().any(called) {
                        let mut items = Vec::new();
                        for inner in std::mem::take(&mut item.items) {
                            match inner {
                                syn::ImplItem::Macro(call) => {
                                    let body = self.expand_call(&macros, &call.mac);
                                    let block = quote::quote!(impl T { #body });
                                    items.extend(syn::parse2::<syn::ItemImpl>(block).unwrap().items);
                                }
                                other => items.push(other),
                            }
                        }
                        item.items = items;
                    }
                    module.items.push(Item::Impl(item));
                }
                other => module.items.push(other),
            }
        }
        self.modules.insert(path, module);
    }

    /// Adds the items that a call writes, those of calls in its expansion included.
    fn expand_items(&self, macros: &BTreeMap<String, ItemMacro>, call: &syn::Macro, items: &mut Vec<Item>) {
        let expanded = self.expand_call(macros, call);
        for item in syn::parse2::<syn::File>(expanded).unwrap().items {
            match item {
                Item::Macro(inner) if inner.ident.is_none() => self.expand_items(macros, &inner.mac, items),
                other => items.push(other),
            }
        }
    }

    fn expand_call(
        &self,
        macros: &BTreeMap<String, ItemMacro>,
        call: &syn::Macro,
    ) -> proc_macro2::TokenStream {
        let name = call.path.segments.last().unwrap().ident.to_string();
        if name == "thread_local" && !call.tokens.to_string().contains("pub") {
            // The one macro of the standard library that writes items, none of them public here.
            return proc_macro2::TokenStream::new();
        }
        let found = macros.get(&name).or_else(|| self.macros.get(&name));
        let rules = found.unwrap_or_else(|| panic!("{name}!: no such macro"));
        expand(rules.mac.tokens.clone(), call.tokens.clone()).unwrap_or_else(|e| panic!("{name}!: {e}"))
    }

    /// What `name` refers to in a module: an item or a module (as a definition in its parent).
    pub(crate) fn lookup(&self, module: &[String], name: &str, depth: usize) -> Option<Definition> {
        let here = self.modules.get(module)?;
        let definition = || Definition {
            module: module.to_vec(),
            name: name.to_owned(),
        };
        if here.items.iter().any(|i| item_name(i).as_deref() == Some(name))
            || self.modules.contains_key(&[module, &[name.to_owned()]].concat())
        {
            return Some(definition());
        }
        if depth > 20 {
            return None;
        }
        let named = here.uses.iter().filter(|u| u.name == name);
        let globs = here.uses.iter().filter(|u| u.name == "*");
        named
            .map(|u| u.path.clone())
            .chain(globs.map(|u| [u.path.clone(), vec![name.to_owned()]].concat()))
            .find_map(|path| self.resolve(module, &path, depth + 1))
    }

    /// What a path written in a module refers to; `None` if it leads out of the crate.
    pub(crate) fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<Definition> {
        let mut at = module.to_vec();
        let mut rest = path;
        let mut anchored = false;
        while let Some((first, others)) = rest.split_first() {
            match first.as_str() {
                "crate" => at.clear(),
                "self" => {}
                "super" => {
                    at.pop();
                }
                _ => break,
            }
            (rest, anchored) = (others, true);
        }
        let Some((last, inner)) = rest.split_last() else {
            let name = at.pop()?;
            return anchored.then_some(Definition { module: at, name });
        };
        for name in inner {
            let found = self.lookup(&at, name, depth)?;
            at = [found.module, vec![found.name]].concat();
        }
        self.lookup(&at, last, depth)
    }
}

fn parse(file: &Path) -> Vec<Item> {
    let source = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    syn::parse_file(&source)
        .unwrap_or_else(|e| panic!("{}: {e}", file.display()))
        .items
}

fn collect_macros(folder: &Path, macros: &mut BTreeMap<String, ItemMacro>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect_macros(&path, macros);
        } else if path.extension().is_some_and(|e| e == "rs") {
            for item in parse(&path) {
                if let Item::Macro(item) = item
                    && let Some(name) = &item.ident
                {
                    macros.insert(name.to_string(), item);
                }
            }
        }
    }
}

fn flatten(tree: &UseTree, path: &mut Vec<String>, found: &mut impl FnMut(Vec<String>, String)) {
    match tree {
        UseTree::Path(inner) => {
            path.push(inner.ident.to_string());
            flatten(&inner.tree, path, found);
            path.pop();
        }
        UseTree::Name(inner) if inner.ident == "self" => {
            found(path.clone(), path.last().cloned().unwrap_or_default());
        }
        UseTree::Name(inner) => {
            let name = inner.ident.to_string();
            found([path.clone(), vec![name.clone()]].concat(), name);
        }
        UseTree::Rename(inner) => {
            let whole = [path.clone(), vec![inner.ident.to_string()]].concat();
            found(whole, inner.rename.to_string());
        }
        UseTree::Glob(_) => found(path.clone(), "*".to_owned()),
        UseTree::Group(group) => group.items.iter().for_each(|t| flatten(t, path, found)),
    }
}

pub(crate) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Union(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

pub(crate) fn item_name(item: &Item) -> Option<String> {
    Some(match item {
        Item::Const(i) => i.ident.to_string(),
        Item::Enum(i) => i.ident.to_string(),
        Item::Fn(i) => i.sig.ident.to_string(),
        Item::Static(i) => i.ident.to_string(),
        Item::Struct(i) => i.ident.to_string(),
        Item::Trait(i) => i.ident.to_string(),
        Item::Type(i) => i.ident.to_string(),
        _ => return None,
    })
}

pub(crate) fn is_public(item: &Item) -> bool {
    let visibility = match item {
        Item::Const(i) => &i.vis,
        Item::Enum(i) => &i.vis,
        Item::Fn(i) => &i.vis,
        Item::Static(i) => &i.vis,
        Item::Struct(i) => &i.vis,
        Item::Trait(i) => &i.vis,
        Item::Type(i) => &i.vis,
        _ => return false,
    };
    matches!(visibility, Visibility::Public(_))
}

/// The `cfg` attributes, as written.
pub(crate) fn conditions(attributes: &[Attribute]) -> Vec<String> {
    let cfg = |a: &Attribute| match &a.meta {
        syn::Meta::List(list) if list.path.is_ident("cfg") => Some(text(&list.tokens)),
        _ => None,
    };
    attributes.iter().filter_map(cfg).collect()
}

fn for_tests(attributes: &[Attribute]) -> bool {
    conditions(attributes)
        .iter()
        .any(|c| matches!(c.as_str(), "test" | "doctest"))
}
