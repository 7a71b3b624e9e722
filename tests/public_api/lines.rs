//! One line per public item.

use std::collections::{BTreeMap, BTreeSet};

use quote::ToTokens;
use syn::{
    Attribute, Fields, GenericParam, Generics, ImplItem, Item, Signature, TraitItem, Type, Visibility,
};

use crate::crate_tree::{Crate, Definition, ModulePath, attributes, conditions, is_public, item_name};
use crate::print::text;

/// A public path and the features it depends on.
type Reached = (Vec<String>, Vec<String>);

pub(crate) fn all(krate: &Crate) -> BTreeSet<String> {
    let mut walk = Walk {
        krate,
        lines: BTreeSet::new(),
        reached: BTreeMap::new(),
        seen: BTreeSet::new(),
    };
    walk.module(&Vec::new(), &[], &[]);
    walk.items();
    walk.impls();
    walk.lines
}

struct Walk<'c> {
    krate: &'c Crate,
    lines: BTreeSet<String>,
    /// The public paths of each definition.
    reached: BTreeMap<Definition, Vec<Reached>>,
    seen: BTreeSet<(ModulePath, Vec<String>)>,
}

impl Walk<'_> {
    fn module(&mut self, module: &ModulePath, public: &[String], condition: &[String]) {
        if !self.seen.insert((module.clone(), public.to_vec())) {
            return;
        }
        let krate = self.krate;
        let here = &krate.modules[module];
        if !public.is_empty() {
            self.line(&public.join("::"), condition, "mod");
        }
        for item in here.items.iter().filter(|i| is_public(i)) {
            let name = item_name(item).expect("public items have names");
            self.reach(module, &name, public, &name, condition);
        }
        for (path, child) in &krate.modules {
            if path.split_last().is_some_and(|(_, parent)| parent == module) && child.public {
                let name = &path[path.len() - 1];
                self.module(
                    path,
                    &[public, std::slice::from_ref(name)].concat(),
                    &child.condition,
                );
            }
        }
        for import in here.uses.iter().filter(|u| u.public) {
            let condition = [condition, &import.condition].concat();
            let target = krate.resolve(module, &import.path, 0);
            let Some(Definition { module: of, name }) = target else {
                let line = format!("use {}", import.path.join("::"));
                self.line(
                    &[public, std::slice::from_ref(&import.name)].concat().join("::"),
                    &condition,
                    &line,
                );
                continue;
            };
            let as_module = [of.clone(), vec![name.clone()]].concat();
            match (krate.modules.contains_key(&as_module), import.name.as_str()) {
                (true, "*") => {
                    let inner = &krate.modules[&as_module];
                    let items = inner.items.iter().filter(|i| is_public(i)).filter_map(item_name);
                    let uses = inner.uses.iter().filter(|u| u.public).map(|u| u.name.clone());
                    for name in items.chain(uses).collect::<BTreeSet<_>>() {
                        if let Some(d) = krate.lookup(&as_module, &name, 0) {
                            self.reach(&d.module, &d.name, public, &name, &condition);
                        }
                    }
                }
                (true, alias) => self.module(&as_module, &[public, &[alias.to_owned()]].concat(), &condition),
                (false, alias) => self.reach(&of, &name, public, alias, &condition),
            }
        }
    }

    fn reach(
        &mut self,
        module: &ModulePath,
        name: &str,
        public: &[String],
        alias: &str,
        condition: &[String],
    ) {
        let definition = Definition {
            module: module.clone(),
            name: name.to_owned(),
        };
        let path = [public, &[alias.to_owned()]].concat();
        self.reached
            .entry(definition)
            .or_default()
            .push((path, condition.to_vec()));
    }

    fn line(&mut self, path: &str, condition: &[String], line: &str) {
        let condition: String = condition
            .iter()
            .collect::<BTreeSet<_>>()
            .iter()
            .map(|c| format!("[{c}] "))
            .collect();
        self.lines.insert(format!("{path}: {condition}{line}"));
    }

    /// The path under which a public definition is listed.
    fn canonical(&self, definition: &Definition) -> Option<&Reached> {
        let rank = |(path, _): &&Reached| (path[0] == "prelude", path.len(), path.clone());
        self.reached.get(definition)?.iter().min_by_key(rank)
    }

    fn items(&mut self) {
        for (definition, paths) in self.reached.clone() {
            let (path, condition) = self.canonical(&definition).cloned().expect("it is reached");
            for (other, condition) in paths.iter().filter(|(p, _)| *p != path) {
                self.line(&other.join("::"), condition, &format!("use {}", path.join("::")));
            }
            let krate = self.krate;
            let items = &krate.modules[&definition.module].items;
            let named =
                |i: &&Item| item_name(i).as_deref() == Some(&definition.name) && !matches!(i, Item::Impl(_));
            for item in items.iter().filter(named) {
                let condition = [condition.clone(), conditions(attributes(item))].concat();
                self.item(&path.join("::"), &condition, item);
            }
        }
    }

    fn item(&mut self, path: &str, condition: &[String], item: &Item) {
        let marks = marks(attributes(item));
        match item {
            Item::Fn(item) => self.line(path, condition, &(marks + &signature(&item.sig))),
            Item::Const(item) => {
                let line = format!("{marks}const {}: {}", item.ident, text(&item.ty));
                self.line(path, condition, &line);
            }
            Item::Static(item) => {
                let line = format!("{marks}static {}: {}", item.ident, text(&item.ty));
                self.line(path, condition, &line);
            }
            Item::Type(item) => {
                let generics = text(&item.generics);
                let line = format!("{marks}type {}{generics} = {}", item.ident, text(&item.ty));
                self.line(path, condition, &line);
            }
            Item::Struct(item) => {
                let public = |f: &&syn::Field| matches!(f.vis, Visibility::Public(_));
                let hidden = item.fields.iter().filter(public).count() < item.fields.len();
                let rest = if hidden { " { .. }" } else { "" };
                let line = format!("{marks}struct {}{}{rest}", item.ident, generics(&item.generics));
                self.line(path, condition, &line);
                for (i, field) in item.fields.iter().enumerate().filter(|(_, f)| public(f)) {
                    let name = field.ident.as_ref().map_or(i.to_string(), ToString::to_string);
                    let condition = [condition, &conditions(&field.attrs)].concat();
                    let line = format!("{}{}", self::marks(&field.attrs), text(&field.ty));
                    self.line(&format!("{path}.{name}"), &condition, &line);
                }
                self.derives(path, condition, &item.attrs);
                self.conversions(path, condition, &item.ident.to_string(), &item.fields);
            }
            Item::Enum(item) => {
                let line = format!("{marks}enum {}{}", item.ident, generics(&item.generics));
                self.line(path, condition, &line);
                for variant in &item.variants {
                    let condition = [condition, &conditions(&variant.attrs)].concat();
                    let field = |f: &syn::Field| match &f.ident {
                        Some(name) => format!("{}{name}: {}", self::marks(&f.attrs), text(&f.ty)),
                        None => text(&f.ty),
                    };
                    let fields: Vec<String> = variant.fields.iter().map(field).collect();
                    let fields = match &variant.fields {
                        Fields::Named(_) => format!(" {{ {} }}", fields.join(", ")),
                        Fields::Unnamed(_) => format!(" ({})", fields.join(", ")),
                        Fields::Unit => String::new(),
                    };
                    let line = format!("{}variant{fields}", self::marks(&variant.attrs));
                    self.line(&format!("{path}::{}", variant.ident), &condition, &line);
                    self.conversions(path, &condition, &item.ident.to_string(), &variant.fields);
                }
                self.derives(path, condition, &item.attrs);
            }
            Item::Trait(item) => {
                let bounds = match text(&item.supertraits) {
                    bounds if bounds.is_empty() => bounds,
                    bounds => format!(": {bounds}"),
                };
                let line = format!("{marks}trait {}{}{bounds}", item.ident, generics(&item.generics));
                self.line(path, condition, &line);
                for inner in &item.items {
                    let (name, line) = match inner {
                        TraitItem::Fn(f) => {
                            let provided = if f.default.is_some() { "provided " } else { "" };
                            let line = format!("{}{provided}{}", self::marks(&f.attrs), signature(&f.sig));
                            (f.sig.ident.to_string(), line)
                        }
                        TraitItem::Const(c) => {
                            (c.ident.to_string(), format!("const {}: {}", c.ident, text(&c.ty)))
                        }
                        TraitItem::Type(t) => {
                            let bounds = text(&t.bounds);
                            (t.ident.to_string(), format!("type {} {bounds}", t.ident))
                        }
                        other => ("?".to_owned(), text(other)),
                    };
                    self.line(&format!("{path}::{name}"), condition, &line);
                }
            }
            other => panic!("{path}: an item of unknown kind: {}", text(other)),
        }
    }

    fn derives(&mut self, path: &str, condition: &[String], attributes: &[Attribute]) {
        for (extra, meta) in flat_attributes(attributes) {
            let syn::Meta::List(list) = &meta else { continue };
            if !list.path.is_ident("derive") {
                continue;
            }
            let condition: Vec<String> = condition.iter().cloned().chain(extra).collect();
            for name in text(&list.tokens).split(", ") {
                self.line(
                    path,
                    &condition,
                    &format!("#[derive] impl {}", name.trim_end_matches(',')),
                );
            }
        }
    }

    /// `#[from]` of thiserror.
    fn conversions(&mut self, path: &str, condition: &[String], name: &str, fields: &Fields) {
        for field in fields {
            if field.attrs.iter().any(|a| a.path().is_ident("from")) {
                self.line(
                    path,
                    condition,
                    &format!("impl From<{}> for {name}", text(&field.ty)),
                );
            }
        }
    }

    fn impls(&mut self) {
        let krate = self.krate;
        for (module, content) in &krate.modules {
            for item in &content.items {
                let Item::Impl(item) = item else { continue };
                let of = self.listed(module, &item.generics, &item.self_ty);
                let condition = [content.condition.clone(), conditions(&item.attrs)].concat();
                let with = |reached: &Reached| [condition.clone(), reached.1.clone()].concat();
                match (&item.trait_, of) {
                    (None, Subject::Public(reached)) => {
                        let condition = with(&reached);
                        let path = reached.0.join("::");
                        let bound = match item
                            .generics
                            .params
                            .iter()
                            .any(|p| matches!(p, GenericParam::Type(_)))
                        {
                            true => format!("impl{} {}: ", text(&item.generics), text(&item.self_ty)),
                            false => String::new(),
                        };
                        for inner in &item.items {
                            self.inherent(&path, &condition, &bound, inner);
                        }
                    }
                    (Some((trait_path, _)), subject) => {
                        let trait_path_names = path_names(trait_path);
                        let of_trait = krate.resolve(module, &trait_path_names, 0);
                        let public_trait = of_trait.as_ref().map(|d| self.canonical(d).cloned());
                        let under = match (subject, public_trait) {
                            (Subject::Private, _) | (_, Some(None)) => continue,
                            (Subject::Public(reached), _) | (Subject::Foreign, Some(Some(reached))) => {
                                reached
                            }
                            (Subject::Foreign, None) => (vec!["impl".to_owned()], Vec::new()),
                        };
                        let clause = item.generics.where_clause.as_ref();
                        let clause = clause.map_or(String::new(), |w| format!(" {}", text(w)));
                        let line = format!(
                            "impl{} {} for {}{clause}",
                            text(&item.generics),
                            text(trait_path),
                            text(&item.self_ty)
                        );
                        let path = under.0.join("::");
                        let condition = with(&under);
                        self.line(&path, &condition, &line);
                        for inner in &item.items {
                            if let ImplItem::Type(t) = inner {
                                let line = format!("{line} {{ type {} = {} }}", t.ident, text(&t.ty));
                                self.line(&path, &condition, &line);
                            }
                        }
                    }
                    _ => {}
                }
            }
        }
    }

    fn inherent(&mut self, path: &str, condition: &[String], bound: &str, item: &ImplItem) {
        let (visibility, attributes, name, line) = match item {
            ImplItem::Fn(f) => (&f.vis, &f.attrs, f.sig.ident.to_string(), signature(&f.sig)),
            ImplItem::Const(c) => (
                &c.vis,
                &c.attrs,
                c.ident.to_string(),
                format!("const {}: {}", c.ident, text(&c.ty)),
            ),
            other => panic!("{path}: an item of unknown kind: {}", text(other)),
        };
        if matches!(visibility, Visibility::Public(_)) {
            let condition = [condition, &conditions(attributes)].concat();
            self.line(
                &format!("{path}::{name}"),
                &condition,
                &format!("{bound}{}{line}", marks(attributes)),
            );
        }
    }

    /// Whether the type of an impl is public, private, or not of this crate.
    fn listed(&self, module: &ModulePath, generics: &Generics, ty: &Type) -> Subject {
        match ty {
            Type::Reference(inner) => self.listed(module, generics, &inner.elem),
            Type::Path(path) => {
                let names = path_names(&path.path);
                let parameter =
                    |p: &GenericParam| matches!(p, GenericParam::Type(t) if names == [t.ident.to_string()]);
                if generics.params.iter().any(parameter) {
                    return Subject::Foreign;
                }
                match self.krate.resolve(module, &names, 0) {
                    None => Subject::Foreign,
                    Some(d) => self
                        .canonical(&d)
                        .cloned()
                        .map_or(Subject::Private, Subject::Public),
                }
            }
            _ => Subject::Foreign,
        }
    }
}

enum Subject {
    Public(Reached),
    Private,
    Foreign,
}

fn path_names(path: &syn::Path) -> Vec<String> {
    path.segments.iter().map(|s| s.ident.to_string()).collect()
}

fn generics(g: &Generics) -> String {
    let clause = g
        .where_clause
        .as_ref()
        .map_or(String::new(), |w| format!(" {}", text(w)));
    format!("{}{clause}", text(g))
}

fn signature(signature: &Signature) -> String {
    let mut signature = signature.clone();
    for input in &mut signature.inputs {
        if let syn::FnArg::Typed(typed) = input
            && let syn::Pat::Ident(name) = &mut *typed.pat
        {
            (name.mutability, name.by_ref) = (None, None);
        }
    }
    text(&signature)
}

/// Attributes with those of `cfg_attr`, and the condition of the latter.
fn flat_attributes(attributes: &[Attribute]) -> Vec<(Option<String>, syn::Meta)> {
    let mut out = Vec::new();
    for attribute in attributes {
        if attribute.path().is_ident("cfg_attr") {
            let parser = syn::punctuated::Punctuated::<syn::Meta, syn::Token![,]>::parse_terminated;
            let mut parts = attribute.parse_args_with(parser).expect("a cfg_attr").into_iter();
            let condition = parts.next().map(|c| text(&c));
            out.extend(parts.map(|meta| (condition.clone(), meta)));
        } else {
            out.push((None, attribute.meta.clone()));
        }
    }
    out
}

/// The attributes that matter to users.
fn marks(attributes: &[Attribute]) -> String {
    let matters = |meta: &syn::Meta| {
        ["must_use", "non_exhaustive", "deprecated", "serde", "repr"]
            .iter()
            .any(|n| meta.path().is_ident(n))
            || meta.to_token_stream().to_string() == "doc (hidden)"
    };
    let all = flat_attributes(attributes);
    let shown = all.iter().filter(|(_, meta)| matters(meta));
    shown.map(|(_, meta)| format!("#[{}] ", text(meta))).collect()
}
