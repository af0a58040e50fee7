//! The `[groups.NAME]` tables, and the `[[instance]]` tables that copy them. Instances are expanded when the
//! scene is read, so later stages see only objects.

use std::ops::Range;
use std::sync::LazyLock;

use super::super::description::{Object, ObjectTransform};
use super::super::keys::key::DefaultValue::{Absent, Is, Required};
use super::super::keys::key::ValueKind::{Group, Numbers, Scale, Text};
use super::super::keys::key::{ANGLES, TableInfo, TableSyntax, keys};
use super::super::sanitize::escape_and_truncate;
use super::super::toml::TableId;
use super::context::{FileContext, Issue};
use super::limits::Limits::{Any, NotZero};
use super::materials::MaterialList;
use super::names::DefinedNames;
use super::shape_table::MeshFileRegistry;
use super::shapes::{SHAPES, read_shape_objects};
use super::table::TableReader;
use super::transform::{composed_transform_problem, read_transform};

pub(crate) static GROUPS: TableInfo = TableInfo {
    tables: object_table_infos,
    ..TableInfo::new(
        "groups",
        TableSyntax::Named,
        "Objects in their own coordinates, rendered wherever an `[[instance]]` places the group",
        &[],
    )
};

pub(crate) static INSTANCE: TableInfo = TableInfo::new(
    "instance",
    TableSyntax::List,
    "A copy of a group",
    keys! {
        /// The group.
        group: Group, Required("\"name\"");
        /// Scale, applied first.
        scale: Scale(NotZero), Is("1.0");
        /// Rotation about x, then y, then z.
        rotate: ANGLES, Is("[0, 0, 0]"), "degrees";
        /// Translation, applied last.
        translate: Numbers(3, "three numbers", Any), Is("[0, 0, 0]"), "length";
        /// Name shown after a click and used by `--set`.
        name: Text, Absent;
        /// An affine transform in row-major order, with 0, 0, 0, 1 as the last row; instead of `scale`,
        /// `rotate` and `translate`.
        matrix: Numbers(16, "16 numbers", Any), Absent;
    },
);

/// Returns the tables of objects, which can be in a scene or in a group.
pub(crate) fn object_table_infos() -> &'static [TableInfo] {
    static TABLES: LazyLock<Vec<TableInfo>> =
        LazyLock::new(|| SHAPES.iter().map(|shape| &shape.info).chain([&INSTANCE]).cloned().collect());
    &TABLES
}

/// The groups defined in a file.
pub(super) struct DefinedGroups {
    /// Group names.
    pub(super) names: DefinedNames,
    /// The groups, in the same order as the names, or `None` if any is invalid.
    pub(super) list: Option<Vec<ObjectGroup>>,
}

/// A group.
pub(super) struct ObjectGroup {
    /// Objects and instances, in file order.
    members: Vec<GroupMember>,
    /// Number of members, including the members of nested groups.
    size: u64,
}

/// A member of a group.
enum GroupMember {
    /// An object whose transform has not been applied to its shape yet.
    Object(Object),
    /// A copy of another group.
    Instance(InstanceTable),
}

/// An `[[instance]]` table.
pub(super) struct InstanceTable {
    pub(super) id: TableId,
    /// Index of the group.
    group: usize,
    transform: ObjectTransform,
    pub(super) name: Option<Box<str>>,
    /// Byte range of the header or the braces.
    pub(super) span: Range<usize>,
}

/// Reads all groups. Reports an error if a group contains itself.
pub(super) fn read_groups(
    root: &TableReader<'_>,
    materials: &MaterialList,
    files: &mut MeshFileRegistry,
) -> DefinedGroups {
    let tables = root.named_tables(&GROUPS);
    let names = DefinedNames::new("group", tables.iter().map(|(name, span, _)| (name.clone(), span.clone())));
    let read: Vec<Option<Vec<GroupMember>>> =
        tables.into_iter().map(|(_, _, table)| read_members(&table?, &names, materials, files)).collect();
    let members: Option<Vec<Vec<GroupMember>>> = read.into_iter().collect();
    let list = members.and_then(|members| {
        let sizes = expanded_sizes(root.context, &names, &members)?;
        let groups = members.into_iter().zip(sizes);
        Some(groups.map(|(members, size)| ObjectGroup { members, size }).collect())
    });
    DefinedGroups { names, list }
}

fn read_members(
    table: &TableReader<'_>,
    names: &DefinedNames,
    materials: &MaterialList,
    files: &mut MeshFileRegistry,
) -> Option<Vec<GroupMember>> {
    let mut members = Vec::new();
    let are_shapes_valid = read_shape_objects(table, materials, files, |id, object| {
        members.push((id, GroupMember::Object(object)));
    });
    let instances = read_instances(table, names);
    table.reject_key(
        "light",
        "a group cannot contain lights without a shape",
        Some("write [[light]] outside of the group, or give a shape in the group a material with `emission`"),
    );
    table.report_unknown_and_missing_keys();
    members.extend(instances?.into_iter().map(|instance| (instance.id, GroupMember::Instance(instance))));
    members.sort_by_key(|(id, _)| *id);
    are_shapes_valid.then(|| members.into_iter().map(|(_, member)| member).collect())
}

/// Reads the instances in a scene or a group. Returns `None` if any is invalid.
pub(super) fn read_instances(parent: &TableReader<'_>, names: &DefinedNames) -> Option<Vec<InstanceTable>> {
    let read: Vec<Option<InstanceTable>> =
        parent.tables(&INSTANCE).map(|table| read_instance(&table, names)).collect();
    read.into_iter().collect()
}

fn read_instance(table: &TableReader<'_>, names: &DefinedNames) -> Option<InstanceTable> {
    let group = table.key("group").index_by_name(names);
    let (transform, name) = (read_transform(table), table.key("name").optional_shape_name());
    table.report_unknown_and_missing_keys();
    let (id, span) = (table.table_id(), table.span.clone());
    Some(InstanceTable { id, group: group?, transform: transform?, name: name?, span })
}

/// Returns the number of members of each group, including the members of nested groups. If a group contains
/// itself, reports an error and returns `None`.
fn expanded_sizes(
    context: &FileContext<'_>,
    names: &DefinedNames,
    groups: &[Vec<GroupMember>],
) -> Option<Vec<u64>> {
    // Visit nested groups first. Use Kahn's algorithm, because recursion could overflow the stack.
    let mut sizes = vec![0_u64; groups.len()];
    let mut parents: Vec<Vec<usize>> = vec![Vec::new(); groups.len()];
    let mut pending: Vec<usize> = groups.iter().map(|group| instances_in_group(group).count()).collect();
    for (parent, group) in groups.iter().enumerate() {
        instances_in_group(group).for_each(|instance| parents[instance.group].push(parent));
    }
    let mut ready: Vec<usize> = (0..groups.len()).filter(|&group| pending[group] == 0).collect();
    while let Some(group) = ready.pop() {
        let nested = instances_in_group(&groups[group]).map(|instance| sizes[instance.group]);
        sizes[group] = nested.fold(groups[group].len() as u64, u64::saturating_add);
        for &parent in &parents[group] {
            pending[parent] -= 1;
            if pending[parent] == 0 {
                ready.push(parent);
            }
        }
    }
    // The remaining groups are part of a cycle or lead to one.
    let Some(start) = pending.iter().position(|&count| count > 0) else { return Some(sizes) };
    let is_pending = |instance: &&InstanceTable| pending[instance.group] > 0;
    let next: Vec<Option<&InstanceTable>> =
        groups.iter().map(|group| instances_in_group(group).find(is_pending)).collect();
    report_cycle(context, names, &next, start);
    None
}

/// Returns the instances in a group.
fn instances_in_group(group: &[GroupMember]) -> impl Iterator<Item = &InstanceTable> {
    group.iter().filter_map(|member| match member {
        GroupMember::Object(_) => None,
        GroupMember::Instance(instance) => Some(instance),
    })
}

/// Reports the cycle reached from the group `start`. `next` contains the instance to follow from each group.
fn report_cycle(
    context: &FileContext<'_>,
    names: &DefinedNames,
    next: &[Option<&InstanceTable>],
    start: usize,
) -> Option<()> {
    const MAX_LISTED: usize = 6;
    // After as many steps as there are groups, the current group is on the cycle.
    let first = (0..next.len()).try_fold(start, |group, _| Some(next[group]?.group))?;
    let follow = |instance: &&'_ InstanceTable| next[instance.group].filter(|_| instance.group != first);
    let cycle: Vec<&InstanceTable> = std::iter::successors(next[first], follow).collect();
    let name = |group: usize| escape_and_truncate(names.name(group), 40);
    let mut listed: Vec<String> =
        [first].into_iter().chain(cycle.iter().map(|one| one.group)).map(name).collect();
    if listed.len() > MAX_LISTED {
        listed.splice(MAX_LISTED - 2..listed.len() - 1, ["…".to_owned()]);
    }
    let message = format!("the group \"{}\" contains itself", name(first));
    let issue = Issue::error(cycle.last()?.span.clone(), message);
    context.report(issue.with_label(listed.join(" → ")).with_help("remove one of these instances"));
    Some(())
}

/// Maximum number of objects and nested instances that instances add to a scene. They take about 2 GB.
const MAX_COPIES: u64 = 2_000_000;

impl DefinedGroups {
    fn all_groups(&self) -> &[ObjectGroup] {
        self.list.as_deref().unwrap_or_default()
    }

    /// Returns the number of objects and nested instances that instances add to the scene. Reports an error
    /// if there are too many.
    pub(super) fn count_objects_from_instances(
        &self,
        context: &FileContext<'_>,
        instances: &[InstanceTable],
    ) -> Option<usize> {
        let mut total = 0_u64;
        for instance in instances {
            let size = self.all_groups()[instance.group].size;
            total = total.saturating_add(size);
            if total > MAX_COPIES {
                let name = escape_and_truncate(self.names.name(instance.group), 40);
                let issue = Issue::error(
                    instance.span.clone(),
                    format!(
                        "the instances add more than {} million copies of shapes",
                        MAX_COPIES / 1_000_000
                    ),
                );
                context.report(
                    issue
                        .with_label(format!("this instance of \"{name}\" adds {size}"))
                        .with_help("use fewer instances, or combine the objects of a group in a mesh file"),
                );
                return None;
            }
        }
        usize::try_from(total).ok()
    }

    /// Adds the objects of an instance to a list. Reports an error if a transform cannot be applied.
    pub(super) fn expand_instance(
        &self,
        context: &FileContext<'_>,
        instance: &InstanceTable,
        objects: &mut Vec<Object>,
    ) -> Option<()> {
        let members = |instance: &InstanceTable| self.all_groups()[instance.group].members.iter();
        // Groups being expanded, from the outermost to the innermost, with their transforms.
        let mut open = vec![(members(instance), instance.transform)];
        while let Some((rest, outer)) = open.last_mut() {
            match rest.next() {
                Some(GroupMember::Object(object)) => {
                    let transform = object.shape.transform().then(outer);
                    if let Some((problem, label)) = composed_transform_problem(&transform) {
                        let kind = object.shape.kind();
                        let message =
                            format!("the combined transform of a {kind} in this instance {problem}");
                        let help = "change the transforms of the instance, its groups or the shape";
                        let issue = Issue::error(instance.span.clone(), message);
                        context.report(issue.with_label(label).with_help(help));
                        return None;
                    }
                    objects.push(object.clone().with_outer_transform(outer));
                }
                Some(GroupMember::Instance(inner)) => {
                    let transform = inner.transform.then(outer);
                    open.push((members(inner), transform));
                }
                None => {
                    open.pop();
                }
            }
        }
        Some(())
    }
}
