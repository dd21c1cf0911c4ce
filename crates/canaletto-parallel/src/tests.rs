use crate::for_ranges;
use crate::prelude::*;
use std::sync::Mutex;

fn in_pools(test: impl Fn() + Sync) {
    for threads in [1, 2, 7] {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(&test);
    }
}

#[test]
fn ranges_hold_each_index_once_and_no_fewer_than_asked() {
    in_pools(|| {
        for (len, least) in [(0, 1), (1, 1), (5, 10), (1000, 1), (1000, 64), (999, 1000)] {
            let ranges = Mutex::new(Vec::new());
            for_ranges(len, least, &|range| ranges.lock().unwrap().push(range));
            let mut ranges = ranges.into_inner().unwrap();
            ranges.sort_by_key(|range| range.start);
            assert!(ranges.iter().all(|range| range.len() >= least.min(len)), "{ranges:?}");
            assert!(ranges.into_iter().flatten().eq(0..len), "{len} {least}");
        }
    });
}

#[test]
fn loops_do_what_plain_iterators_do() {
    let items: Vec<u64> = (0..1000).map(|i| i * i % 997).collect();
    in_pools(|| {
        let words: Vec<String> = items.par_iter().map(u64::to_string).collect();
        assert!(words.iter().eq(&items.iter().map(u64::to_string).collect::<Vec<_>>()));
        let even = |&item: &u64| item.is_multiple_of(2).then_some(item);
        assert_eq!(
            items.par_iter().with_min_len(3).filter_map(even).collect(),
            items.iter().filter_map(even).collect::<Vec<_>>()
        );
        assert_eq!(items.par_iter().filter_map(even).count(), items.iter().filter_map(even).count());
        let joined = items.par_iter().map(u64::to_string).reduce(String::new, |a, b| a + "," + &b);
        let commas =
            |text: &str| text.split(',').filter(|part| !part.is_empty()).map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(commas(&joined), words);
        assert_eq!(items.par_iter().position_first(|&item| item > 990), items.iter().position(|&item| item > 990));
        assert_eq!(items.par_iter().find_first(|&&item| item > 990), items.iter().find(|&&item| item > 990));
        assert!(items.par_iter().any(|&item| item == 996) == items.contains(&996));
        assert!(items.par_iter().all(|&item| item < 997));
        assert_eq!((3..11usize).into_par_iter().map(|i| i).collect(), (3..11).collect::<Vec<_>>());
        assert_eq!((3..11u32).into_par_iter().map(|i| i).collect(), (3..11).collect::<Vec<_>>());
        let moved: Vec<String> = words.clone().into_par_iter().map(|word| word + "!").collect();
        assert!(moved.iter().zip(&words).all(|(moved, word)| moved.strip_suffix('!') == Some(word)));
        assert_eq!(items.par_chunks(7).map(<[u64]>::len).sum(), items.len());
    });
}

#[test]
fn each_mutable_item_is_handed_out_once() {
    in_pools(|| {
        let mut items = vec![0u32; 1001];
        items.par_iter_mut().enumerate().for_each(|(index, item)| *item += index as u32);
        assert!(items.iter().copied().eq(0..1001));
        let add = |part: &mut [u32], more: &[u32]| part.iter_mut().zip(more).for_each(|(item, more)| *item += more);
        let more = items.clone();
        items.par_chunks_mut(10).zip(more.par_chunks(10)).for_each(|(part, more)| add(part, more));
        assert!(items.iter().copied().eq((0..1001).map(|i| 2 * i)));
        items.par_chunks_mut(64).enumerate().for_each_init(Vec::new, |buffer, (index, part)| {
            buffer.push(index);
            part.fill(*buffer.last().unwrap() as u32);
        });
        assert!(items.iter().enumerate().all(|(i, &item)| item as usize == i / 64));
    });
}

#[test]
fn panics_of_loops_are_passed_on() {
    let caught = std::panic::catch_unwind(|| {
        (0..100u32).into_par_iter().map(|i| assert_ne!(i, 50)).collect();
    });
    assert!(caught.is_err());
}
