//! The choice of prototypes to keep. Each copy of a kept prototype is one instance of a group, whatever the prototype
//! holds. The other prototypes are dissolved into the instances of what repeats them. Dissolving shortens traversal but
//! takes memory for each copy of each member.

use crate::scene::{Content, Node};
use crate::world::build::flatten::Builder;
use crate::world::data::group::{BuildTables, Group};
use crate::world::data::instance::{Instance, NONE};
use crate::world::{BuildError, World};

/// The policy that decides which prototypes are kept as groups. No result depends on it.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct InstancingPolicy {
    /// The fewest instances that a kept prototype holds.
    pub(in crate::world) members: usize,
    /// A kept prototype, dissolved at all references, would take more than 1 / `part` of the remaining instances.
    pub(in crate::world) part: usize,
    /// The number of single shapes under one transform that are instances of their own. The scene's tree tells few
    /// shapes apart faster than a tree for each transform does.
    pub(in crate::world) alone: usize,
}

impl Default for InstancingPolicy {
    /// With these values, dissolving a prototype takes at most about 20 MiB, and some instances always remain for the
    /// others. A prototype of few members is no smaller as a group.
    fn default() -> InstancingPolicy {
        InstancingPolicy { members: 4, part: 64, alone: 64 }
    }
}

/// The number of references to each prototype in the description.
pub(in crate::world) fn uses_of(nodes: &[Node], prototypes: &[Node]) -> Vec<u32> {
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
    pub(in crate::world) fn tables(&self) -> BuildTables<'_> {
        BuildTables { geometries: &self.geometries, groups: &self.groups, chains: &self.chains }
    }

    /// A prototype's instances, or the instance of their group if the prototype is kept. Moving instances can't be kept
    /// in a group, since each copy has a path of its own.
    pub(in crate::world) fn as_group(
        &mut self,
        index: u32,
        instances: Vec<Instance>,
    ) -> Result<Vec<Instance>, BuildError> {
        let moves = instances.iter().any(|instance| instance.motion != NONE);
        let nested = instances.iter().any(|instance| instance.group != NONE);
        let InstancingPolicy { members, part, .. } = self.instancing;
        let expanded = instances.len().saturating_mul(self.uses.get(index as usize).map_or(0, |&uses| uses as usize));
        let many = instances.len() >= members && expanded > self.room() / part;
        // The transforms of groups can only be composed with those of their members from the innermost outwards. They
        // are therefore not composed here.
        if moves || !(many || nested) {
            return self.expanded(instances);
        }
        let name = &self.prototypes[index as usize].name;
        let name = name.as_ref().map_or_else(|| format!("prototype {index}"), |name| format!("\"{name}\""));
        match Group::of_prototype(instances, &name, self.tables())? {
            Ok(group) => {
                self.groups.push(group);
                Ok(vec![Instance::of_group(self.groups.len() as u32 - 1)])
            }
            Err(instances) => self.expanded(instances),
        }
    }

    /// The instances, with those of groups replaced by the groups' members.
    pub(in crate::world) fn expanded(&mut self, instances: Vec<Instance>) -> Result<Vec<Instance>, BuildError> {
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

#[cfg(test)]
mod tests;
