//! Tests of the sets of bodies, step by step.

use super::*;

const WATER: Body = Body::example(0, 1.33, 0.0, 8.0, false);
const GLASS: Body = Body::example(1, 1.5, 0.0, 1.0, false);
const MESH: Body = Body::example(2, 1.7, 0.0, 2.0, true);
/// The body is larger than the others, but fills first.
const FIRST: Body = Body::example(3, 2.4, 1.0, 99.0, false);

fn entered(media: &mut Media, bodies: &[&Body]) -> u32 {
    bodies.iter().fold(NONE, |set, body| media.changed(set, body, true))
}

fn left(media: &mut Media, set: u32, bodies: [&Body; 2]) -> u32 {
    bodies.iter().fold(set, |set, body| media.changed(set, body, false))
}

#[test]
fn the_smallest_fills_and_a_priority_goes_before() {
    let media = &mut Media::default();
    for order in [[&WATER, &GLASS, &MESH], [&MESH, &GLASS, &WATER], [&GLASS, &WATER, &MESH]] {
        let set = entered(media, &order);
        assert_eq!(media.eta(set), 1.5f32.into());
        let set = media.changed(set, &FIRST, true);
        assert_eq!(media.eta(set), 2.4f32.into());
        let set = left(media, set, [&GLASS, &FIRST]);
        assert_eq!(media.eta(set), 1.7f32.into());
        let set = left(media, set, [&WATER, &MESH]);
        assert_eq!((set, media.eta(set)), (NONE, 1.0));
    }
}

#[test]
fn of_equals_the_later_one_fills() {
    let (media, later) = (&mut Media::default(), Body::example(7, 1.2, 0.0, 1.0, false));
    for order in [[&GLASS, &later], [&later, &GLASS]] {
        let set = entered(media, &order);
        assert_eq!(media.eta(set), 1.2f32.into());
    }
}

#[test]
fn a_shape_is_in_a_set_once_a_mesh_as_often_as_it_was_entered() {
    let media = &mut Media::default();
    let set = entered(media, &[&GLASS, &GLASS, &MESH, &MESH]);
    assert_eq!((media.count(set, &GLASS), media.count(set, &MESH)), (1, 2));
    let set = left(media, set, [&GLASS, &GLASS]);
    assert_eq!(media.count(set, &GLASS), 0);
    // Inside out: the body is left first.
    let mut set = NONE;
    for (enters, count) in [(false, -1), (true, 0), (true, 1), (false, 0)] {
        set = media.changed(set, &MESH, enters);
        assert_eq!(media.count(set, &MESH), count);
    }
}

#[test]
fn sets_share_what_stays() {
    let media = &mut Media::default();
    let water = entered(media, &[&WATER]);
    let mark = media.mark();
    let both = media.changed(water, &GLASS, true);
    assert_eq!([media.eta(water), media.eta(both)], [1.33f32, 1.5].map(f64::from));
    assert_eq!(media.inside[both as usize].rest, water);
    media.release(mark);
    assert_eq!((media.eta(water), media.inside.len()), (1.33f32.into(), 1));
}

#[test]
fn what_is_met_tells_where_a_ray_is() {
    let media = &mut Media::default();
    let set = entered(media, &[&WATER, &GLASS]);
    let never = |_: &Body| -> i32 { panic!("nothing is in doubt") };
    // From inside and from outside; left behind; ahead.
    let only = entered(media, &[&GLASS]);
    assert_eq!(media.confirmed(only, Some((&GLASS, false)), never), only);
    assert_eq!(media.confirmed(only, Some((&GLASS, true)), never), NONE);
    let entered_unseen = media.confirmed(NONE, Some((&GLASS, false)), never);
    assert_eq!(media.count(entered_unseen, &GLASS), 1);
    let behind = media.confirmed(set, None, |body| i32::from(body.id == WATER.id));
    assert_eq!((media.count(behind, &GLASS), media.count(behind, &WATER)), (0, 1));
    assert_eq!(media.confirmed(set, Some((&GLASS, false)), |_| 1), set);
}

#[test]
fn a_doubtful_count_is_made_anew_once() {
    let media = &mut Media::default();
    let set = entered(media, &[&MESH]);
    assert_eq!(media.confirmed(set, None, |_| 5), set);
    let doubted = media.with(set, &MESH, |count, _| (count, true));
    let left = media.changed(doubted, &MESH, false);
    assert_eq!(media.count(left, &MESH), 0);
    let back = media.confirmed(left, None, |_| 1);
    assert_eq!((media.count(back, &MESH), media.confirmed(back, None, |_| 5)), (1, back));
    assert_eq!(media.confirmed(doubted, None, |_| 0), NONE);
}

fn met(primitive: u32, body: Option<Body>, outside: bool, opaque: bool) -> BoundaryHit {
    BoundaryHit { hit: Hit { primitive, ..Hit::none(1.0, 0.0) }, body, outside, opaque }
}

/// The coinciding surfaces that a ray in `set` crosses, with η on both sides of each.
fn row(media: &mut Media, mut all: Vec<BoundaryHit>, set: u32) -> (Vec<(u32, Option<f64>)>, u32) {
    let first = all[0].hit;
    all.sort_by_key(BoundaryHit::crossing_rank);
    let Boundary::At(mut at) = media.coinciding_boundary(&all, &first, set, &mut |_| ()) else { panic!() };
    let mut row = Vec::new();
    loop {
        let Crossing { hit, refraction, beyond, next, .. } = media.crossings[at as usize];
        row.push((hit.primitive, if let Refraction::Outer(eta) = refraction { Some(eta) } else { None }));
        if next == NONE {
            return (row, beyond);
        }
        at = next;
    }
}

#[test]
fn from_one_body_into_the_next_a_ray_is_bent_once() {
    let (water, glass) = (met(0, Some(WATER), false, false), met(1, Some(GLASS), true, false));
    for all in [vec![water, glass], vec![glass, water]] {
        let media = &mut Media::default();
        let set = entered(media, &[&WATER]);
        let (row, beyond) = row(media, all, set);
        assert_eq!(row, [(0, None), (1, Some(1.33f32.into()))]);
        assert_eq!((media.count(beyond, &WATER), media.count(beyond, &GLASS)), (0, 1));
    }
}

#[test]
fn what_stands_between_two_bodies_has_a_gap_around_it() {
    let (water, glass) = (met(0, Some(WATER), false, false), met(1, Some(GLASS), true, false));
    for (opaque, expected) in
        [(true, vec![(0, Some(1.0)), (2, Some(1.0))]), (false, vec![(0, Some(1.0)), (2, Some(1.0)), (1, Some(1.0))])]
    {
        let label = met(2, None, true, opaque);
        for all in [vec![water, glass, label], vec![label, glass, water], vec![glass, label, water]] {
            let media = &mut Media::default();
            let set = entered(media, &[&WATER]);
            assert_eq!(row(media, all, set).0, expected);
        }
    }
}

#[test]
fn two_halves_of_a_mesh_are_one() {
    let [left, entered_again] = [false, true].map(|outside| met(u32::from(outside), Some(MESH), outside, false));
    for all in [[left, entered_again], [entered_again, left]] {
        let media = &mut Media::default();
        let set = entered(media, &[&MESH]);
        let mut sorted = all.to_vec();
        sorted.sort_by_key(BoundaryHit::crossing_rank);
        // The faces are present. Nothing lies between them, and neither refracts the ray.
        let boundary = media.coinciding_boundary(&sorted, &all[0].hit, set, &mut |_| ());
        let beyond = match boundary {
            Boundary::Hidden(beyond) => beyond,
            Boundary::At(at) => {
                let next = media.crossings[at as usize].next;
                assert!(media.crossings[at as usize].refraction == Refraction::Straight);
                assert!(media.crossings[next as usize].refraction == Refraction::Outer(1.7f32.into()));
                media.crossings[next as usize].beyond
            }
            Boundary::Plain => panic!(),
        };
        assert_eq!(media.count(beyond, &MESH), 1);
    }
}
