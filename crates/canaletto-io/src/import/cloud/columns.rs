//! The meaning of a table's columns, by their names or by their number.

use super::CloudSettings;
use crate::import::lines::ImportError;

/// The meaning of a column.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// A coordinate, by its index.
    Point(usize),
    Radius,
    /// Red, green or blue, by its index.
    Color(usize),
}

/// The columns of a table.
#[derive(Default)]
pub(super) struct Roles {
    /// The meaning of each column; `None` for unused ones.
    pub(super) roles: Vec<Option<Role>>,
    pub(super) radius: bool,
    pub(super) color: bool,
    /// The column with the numbers of the colour map, and its name.
    pub(super) value: Option<(usize, String)>,
    /// The names of unused columns.
    pub(super) unknown: Vec<String>,
}

/// What doesn't fit, and what to do.
pub(super) struct Unfit {
    pub(super) message: String,
    pub(super) help: String,
}

impl From<Unfit> for ImportError {
    fn from(unfit: Unfit) -> ImportError {
        ImportError::file(unfit.message).help(unfit.help)
    }
}

/// The largest number of names that a message lists.
const MOST_NAMES: usize = 12;

/// Whether `name` is a common alternative of the coordinate name `wanted`.
fn is_called(name: &str, wanted: &str) -> bool {
    // ParaView numbers the components of a vector.
    let (other, numbered) = match wanted {
        "x" => (["px", "pos_x", "position_x", "center_x"], ["points:0", "points_0"]),
        "y" => (["py", "pos_y", "position_y", "center_y"], ["points:1", "points_1"]),
        "z" => (["pz", "pos_z", "position_z", "center_z"], ["points:2", "points_2"]),
        _ => return name == wanted,
    };
    name == wanted || other.contains(&name) || numbered.contains(&name)
}

impl Roles {
    /// The columns of a table with this many columns and no names; `points` has the names of the coordinates.
    pub(super) fn by_count(count: usize, points: &[&str], settings: &CloudSettings) -> Result<Roles, Unfit> {
        let n = points.len();
        let (radius, color) = match count.wrapping_sub(n) {
            0 => (false, false),
            1 => (true, false),
            3 => (false, true),
            4 => (true, true),
            _ => {
                let names = points.join(" ");
                return Err(Unfit {
                    message: format!(
                        "a row has {count} columns, but it should have {n}, {}, {} or {}",
                        n + 1,
                        n + 3,
                        n + 4
                    ),
                    help: format!(
                        "the columns are {names} [radius] [red green blue]; others need names in the first row, or \
                         columns=\"{names} …\" beside the file's name"
                    ),
                });
            }
        };
        let coordinates = (0..n).map(Role::Point);
        let colors = (0..3).map(Role::Color).filter(|_| color);
        let roles = coordinates.chain(radius.then_some(Role::Radius)).chain(colors).map(Some).collect();
        let names: Vec<&str> = points
            .iter()
            .copied()
            .chain(radius.then_some("radius"))
            .chain(["red", "green", "blue"].into_iter().filter(|_| color))
            .collect();
        let mut found = Roles { roles, radius, color, ..Roles::default() };
        found.value = value_column(&names, settings)?;
        Ok(found)
    }

    /// The columns of these names, which are in lower case. `what` names what holds them.
    pub(super) fn by_name(
        names: &[String],
        points: &[&str],
        settings: &CloudSettings,
        what: &str,
    ) -> Result<Roles, Unfit> {
        let find = |wanted: &[&str]| names.iter().position(|name| wanted.iter().any(|wanted| is_called(name, wanted)));
        let mut found = Roles { roles: vec![None; names.len()], ..Roles::default() };
        for (index, name) in points.iter().enumerate() {
            let at = find(&[name]).ok_or_else(|| Unfit {
                message: format!("{what} names no column `{name}`"),
                help: format!(
                    "its columns are {}; the coordinates must be called {}",
                    names.iter().take(MOST_NAMES).map(String::as_str).collect::<Vec<_>>().join(", "),
                    points.join(", ")
                ),
            })?;
            found.roles[at] = Some(Role::Point(index));
        }
        let short = find(&["g"]).is_some() && find(&["b"]).is_some();
        let rgb = if short {
            [find(&["r"]), find(&["g"]), find(&["b"])]
        } else {
            [find(&["red"]), find(&["green"]), find(&["blue"])]
        };
        if let [Some(r), Some(g), Some(b)] = rgb {
            found.color = true;
            [r, g, b].iter().enumerate().for_each(|(i, at)| found.roles[*at] = Some(Role::Color(i)));
        }
        let radius = find(&["radius"]).or(if short { None } else { find(&["r"]) });
        if let Some(at) = radius {
            found.radius = true;
            found.roles[at] = Some(Role::Radius);
        }
        found.value = value_column(names, settings)?;
        let value = found.value.as_ref().map(|(at, _)| *at);
        let unknown = (0..names.len()).filter(|at| found.roles[*at].is_none() && value != Some(*at));
        found.unknown = unknown.map(|at| names[at].clone()).filter(|name| !name.is_empty()).collect();
        Ok(found)
    }
}

/// The column with the numbers of the colour map, if there is one.
fn value_column<S: AsRef<str>>(names: &[S], settings: &CloudSettings) -> Result<Option<(usize, String)>, Unfit> {
    let Some(wanted) = settings.colormap.as_ref().map(|map| &map.column) else { return Ok(None) };
    let lower = wanted.trim().to_lowercase();
    let named = names.iter().position(|name| is_called(name.as_ref(), &lower));
    let numbered = || lower.parse().ok().filter(|number| (1..=names.len()).contains(number)).map(|number| number - 1);
    let found = named.or_else(numbered).map(|at| (at, wanted.clone()));
    let listed: Vec<&str> = names.iter().take(MOST_NAMES).map(AsRef::as_ref).collect();
    found.map(Some).ok_or_else(|| Unfit {
        message: format!("there is no column \"{wanted}\" for the colour map"),
        help: format!(
            "its columns are {}; a column may also be given by its number, 1 to {}",
            listed.join(", "),
            names.len()
        ),
    })
}
