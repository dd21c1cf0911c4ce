//! Attributes in groups, whose values lie on a surface alike.

use super::edgebreaker::Surface;
use super::layout::{Laid, Layout};
use super::points::Points;
use super::prediction::Positions;
use super::reader::Reader;
use super::values::{Coding, Info, finish, integers};
use super::{Attribute, Budget, Component, Decoded};

/// Where the values of all attributes are.
pub(super) enum Domain<'a> {
    /// Each point has one.
    Points(usize),
    Surface(&'a Surface, &'a Points),
}

/// Decodes all attributes. Each has a value for each point.
pub(super) fn attributes(stream: &mut Reader, domain: &Domain, budget: &mut Budget) -> Decoded<Vec<Attribute>> {
    let groups = stream.byte()?;
    let layouts: Vec<Layout> = match domain {
        Domain::Points(_) => Vec::new(),
        Domain::Surface(surface, _) => (0..groups).map(|_| Layout::read(stream, surface)).collect::<Decoded<_>>()?,
    };
    let infos = (0..groups).map(|_| infos(stream)).collect::<Decoded<Vec<_>>>()?;
    let mut decoder = Decoder { has_positions: false, positions: None, attributes: Vec::new() };
    for (i, infos) in infos.iter().enumerate() {
        match domain {
            Domain::Points(count) => decoder.group(stream, infos, (*count, *count), None, budget)?,
            Domain::Surface(surface, points) => {
                let laid = layouts[i].lay(surface, points)?;
                decoder.group(stream, infos, (laid.len(), points.count), Some(&laid), budget)?;
            }
        }
    }
    Ok(decoder.attributes)
}

fn infos(stream: &mut Reader) -> Decoded<Vec<Info>> {
    let count = stream.number()?;
    if count == 0 {
        return Err("a group has no attributes".into());
    }
    let mut infos = Vec::new();
    for _ in 0..count {
        let (kind, component) = (stream.byte()?, stream.byte()?);
        let (width, is_normalized) = (stream.byte()?.into(), stream.byte()? > 0);
        let component = Component::of(component).ok_or("an attribute has an unknown type of numbers")?;
        if width == 0 {
            return Err("an attribute has elements without numbers".into());
        }
        let id = stream.number()?;
        infos.push(Info { is_position: kind == 0, component, is_normalized, width, id, coding: Coding::Plain });
    }
    for info in &mut infos {
        info.coding = Coding::read(stream, info)?;
    }
    Ok(infos)
}

struct Decoder {
    /// Whether the first attribute of positions has been there.
    has_positions: bool,
    /// Its integers. Predictions of other attributes use them.
    positions: Option<KnownPositions>,
    attributes: Vec<Attribute>,
}

/// All positions, and the number of each point's.
struct KnownPositions {
    all: Vec<i32>,
    of_points: Vec<u32>,
}

/// Values before they have their final form.
enum Values {
    Final(Vec<u8>),
    Integers(Vec<i32>),
}

impl Decoder {
    /// Decodes a group, which has so many values for so many points.
    fn group(
        &mut self,
        stream: &mut Reader,
        infos: &[Info],
        (count, points): (usize, usize),
        laid: Option<&Laid>,
        budget: &mut Budget,
    ) -> Decoded<()> {
        let mut all = Vec::new();
        for info in infos {
            budget.numbers(points.max(count), info.width)?;
            all.push(self.values(stream, info, count, laid)?);
        }
        for (info, values) in infos.iter().zip(all) {
            let bytes = match values {
                Values::Final(bytes) => bytes,
                Values::Integers(values) => finish(stream, info, &values)?,
            };
            let bytes = match laid {
                Some(laid) => at_points(&bytes, info.component.size() * info.width, &laid.of_points)?,
                None => bytes,
            };
            let Info { component, is_normalized, width, id, .. } = *info;
            self.attributes.push(Attribute { id, component, is_normalized, width, bytes });
        }
        Ok(())
    }

    /// Decodes the values of an attribute.
    fn values(&mut self, stream: &mut Reader, info: &Info, count: usize, laid: Option<&Laid>) -> Decoded<Values> {
        let is_first_position = info.is_position && !self.has_positions;
        self.has_positions |= info.is_position;
        if info.coding == Coding::Plain {
            let size = count.saturating_mul(info.component.size() * info.width);
            return Ok(Values::Final(stream.take(size)?.to_vec()));
        }
        let positions = || {
            let (known, laid) = self.positions.as_ref().zip(laid)?;
            let numbers = laid.points().map(|point| known.of_points[point as usize]).collect();
            Some(Positions { all: &known.all, numbers })
        };
        let values = integers(stream, info, count, laid, positions)?;
        if let Some(laid) = laid.filter(|_| is_first_position && info.integers_of_element() == 3) {
            self.positions = Some(KnownPositions { all: values.clone(), of_points: laid.of_points.clone() });
        }
        Ok(Values::Integers(values))
    }
}

/// The values of all points, of `size` bytes each.
fn at_points(bytes: &[u8], size: usize, of_points: &[u32]) -> Decoded<Vec<u8>> {
    let mut all = Vec::with_capacity(of_points.len() * size);
    for value in of_points {
        all.extend_from_slice(bytes.chunks_exact(size).nth(*value as usize).ok_or("a point has no value")?);
    }
    Ok(all)
}
