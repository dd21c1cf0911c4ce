//! Packing of rectangles by their skyline: each one goes to the lowest place, and of those to the leftmost (Jylänki,
//! *A Thousand Ways to Pack the Bin*, 2010, bottom-left skyline).

/// A part of the skyline: the height of what lies below it.
#[derive(Clone, Copy, Debug)]
struct Step {
    x: u32,
    width: u32,
    y: u32,
}

/// A rectangle that is being filled from below.
struct Skyline {
    size: [u32; 2],
    steps: Vec<Step>,
}

impl Skyline {
    fn new(size: [u32; 2]) -> Skyline {
        Skyline { size, steps: vec![Step { x: 0, width: size[0], y: 0 }] }
    }

    /// Places a rectangle; returns its corner.
    fn place(&mut self, [width, height]: [u32; 2]) -> Option<[u32; 2]> {
        let mut best: Option<(u32, usize)> = None;
        for (first, step) in self.steps.iter().enumerate() {
            if step.x + width > self.size[0] {
                break;
            }
            let below = self.steps[first..].iter().take_while(|below| below.x < step.x + width);
            let y = below.map(|below| below.y).max().unwrap_or(0);
            if y + height <= self.size[1] && best.is_none_or(|(lowest, _)| y < lowest) {
                best = Some((y, first));
            }
        }
        let (y, first) = best?;
        let x = self.steps[first].x;
        let end = x + width;
        let mut last = first;
        while last < self.steps.len() && self.steps[last].x + self.steps[last].width <= end {
            last += 1;
        }
        if let Some(cut) = self.steps.get_mut(last) {
            cut.width = cut.x + cut.width - end;
            cut.x = end;
        }
        self.steps.splice(first..last, [Step { x, width, y: y + height }]);
        Some([x, y])
    }
}

/// The places of rectangles in a larger one of this size; `None` if they don't fit.
pub(super) fn pack(rectangles: &[[u32; 2]], size: [u32; 2]) -> Option<Vec<[u32; 2]>> {
    let area = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
    if rectangles.iter().map(|&rectangle| area(rectangle)).sum::<u64>() > area(size) {
        return None;
    }
    let mut order: Vec<usize> = (0..rectangles.len()).collect();
    // The highest first, then the widest.
    order.sort_by_key(|&i| (std::cmp::Reverse(rectangles[i][1]), std::cmp::Reverse(rectangles[i][0]), i));
    let mut skyline = Skyline::new(size);
    let mut places = vec![[0; 2]; rectangles.len()];
    for i in order {
        places[i] = skyline.place(rectangles[i])?;
    }
    Some(places)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_lie_inside_and_apart() {
        let mut state = 7_u32;
        let mut random = |most: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1 + (state >> 16) % most
        };
        let rectangles: Vec<[u32; 2]> = (0..300).map(|_| [random(20), random(12)]).collect();
        let area: u32 = rectangles.iter().map(|[w, h]| w * h).sum();
        let side = (f64::from(area) * 1.25).sqrt() as u32;
        let places = pack(&rectangles, [side, side]).expect("four fifths can be filled");
        let mut taken = vec![false; (side * side) as usize];
        for ([x, y], [width, height]) in places.into_iter().zip(rectangles) {
            for (i, j) in (y..y + height).flat_map(|j| (x..x + width).map(move |i| (i, j))) {
                assert!(i < side && j < side, "{i} {j}");
                assert!(!std::mem::replace(&mut taken[(j * side + i) as usize], true));
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert_eq!(pack(&[[4, 4]], [4, 4]), Some(vec![[0, 0]]));
        assert_eq!(pack(&[[4, 5]], [5, 4]), None);
        assert_eq!(pack(&[[3, 3], [3, 3]], [5, 5]), None);
    }
}
