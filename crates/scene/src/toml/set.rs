//! Sets values in a document by their dotted keys.

use std::ops::Range;

use super::tree::{Document, Name, NodeKind, TableId, TableOrigin, ValueNode};

/// A key that cannot be set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct KeyError {
    /// Byte range of `part`.
    pub(crate) span: Range<usize>,
    /// The parts of the key that precede `part`.
    pub(crate) above: Vec<String>,
    /// The part of the key that cannot be resolved.
    pub(crate) part: String,
    /// Reason why `part` cannot be resolved.
    pub(crate) why: KeyErrorKind,
}

/// Reasons why a part of a key cannot be resolved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum KeyErrorKind {
    /// The table does not exist and must not be created.
    Unknown {
        /// Names of the existing tables.
        known: Vec<String>,
    },
    /// The list has no such element.
    NoEntry {
        /// Number of elements.
        count: usize,
        /// Names of all named elements.
        names: Vec<String>,
    },
    /// Several elements of the list have this name.
    Ambiguous {
        /// Number of elements with this name.
        count: usize,
    },
    /// The part refers to an element of an array of values.
    Element,
}

/// The groups and lists of tables in a document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TableKindPredicates {
    /// Whether a top-level name denotes a group of named tables. Named tables are never created.
    pub(crate) is_group: fn(&str) -> bool,
    /// Whether the parts of a key denote a list of tables.
    pub(crate) is_list: fn(&[&str]) -> bool,
}

impl<'s> Document<'s> {
    /// Sets the value at `keys`. Creates missing tables, except in groups.
    pub(super) fn set_at_path(
        &mut self,
        keys: &[Name<'s>],
        value: ValueNode,
        layout: TableKindPredicates,
    ) -> Result<(), KeyError> {
        let mut table = Self::ROOT;
        let mut depth = 0;
        while depth + 1 < keys.len() {
            let next = depth + 1;
            match self.resolve_parent_key_part(keys, depth, table, layout)? {
                KeyPartTarget::Table(inner) => table = inner,
                KeyPartTarget::Element(list, index) if next + 1 == keys.len() => {
                    self.set_element(list, index, value);
                    return Ok(());
                }
                KeyPartTarget::Element(list, index) => {
                    let element = self.elements_of(list).get(index).and_then(|node| node.kind.as_table_id());
                    table = element.ok_or_else(|| key_error(keys, next, KeyErrorKind::Element))?;
                    depth = next;
                }
            }
            depth += 1;
        }
        self.check_group_member_exists(keys, depth, table, layout)?;
        if let Some(last) = keys.get(depth) {
            self.set_or_add_value(table, last.clone(), value);
        }
        Ok(())
    }

    /// Resolves any part of a key except the last.
    fn resolve_parent_key_part(
        &mut self,
        keys: &[Name<'s>],
        depth: usize,
        table: TableId,
        layout: TableKindPredicates,
    ) -> Result<KeyPartTarget, KeyError> {
        let (name, next) = (&keys[depth], &keys[depth + 1]);
        let is_list = || {
            let path: Vec<&str> = keys[..=depth].iter().map(|name| name.text.as_ref()).collect();
            (layout.is_list)(&path)
        };
        self.check_group_member_exists(keys, depth, table, layout)?;
        let found = self.find_in_table(table, &name.text).map(|node| node.kind);
        if let Some(inner) = found.and_then(NodeKind::as_table_id) {
            return Ok(KeyPartTarget::Table(inner));
        }
        let elements = found.map_or_else(Vec::new, |kind| self.elements_of(kind));
        let has_tables = elements.iter().any(|node| node.kind.as_table_id().is_some());
        match found {
            Some(list) if has_tables => {
                let index = self.find_element_by_number_or_name(&elements, &next.text);
                index
                    .map(|index| KeyPartTarget::Element(list, index))
                    .map_err(|why| key_error(keys, depth + 1, why))
            }
            None if is_list() => {
                Err(key_error(keys, depth + 1, KeyErrorKind::NoEntry { count: 0, names: Vec::new() }))
            }
            Some(_) if !elements.is_empty() && next.text.parse::<u64>().is_ok() => {
                Err(key_error(keys, depth + 1, KeyErrorKind::Element))
            }
            Some(_) | None => Ok(KeyPartTarget::Table(self.create_table(table, name))),
        }
    }

    /// Returns an error if a part of a key refers to a missing table in a group.
    fn check_group_member_exists(
        &self,
        keys: &[Name<'s>],
        depth: usize,
        table: TableId,
        layout: TableKindPredicates,
    ) -> Result<(), KeyError> {
        let is_in_group = depth == 1 && (layout.is_group)(&keys[0].text);
        if is_in_group && self.find_in_table(table, &keys[1].text).is_none() {
            return Err(key_error(keys, 1, KeyErrorKind::Unknown { known: self.keys(table) }));
        }
        Ok(())
    }

    /// Sets a key to a new, empty table.
    fn create_table(&mut self, parent: TableId, name: &Name<'s>) -> TableId {
        let table = self.add_table(TableOrigin::default());
        self.set_or_add_value(
            parent,
            name.clone(),
            ValueNode { span: name.span, kind: NodeKind::Table(table) },
        );
        table
    }

    /// Finds the index of an element from its 1-based number or the value of its key `name`.
    fn find_element_by_number_or_name(
        &self,
        elements: &[ValueNode],
        part: &str,
    ) -> Result<usize, KeyErrorKind> {
        let number = part.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        if let Some(index) = number.filter(|index| *index < elements.len()) {
            return Ok(index);
        }
        let name_of = |node: &ValueNode| self.find_string(node.kind.as_table_id()?, "name");
        let mut named = elements.iter().enumerate().filter(|(_, node)| name_of(node) == Some(part));
        match (named.next(), named.count()) {
            (Some((index, _)), 0) => Ok(index),
            (Some(_), others) => Err(KeyErrorKind::Ambiguous { count: others + 1 }),
            (None, _) => {
                let names = elements.iter().filter_map(name_of).map(str::to_owned).collect();
                Err(KeyErrorKind::NoEntry { count: elements.len(), names })
            }
        }
    }
}

/// Target of one part of a key.
enum KeyPartTarget {
    /// A table.
    Table(TableId),
    /// An element of a list, selected by the next part.
    Element(NodeKind, usize),
}

fn key_error(keys: &[Name<'_>], depth: usize, why: KeyErrorKind) -> KeyError {
    let part = |name: &Name<'_>| name.text.clone().into_owned();
    KeyError {
        span: keys[depth].span.range(),
        above: keys[..depth].iter().map(part).collect(),
        part: part(&keys[depth]),
        why,
    }
}
