//! Which prototypes stay whole: a copy of one is then an instance of a group, however much it holds. The rest is dissolved into the
//! instances of whatever repeats it, which makes shorter ways for rays and takes memory for each copy of each thing.

use super::flatten::Builder;
use super::group::{BuildTables, Group};
use super::instance::{Instance, NONE};
use super::{BuildError, World};
use crate::scene::{Content, Node};

/// Which prototypes stay whole. No answer depends on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct InstancingPolicy {
    /// Those of at least so many instances,
    pub(super) members: usize,
    /// that would, dissolved wherever the description refers to them, take more than this part of the room that is left for instances.
    pub(super) part: usize,
}

impl Default for InstancingPolicy {
    /// To dissolve one takes some 20 MiB at most, and what is left for the others never ends. What has hardly any members
    /// is no shorter as an instance.
    fn default() -> InstancingPolicy {
        InstancingPolicy { members: 4, part: 64 }
    }
}

/// How often the description refers to each prototype.
pub(super) fn uses_of(nodes: &[Node], prototypes: &[Node]) -> Vec<u32> {
    let mut uses = vec![0; prototypes.len()];
    nodes.iter().chain(prototypes).for_each(|node| refer(node, &mut uses, 0));
    uses
}

fn refer(node: &Node, uses: &mut [u32], depth: usize) {
    match &node.content {
        Content::Instance(index) => {
            if let Some(n) = uses.get_mut(*index as usize) {
                *n = n.saturating_add(1);
            }
        }
        Content::Group(children) if depth < World::MAX_NESTING => {
            children.iter().for_each(|child| refer(child, uses, depth + 1));
        }
        _ => {}
    }
}

impl Builder {
    pub(super) fn tables(&self) -> BuildTables<'_> {
        BuildTables { geometries: &self.geometries, groups: &self.groups, chains: &self.chains }
    }

    /// A prototype's instances, or, if it shall stay whole, the one of their group. What moves can't stay whole: each of its
    /// copies has a way of its own.
    pub(super) fn as_group(&mut self, index: u32, instances: Vec<Instance>) -> Result<Vec<Instance>, BuildError> {
        let moves = instances.iter().any(|instance| instance.motion != NONE);
        let nested = instances.iter().any(|instance| instance.group != NONE);
        let InstancingPolicy { members, part } = self.instancing;
        let expanded = instances.len().saturating_mul(self.uses.get(index as usize).map_or(0, |&uses| uses as usize));
        let many = instances.len() >= members && expanded > self.room() / part;
        // The places of groups can't be folded into those of their members but from the innermost outwards, and so not yet.
        if moves || !(many || nested) {
            return self.expanded(instances);
        }
        let name = &self.prototypes[index as usize].name;
        let name = name.as_ref().map_or_else(|| format!("prototype {index}"), |name| format!("\"{name}\""));
        let object = instances.first().map_or(NONE, |instance| instance.object);
        match Group::of_prototype(instances, &name, self.tables())? {
            Ok(group) => {
                self.groups.push(group);
                Ok(vec![Instance::of_group(self.groups.len() as u32 - 1, object)])
            }
            Err(instances) => self.expanded(instances),
        }
    }

    /// The instances, those of groups replaced by their members.
    pub(super) fn expanded(&mut self, instances: Vec<Instance>) -> Result<Vec<Instance>, BuildError> {
        if instances.iter().all(|instance| instance.group == NONE) {
            return Ok(instances);
        }
        let mut all = Vec::new();
        for instance in instances {
            match self.groups.get(instance.group as usize) {
                None => all.push(instance),
                Some(group) => {
                    let leaves = group.leaves;
                    self.count_instances(leaves as usize)?;
                    let group = &self.groups[instance.group as usize];
                    all.extend((0..leaves).map(|number| {
                        let mut placed = group.resolve(number, &self.groups);
                        placed.enclose(&instance);
                        placed
                    }));
                }
            }
        }
        Ok(all)
    }
}
