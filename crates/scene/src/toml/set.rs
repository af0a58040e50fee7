//! Values that are put into a document in place of its own.

use std::ops::Range;

use super::tree::{Document, Kind, Name, Node, Origin, TableId};

/// Why a value has no place in a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in super::super) struct NoPlace {
    /// Bytes of the part of the key that leads nowhere.
    pub(in super::super) span: Range<usize>,
    /// The parts before it.
    pub(in super::super) above: Vec<String>,
    /// The part itself.
    pub(in super::super) part: String,
    /// The fault of the key.
    pub(in super::super) why: Why,
}

/// Faults of a part of a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in super::super) enum Why {
    /// A table of this name is not there, and is not made.
    Unknown {
        /// Keys that exist.
        known: Vec<String>,
    },
    /// A list has no such entry.
    NoEntry {
        /// Number of its entries.
        count: usize,
        /// Names of the entries that have one.
        names: Vec<String>,
    },
    /// Several entries have this name.
    Ambiguous {
        /// Number of entries.
        count: usize,
    },
    /// An element of an array of values.
    Element,
}

/// Tables and lists that keys lead through.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Layout {
    /// Tables at the top that hold tables by names of the file's own: those are not made.
    pub(in super::super) groups: &'static [&'static str],
    /// Whether a name at the top is that of a list of tables.
    pub(in super::super) is_list: fn(&str) -> bool,
}

impl<'s> Document<'s> {
    /// Puts a value where a key leads, in place of what is there; tables on the way are made, those of groups are not.
    pub(super) fn put_at(&mut self, keys: &[Name<'s>], value: Node, layout: Layout) -> Result<(), NoPlace> {
        let mut table = Self::ROOT;
        let mut depth = 0;
        while depth + 1 < keys.len() {
            let next = depth + 1;
            match self.step(keys, depth, table, layout)? {
                Step::Table(inner) => table = inner,
                Step::Element(list, index) if next + 1 == keys.len() => {
                    self.set_element(list, index, value);
                    return Ok(());
                }
                Step::Element(list, index) => {
                    let element = self.elements_of(list).get(index).and_then(|node| node.kind.table());
                    table = element.ok_or_else(|| no_place(keys, next, Why::Element))?;
                    depth = next;
                }
            }
            depth += 1;
        }
        self.check_group(keys, depth, table, layout)?;
        if let Some(last) = keys.get(depth) {
            self.put(table, last.clone(), value);
        }
        Ok(())
    }

    /// The step of a key's part that is not the last one.
    fn step(
        &mut self,
        keys: &[Name<'s>],
        depth: usize,
        table: TableId,
        layout: Layout,
    ) -> Result<Step, NoPlace> {
        let (name, next) = (&keys[depth], &keys[depth + 1]);
        let is_list = depth == 0 && (layout.is_list)(&name.text);
        self.check_group(keys, depth, table, layout)?;
        let found = self.find(table, &name.text).map(|node| node.kind);
        if let Some(inner) = found.and_then(Kind::table) {
            return Ok(Step::Table(inner));
        }
        let elements = found.map_or_else(Vec::new, |kind| self.elements_of(kind));
        let has_tables = elements.iter().any(|node| node.kind.table().is_some());
        match found {
            Some(list) if has_tables => {
                let index = self.entry_named(&elements, &next.text);
                index.map(|index| Step::Element(list, index)).map_err(|why| no_place(keys, depth + 1, why))
            }
            None if is_list => Err(no_place(keys, depth + 1, Why::NoEntry { count: 0, names: Vec::new() })),
            Some(_) if !elements.is_empty() && next.text.parse::<u64>().is_ok() => {
                Err(no_place(keys, depth + 1, Why::Element))
            }
            Some(_) | None => Ok(Step::Table(self.made(table, name))),
        }
    }

    /// Whether the part of a key names a table of a group that is there, if it names one of a group.
    fn check_group(
        &self,
        keys: &[Name<'s>],
        depth: usize,
        table: TableId,
        layout: Layout,
    ) -> Result<(), NoPlace> {
        let is_in_group = depth == 1 && layout.groups.contains(&&*keys[0].text);
        if is_in_group && self.find(table, &keys[1].text).is_none() {
            return Err(no_place(keys, 1, Why::Unknown { known: self.keys(table) }));
        }
        Ok(())
    }

    /// A new table, in place of what a key led to before.
    fn made(&mut self, parent: TableId, name: &Name<'s>) -> TableId {
        let table = self.add_table(Origin::default());
        self.put(parent, name.clone(), Node { span: name.span, kind: Kind::Table(table) });
        table
    }

    /// The index of an element: by its number, from 1, or by the text of its key `name`.
    fn entry_named(&self, elements: &[Node], part: &str) -> Result<usize, Why> {
        let number = part.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        if let Some(index) = number.filter(|index| *index < elements.len()) {
            return Ok(index);
        }
        let name_of = |node: &Node| self.find_text(node.kind.table()?, "name");
        let mut named = elements.iter().enumerate().filter(|(_, node)| name_of(node) == Some(part));
        match (named.next(), named.count()) {
            (Some((index, _)), 0) => Ok(index),
            (Some(_), others) => Err(Why::Ambiguous { count: others + 1 }),
            (None, _) => {
                let names = elements.iter().filter_map(name_of).map(str::to_owned).collect();
                Err(Why::NoEntry { count: elements.len(), names })
            }
        }
    }
}

/// The step of a key's part.
enum Step {
    /// To a table.
    Table(TableId),
    /// To an element of a list, which the next part names.
    Element(Kind, usize),
}

fn no_place(keys: &[Name<'_>], depth: usize, why: Why) -> NoPlace {
    let part = |name: &Name<'_>| name.text.clone().into_owned();
    NoPlace {
        span: keys[depth].span.range(),
        above: keys[..depth].iter().map(part).collect(),
        part: part(&keys[depth]),
        why,
    }
}
