//! Differences of two pictures besides red, green and blue: alpha, layers, windows and declared transfer curves.

use super::compare::distance;
use super::{Channel, Decoded, Image, Window};
use canaletto::film::srgb_encode;
use canaletto::scene::Transfer;
use std::borrow::Cow;
use std::collections::BTreeSet;

/// The difference of a channel between two pictures.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct ChannelDifference {
    /// The channel's name, such as `A` or `depth.Z`.
    pub channel: String,
    /// The number of pixels that differ.
    pub differing: u64,
    /// The largest difference.
    pub max: f64,
    /// The column and the row of the first pixel with the largest difference.
    pub at: [u32; 2],
}

/// The differences of two pictures besides red, green and blue.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RestDifference {
    /// The channels that both pictures have and that differ. A picture without alpha is opaque.
    pub channels: Vec<ChannelDifference>,
    /// The channels that only the first picture has, and only the second.
    pub only: [Vec<String>; 2],
    /// The positions in a larger picture, if they differ.
    pub windows: Option<[Window; 2]>,
    /// The transfer curves that both pictures declare, if they differ.
    pub curves: Option<[Transfer; 2]>,
    /// Colours in linear light that differ although their display values are equal: below 0, above 1, or by less than
    /// the rounding of the curve.
    pub unseen: Option<ChannelDifference>,
    /// The pixels that differ in any of the channels or in unseen colours, the top row first.
    pub pixels: Vec<bool>,
}

impl RestDifference {
    /// Compares the contents of two pictures of equal size, except red, green and blue.
    pub fn of(a: &Decoded, b: &Decoded) -> RestDifference {
        let opaque = |image: &Image| Channel::new("A", vec![1.0; image.pixels()]);
        let has_alpha = a.image.channel("A").is_some() || b.image.channel("A").is_some();
        let pixels = vec![false; a.image.pixels()];
        let mut rest = RestDifference { pixels, ..RestDifference::default() };
        for channel in others(&a.image) {
            match b.image.channels.iter().find(|other| other.name == channel.name) {
                Some(other) => rest.add(a.image.width, channel, other),
                None => rest.only[0].push(channel.name.clone()),
            }
        }
        let in_b = others(&b.image).filter(|channel| a.image.channel(&channel.name).is_none());
        rest.only[1].extend(in_b.map(|channel| channel.name.clone()));
        if has_alpha {
            let [alpha_a, alpha_b] = [&a.image, &b.image].map(|image| {
                let alpha = image.channels.iter().find(|channel| channel.name == "A");
                alpha.map_or_else(|| Cow::Owned(opaque(image)), Cow::Borrowed)
            });
            rest.add(a.image.width, &stored_like(alpha_a, a, b), &stored_like(alpha_b, b, a));
        }
        // Only scene-referred files declare the position of a crop.
        let placed = !a.display_referred && !b.display_referred;
        rest.windows = (placed && a.window != b.window).then_some([a.window, b.window]);
        rest.curves = match (a.transfer, b.transfer) {
            (Some(curve_a), Some(curve_b)) if curve_a != curve_b && a.display_referred == b.display_referred => {
                Some([curve_a, curve_b])
            }
            _ => None,
        };
        rest
    }

    /// Whether there are no differences.
    pub fn is_none(&self) -> bool {
        self.channels.is_empty()
            && self.only.iter().all(Vec::is_empty)
            && self.windows.is_none()
            && self.curves.is_none()
            && self.unseen.is_none()
    }

    /// Adds unseen differences of colours, if both pictures hold linear light.
    pub fn add_unseen(&mut self, a: &Decoded, b: &Decoded) {
        let (Some(colors_a), Some(colors_b)) = (a.image.rgb(), b.image.rgb()) else { return };
        if a.display_referred || b.display_referred || a.image.pixels() != b.image.pixels() {
            return;
        }
        self.pixels.resize(a.image.pixels(), false);
        let seen = |v: f32| if v.is_nan() { v } else { srgb_encode(v.clamp(0.0, 1.0)) };
        let mut found = ChannelDifference { channel: String::new(), differing: 0, max: 0.0, at: [0, 0] };
        for (index, differs) in self.pixels.iter_mut().enumerate() {
            let mut unseen = false;
            for (name, (va, vb)) in ["R", "G", "B"].iter().zip(colors_a.iter().zip(colors_b)) {
                let (va, vb) = (va[index], vb[index]);
                let value = distance(va, vb);
                if value == 0.0 || distance(seen(va), seen(vb)) > 0.0 {
                    continue;
                }
                unseen = true;
                if value > found.max {
                    let at = [index as u32 % a.image.width, index as u32 / a.image.width];
                    found = ChannelDifference { channel: (*name).into(), max: value, at, ..found };
                }
            }
            *differs |= unseen;
            found.differing += u64::from(unseen);
        }
        self.unseen = (found.differing > 0).then_some(found);
    }

    fn add(&mut self, width: u32, a: &Channel, b: &Channel) {
        let mut found = ChannelDifference { channel: a.name.clone(), differing: 0, max: 0.0, at: [0, 0] };
        for (index, differs) in self.pixels.iter_mut().enumerate() {
            let value = distance(a.value(index), b.value(index));
            if value > 0.0 {
                *differs = true;
                found.differing += 1;
            }
            if value > found.max {
                found.max = value;
                found.at = [index as u32 % width, index as u32 / width];
            }
        }
        if found.differing > 0 {
            self.channels.push(found);
        }
    }
}

/// An alpha rounded to the levels of the other picture, if that one has display values and this one hasn't.
fn stored_like<'a>(mut alpha: Cow<'a, Channel>, own: &Decoded, other: &Decoded) -> Cow<'a, Channel> {
    if other.display_referred && !own.display_referred {
        let steps = if other.bits > 8 { 65535.0 } else { 255.0 };
        alpha.to_mut().data.iter_mut().for_each(|v| *v = (v.clamp(0.0, 1.0) * steps).round() / steps);
    }
    alpha
}

/// The channels other than the picture's own colours and alpha.
fn others(image: &Image) -> impl Iterator<Item = &Channel> {
    image.channels.iter().filter(|channel| !is_own(&channel.name))
}

fn is_own(name: &str) -> bool {
    ["R", "G", "B", "Y", "A"].contains(&name)
}

impl Decoded {
    /// The layers that can be displayed as a picture, by their prefix as in `NAME.R`, and channels without a layer,
    /// such as `Z`. The picture's own colours are no layer.
    pub fn layers(&self) -> Vec<String> {
        let has_colors = self.image.rgb().is_some();
        let named = self.image.channels.iter().filter_map(|channel| match channel.name.rsplit_once('.') {
            Some((layer, _)) => Some(layer.to_owned()),
            None => (!has_colors || !is_own(&channel.name)).then(|| channel.name.clone()),
        });
        named.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The picture with the channels of a layer as its colours. `R G B A` keep their names. `X Y Z` and others become
    /// red, green and blue in their order. A single channel becomes grey, as does a channel named `layer`. Returns
    /// `None` if there is no such layer.
    #[must_use]
    pub fn with_layer(mut self, layer: &str) -> Option<Decoded> {
        let inner = |channel: &Channel| match channel.name.strip_prefix(layer)? {
            "" => Some("X".to_owned()),
            rest => Some(rest.strip_prefix('.')?.to_owned()),
        };
        let mut own: Vec<(String, Channel)> = Vec::new();
        self.image.channels.retain(|channel| match inner(channel).filter(|name| !name.contains('.')) {
            Some(name) => {
                own.push((name, channel.clone()));
                false
            }
            None => true,
        });
        if own.is_empty() {
            return None;
        }
        // The previous colours remain as a layer of their own.
        self.image.channels.retain(|channel| channel.name.contains('.'));
        let is_color = own.iter().any(|(name, _)| name == "R");
        // Files store their channels in alphabetical order: B G R, and U V, X Y Z.
        own.sort_by(|(a, _), (b, _)| a.cmp(b));
        let names: &[&str] = match own.len() {
            1 => &["Y"],
            _ => &["R", "G", "B", "A"],
        };
        let mut next = names.iter();
        for (name, channel) in own {
            let name = if is_color { Some(name) } else { next.next().map(|name| (*name).to_owned()) };
            if !channel.ids.is_empty() {
                // The integer channel stays besides, because the colour is rounded.
                self.image.channels.push(channel.clone());
            }
            if let Some(name) = name {
                self.image.channels.push(Channel::new(name, channel.data));
            }
        }
        if !is_color && self.image.rgb().is_none() {
            let zeros = vec![0.0; self.image.pixels()];
            for name in ["G", "B"] {
                if self.image.channel(name).is_none() {
                    self.image.channels.push(Channel::new(name, zeros.clone()));
                }
            }
        }
        Some(self)
    }

    /// The layer whose colours represent a picture without colours of its own. It is the only layer with red, green and
    /// blue, or else the one that programs name as the beauty pass.
    pub fn main_layer(&self) -> Option<String> {
        let has = |layer: &str, name: &str| self.image.channel(&format!("{layer}.{name}")).is_some();
        let mut colored: Vec<String> = self.layers();
        colored.retain(|layer| has(layer, "R") && has(layer, "G") && has(layer, "B"));
        let beauty = |layer: &&String| {
            let last = layer.rsplit('.').next().unwrap_or_default().to_lowercase();
            ["combined", "rgba", "rgb", "beauty"].contains(&last.as_str())
        };
        match &colored[..] {
            [only] => Some(only.clone()),
            all => all.iter().find(beauty).cloned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(channels: &[(&str, f32)]) -> Decoded {
        let channels = channels.iter().map(|(name, v)| Channel::new(*name, vec![*v; 4])).collect();
        Decoded {
            image: Image { width: 2, height: 2, channels },
            bits: 32,
            transfer: Some(Transfer::None),
            metadata: Vec::new(),
            window: Window::whole(2, 2),
            left_out: Vec::new(),
            is_changed: false,
            display_referred: false,
        }
    }

    const RGB: [(&str, f32); 3] = [("R", 0.1), ("G", 0.2), ("B", 0.3)];

    #[test]
    fn numbers_that_f32_rounds_are_compared_themselves() {
        let of = |id: u32| {
            let mut decoded = decoded(&[("object_id.X", id as f32)]);
            decoded.image.channels[0].ids = vec![id; 4];
            decoded
        };
        let (a, b) = (of(1 << 24), of((1 << 24) + 1));
        assert!(RestDifference::of(&a, &a).is_none());
        assert_eq!(RestDifference::of(&a, &b).channels[0].max, 1.0);
        let shown = |of: &Decoded| of.clone().with_layer("object_id").unwrap();
        assert_eq!(RestDifference::of(&shown(&a), &shown(&b)).channels[0].differing, 4);
    }

    #[test]
    fn alpha_layers_places_and_curves_are_told() {
        let plain = decoded(&RGB);
        assert!(RestDifference::of(&plain, &plain).is_none());
        let opaque = decoded(&[&RGB[..], &[("A", 1.0)]].concat());
        assert!(RestDifference::of(&plain, &opaque).is_none(), "a picture without alpha is opaque");
        let mut half = opaque.clone();
        half.image.channels[3].data[3] = 0.5;
        let rest = RestDifference::of(&plain, &half);
        assert_eq!(rest.channels, [ChannelDifference { channel: "A".into(), differing: 1, max: 0.5, at: [1, 1] }]);
        let near = decoded(&[&RGB[..], &[("depth.Z", 1.0)]].concat());
        let far = decoded(&[&RGB[..], &[("depth.Z", 2.0), ("uv.U", 0.0)]].concat());
        let rest = RestDifference::of(&near, &far);
        assert_eq!(
            (rest.channels[0].channel.as_str(), &rest.pixels[..], rest.channels[0].max),
            ("depth.Z", &[true; 4][..], 1.0)
        );
        assert_eq!(rest.only, [vec![], vec!["uv.U".to_owned()]]);
        assert_eq!(RestDifference::of(&far, &near).only, [vec!["uv.U".to_owned()], vec![]]);
        let moved = Decoded { window: Window { at: [1, 0], whole: [4, 4] }, ..plain.clone() };
        assert_eq!(RestDifference::of(&plain, &moved).windows, Some([plain.window, moved.window]));
        let srgb = Decoded { transfer: Some(Transfer::Srgb), ..plain.clone() };
        assert_eq!(RestDifference::of(&plain, &srgb).curves, Some([Transfer::None, Transfer::Srgb]));
    }

    #[test]
    fn layers_become_pictures() {
        let blender = decoded(&[
            ("ViewLayer.Combined.A", 1.0),
            ("ViewLayer.Combined.B", 0.3),
            ("ViewLayer.Combined.G", 0.2),
            ("ViewLayer.Combined.R", 0.1),
            ("ViewLayer.Depth.Z", 7.0),
            ("ViewLayer.DiffCol.B", 0.0),
            ("ViewLayer.DiffCol.G", 0.0),
            ("ViewLayer.DiffCol.R", 0.0),
        ]);
        assert_eq!(blender.main_layer().as_deref(), Some("ViewLayer.Combined"));
        let red = |layer: &str| blender.clone().with_layer(layer).map(|d| d.image.rgb().unwrap().map(|c| c[0]));
        assert_eq!(red("ViewLayer.Combined"), Some([0.1, 0.2, 0.3]));
        assert_eq!(red("ViewLayer.Depth"), Some([7.0; 3]));
        assert_eq!((red("ViewLayer"), red("Depth")), (None, None));
        let normal = decoded(&[("n.X", 1.0), ("n.Y", 2.0), ("n.Z", 3.0), ("uv.U", 4.0), ("uv.V", 5.0)]);
        let of = |layer: &str| normal.clone().with_layer(layer).unwrap().image.rgb().unwrap().map(|c| c[0]);
        assert_eq!((of("n"), of("uv")), ([1.0, 2.0, 3.0], [4.0, 5.0, 0.0]));
        assert_eq!(normal.layers(), ["n", "uv"]);
    }

    #[test]
    fn a_channel_without_a_layer_is_one_by_itself() {
        let picture = decoded(&[&RGB[..], &[("Z", 7.0), ("n.X", 1.0)]].concat());
        assert_eq!(picture.layers(), ["Z", "n"]);
        let depth = picture.clone().with_layer("Z").unwrap();
        assert_eq!(depth.image.rgb().unwrap().map(|c| c[0]), [7.0; 3]);
        assert_eq!(decoded(&[("R", 1.0), ("G", 2.0)]).layers(), ["G", "R"], "not all of a picture's colours");
        assert_eq!(
            decoded(&[("R", 1.0), ("G", 2.0)]).with_layer("G").unwrap().image.rgb().unwrap().map(|c| c[0]),
            [2.0; 3]
        );
    }

    #[test]
    fn colours_that_are_seen_alike_may_differ() {
        let unseen = |a: f32, b: f32| {
            let [a, b] = [a, b].map(|v| decoded(&[("R", v), ("G", 0.2), ("B", 0.3)]));
            let mut rest = RestDifference::of(&a, &b);
            rest.add_unseen(&a, &b);
            assert_eq!(rest.is_none(), rest.unseen.is_none());
            assert_eq!(rest.pixels, [rest.unseen.is_some(); 4]);
            rest.unseen.map(|found| (found.channel, found.differing, found.max))
        };
        assert_eq!(unseen(5.0, 9.0), Some(("R".into(), 4, 4.0)));
        assert_eq!(unseen(-1.0, -2.0), Some(("R".into(), 4, 1.0)));
        assert_eq!(unseen(f32::INFINITY, 2.0), Some(("R".into(), 4, f64::INFINITY)));
        assert_eq!((unseen(5.0, 5.0), unseen(0.5, 0.6), unseen(0.5, 9.0)), (None, None, None), "equal, or seen");
    }
}
