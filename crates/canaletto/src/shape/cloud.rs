//! Clouds: millions of analytic spheres or cylinders as one object.

use super::{Cylinder, Shape, ShapeHit, Sphere, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Rgb};
use canaletto_bvh::{Aabb, Ray};
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Many spheres of one object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SphereCloud {
    /// The name of the cloud's file or node, for messages.
    pub name: String,
    /// The origin of the centres. It is zero, unless they are so far from zero that `f32` would lose visible detail.
    #[serde(default)]
    pub origin: DVec3,
    /// The centres, relative to the origin.
    pub centers: Vec<Vec3>,
    /// One radius for all spheres, or one for each; > 0.
    pub radii: Vec<f32>,
    /// One colour for all spheres, one for each, or none. A colour replaces kd.
    pub colors: Vec<Rgb>,
    /// The row of the table that each comes from, counted from 1, in rising order. None if they are all rows.
    #[serde(default)]
    pub rows: Vec<u32>,
}

/// Many cylinders of one object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CylinderCloud {
    /// The name of the cloud's file or node, for messages.
    pub name: String,
    /// The origin of the ends. It is zero, unless they are so far from zero that `f32` would lose visible detail.
    #[serde(default)]
    pub origin: DVec3,
    /// The two ends of each axis, relative to the origin.
    pub axes: Vec<[Vec3; 2]>,
    /// One radius for all cylinders, or one for each; > 0.
    pub radii: Vec<f32>,
    /// One colour for all cylinders, one for each, or none. A colour replaces kd.
    pub colors: Vec<Rgb>,
    /// The row of the table that each comes from, counted from 1, in rising order. None if they are all rows.
    #[serde(default)]
    pub rows: Vec<u32>,
    /// Whether the ends are closed by disks.
    pub caps: bool,
}

/// Element `i` of a list that holds one value for all elements or one for each.
fn shared_or_own<T: Copy>(list: &[T], i: usize) -> Option<T> {
    if list.len() == 1 { Some(list[0]) } else { list.get(i).copied() }
}

fn check_lists(len: usize, radii: &[f32], colors: &[Rgb], of: &str) -> Result<(), OutOfRange> {
    if radii.len() != 1 && radii.len() != len {
        return Err(OutOfRange::whole(format!(
            "there are {} radii for {len} {of}; there must be one for all or one for each",
            radii.len()
        )));
    }
    if !colors.is_empty() && colors.len() != 1 && colors.len() != len {
        let colors = colors.len();
        return Err(OutOfRange::whole(format!(
            "there are {colors} colours for {len} {of}; there must be none, one for all or one for each"
        )));
    }
    if let Some((i, r)) = radii.iter().enumerate().find(|(_, r)| !r.is_finite() || **r <= 0.0) {
        return Err(OutOfRange::new("radius", format!("{i} is {r}; it must be more than 0 and finite")));
    }
    if let Some((i, c)) = colors.iter().enumerate().find(|(_, c)| !c.is_finite()) {
        return Err(OutOfRange::whole(format!("colour {i} is {} {} {}; each component must be finite", c.r, c.g, c.b)));
    }
    Ok(())
}

macro_rules! cloud {
    ($cloud:ident, $element:ident, $list:ident, $of:literal, $word:literal, $build:ident) => {
        impl $cloud {
            /// The number of elements.
            pub fn len(&self) -> usize {
                self.$list.len()
            }

            /// Whether there are no elements.
            pub fn is_empty(&self) -> bool {
                self.$list.is_empty()
            }

            /// The radius of element `i`.
            pub fn radius(&self, i: usize) -> f32 {
                shared_or_own(&self.radii, i).unwrap_or(0.0)
            }

            /// The colour of element `i`, if the cloud has colours.
            pub fn color(&self, i: usize) -> Option<Rgb> {
                shared_or_own(&self.colors, i)
            }

            /// The row of the table that element `i` comes from, counted from 1.
            pub fn row(&self, i: usize) -> u32 {
                self.rows.get(i).copied().unwrap_or(u32::try_from(i + 1).unwrap_or(u32::MAX))
            }

            /// The box around element `i`.
            pub fn bounds(&self, i: usize) -> Aabb {
                self.element(i).bounds()
            }

            /// The nearest hit of element `i` with 0 < t ≤ t_max.
            pub fn intersect(&self, i: usize, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
                self.element(i).intersect(ray, t_max)
            }

            /// The surface at a hit of element `i`.
            pub fn surface(&self, i: usize, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
                Surface { color: self.color(i), ..self.element(i).surface(line, hit) }
            }

            /// The surface at a hit of element `i` whose texture coordinates are not read and may be left out.
            pub(crate) fn surface_without_uv(&self, i: usize, line: DRay, hit: &ShapeHit) -> Surface {
                Surface { color: self.color(i), ..Shape::from(self.element(i)).surface_without_uv(line, hit) }
            }

            /// The surface differential of element `i` at a hit with this surface.
            pub fn surface_differential(&self, i: usize, surface: &Surface, hit: &ShapeHit) -> SurfaceDifferential {
                Shape::from(self.element(i)).surface_differential(surface, hit)
            }

            /// Checks the lists' lengths and every number's range.
            ///
            /// # Errors
            /// An [`OutOfRange`] that names the number, its value and the range.
            pub fn check(&self) -> Result<(), OutOfRange> {
                check_lists(self.len(), &self.radii, &self.colors, $of)?;
                if !self.rows.is_empty() && self.rows.len() != self.len() {
                    let rows = self.rows.len();
                    return Err(OutOfRange::whole(format!(
                        "there are numbers of {rows} rows for {} {}; there must be none or one for each",
                        self.len(),
                        $of
                    )));
                }
                let wrong = (0..self.len()).into_par_iter().find_map_first(|i| {
                    if let Err(e) = self.element(i).check() {
                        return Some(format!(concat!($word, " {}: {}"), i, e));
                    }
                    let Aabb { min, max } = self.bounds(i);
                    (!(min.is_finite() && max.is_finite())).then(|| {
                        format!(
                            concat!($word, " {} reaches beyond ±{:e}, the largest coordinate possible"),
                            i,
                            f32::MAX
                        )
                    })
                });
                wrong.map_or(Ok(()), |sentence| Err(OutOfRange::whole(sentence)))
            }

            fn element(&self, i: usize) -> $element {
                self.$build(i)
            }
        }
    };
}

cloud!(SphereCloud, Sphere, centers, "centers", "sphere", sphere);
cloud!(CylinderCloud, Cylinder, axes, "axes", "cylinder", cylinder);

impl SphereCloud {
    /// Sphere number `i`.
    pub fn sphere(&self, i: usize) -> Sphere {
        Sphere { center: self.centers[i], radius: self.radius(i) }
    }
}

impl CylinderCloud {
    /// Cylinder number `i`.
    pub fn cylinder(&self, i: usize) -> Cylinder {
        let [base, top] = self.axes[i];
        Cylinder { base, top, radius: self.radius(i), caps: self.caps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> SphereCloud {
        SphereCloud { centers: vec![Vec3::ZERO, Vec3::X * 5.0], radii: vec![1.0, 2.0], ..SphereCloud::default() }
    }

    #[test]
    fn one_radius_serves_all() {
        assert_eq!((cloud().radius(0), cloud().radius(1)), (1.0, 2.0));
        let same = SphereCloud { radii: vec![3.0], ..cloud() };
        assert_eq!((same.radius(0), same.radius(1)), (3.0, 3.0));
        assert!(same.check().is_ok());
    }

    #[test]
    fn the_surface_brings_the_colour() {
        let red = Rgb::new(1.0, 0.0, 0.0);
        let cloud = SphereCloud { colors: vec![Rgb::BLACK, red], ..cloud() };
        let ray = Ray::new(Vec3::X * 9.0, Vec3::NEG_X);
        let hit = cloud.intersect(1, &ray, f32::INFINITY).unwrap();
        let s = cloud.surface(1, &ray, &hit);
        assert_eq!((s.point, s.color), (Vec3::X * 7.0, Some(red)));
    }

    #[test]
    fn broken_lists_are_named() {
        let radii = SphereCloud { radii: vec![1.0; 3], ..cloud() };
        assert_eq!(
            radii.check().unwrap_err().to_string(),
            "there are 3 radii for 2 centers; there must be one for all or one for each"
        );
        let negative = SphereCloud { radii: vec![1.0, -1.0], ..cloud() };
        assert_eq!(negative.check().unwrap_err().to_string(), "radius 1 is -1; it must be more than 0 and finite");
        let point = CylinderCloud { axes: vec![[Vec3::ONE; 2]], radii: vec![1.0], ..CylinderCloud::default() };
        assert!(point.check().unwrap_err().to_string().starts_with("cylinder 0: base and top are both 1 1 1"));
    }
}
