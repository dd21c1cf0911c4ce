//! Lookups in the environment, as lines.

use super::term::{Line, line};
use crate::Named;
use crate::light::environment::{EnvironmentLookup, Footprint, Part, Place};

impl EnvironmentLookup {
    /// What a ray that meets nothing sees of the environment.
    pub(super) fn lines(&self) -> Vec<Line<'_>> {
        let (d, local) = (self.direction, self.local);
        let own = line!(", in the environment's own coordinates {}", local.to_array());
        let direction = line!("    direction {}", d.to_array());
        let place = match self.place {
            Place::Face { face, uv: [u, v] } => {
                line!("    face {}, u = {}, v = {} from its upper left corner  (fig. 5.35)", face.name(), u, v)
            }
            Place::Panorama { uv: [u, v] } => line!("    panorama u = {}, v = {} from its upper left corner", u, v),
            Place::Height(height) => line!("    {} degrees above the horizon", height),
            Place::Sky(Part::Air) => line!("    the sky"),
            Place::Sky(Part::Sun) => line!("    the sun's disk"),
            Place::Sky(Part::Ground) => line!("    the ground below the horizon"),
        };
        let footprint = self.footprint.map(|Footprint { level, looks }| {
            let mean = line!("    mean of {} lookups at pyramid level {}", looks, level);
            mean.written_if(level > 0.0 || looks > 1)
        });
        let value = line!("    = value {} * the environment's intensity", self.value);
        let mut lines = vec![
            line!("  meets nothing: environment \"{}\" {}", self.kind, self.radiance),
            if (local - d).length() > 1e-12 { direction.and(own) } else { direction },
            place,
        ];
        lines.extend(footprint);
        lines.push(value.written_if(self.value != self.radiance));
        lines
    }
}
