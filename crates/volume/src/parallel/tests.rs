use std::sync::atomic::{AtomicUsize, Ordering};

use super::prelude::*;
use super::{ThreadPool, ThreadPoolBuilder};

/// Lengths around those at which the number of pieces changes.
const LENGTHS: [usize; 9] = [0, 1, 2, 7, 15, 16, 17, 1000, 12345];

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")
}

/// Runs a check on one thread and on several.
fn on_threads(check: impl Fn() + Sync) {
    [1, 2, 5].into_iter().for_each(|threads| pool(threads).install(&check));
}

#[test]
fn items_keep_their_order() {
    on_threads(|| {
        for length in LENGTHS {
            let all: Vec<u32> = (0..length as u32).collect();
            let squares = |items: &[u32]| items.iter().map(|item| item.wrapping_mul(*item)).collect::<Vec<_>>();
            assert_eq!(all.par_iter().map(|item| item.wrapping_mul(*item)).collect::<Vec<_>>(), squares(&all));
            assert_eq!(all.par_iter().map(|item| item.wrapping_mul(*item)).numbers(), squares(&all));
            assert_eq!(all.par_iter().copied().collect::<Vec<_>>(), all);
            assert_eq!(all.clone().into_par_iter().collect::<Vec<_>>(), all);
            assert_eq!((0..length as u32).into_par_iter().collect::<Vec<_>>(), all);
            let thirds = |item: &&u32| item.is_multiple_of(3);
            assert!(all.par_iter().filter(thirds).collect::<Vec<_>>().into_iter().eq(all.iter().filter(thirds)));
            let twice = |&item: &u32| [item, item];
            assert!(all.par_iter().flat_map_iter(twice).collect::<Vec<_>>().into_iter().eq(all.iter().flat_map(twice)));
            assert!(all.par_iter().enumerate().all(|(number, &item)| number == item as usize));
            assert!(all.par_iter().zip(0..u32::MAX).all(|(&item, number)| number == item));
        }
    });
}

#[test]
fn items_are_changed_in_place() {
    on_threads(|| {
        for length in LENGTHS {
            let mut all = vec![0; length];
            all.par_iter_mut().enumerate().for_each(|(number, item)| *item = number);
            assert!(all.iter().copied().eq(0..length));
            all.par_chunks_mut(7).enumerate().for_each(|(chunk, items)| {
                assert_eq!(items.len(), 7.min(length - 7 * chunk));
                items.iter_mut().for_each(|item| *item -= 7 * chunk);
            });
            assert!(all.par_chunks(7).all(|chunk| chunk.iter().copied().eq(0..chunk.len())));
            assert_eq!(all.par_chunks(7).count(), length.div_ceil(7));
        }
    });
}

#[test]
fn items_are_joined() {
    on_threads(|| {
        for length in LENGTHS {
            let numbers = || (0..length).into_par_iter();
            let sum = (0..length).sum::<usize>();
            assert_eq!(numbers().sum::<usize>(), sum);
            assert_eq!(numbers().reduce(|| 0, |a, b| a + b), sum);
            assert_eq!(numbers().fold(|| 0, |a, b| a + b).reduce(|| 0, |a, b| a + b), sum);
            assert_eq!(numbers().reduce_with(usize::max), length.checked_sub(1));
            assert_eq!(numbers().map(|number| length - number).min(), (length > 0).then_some(1));
            assert_eq!(numbers().any(|number| number + 1 == length), length > 0);
            assert_eq!(numbers().filter(|number| number % 2 == 1).count(), length / 2);
        }
    });
}

#[test]
fn the_first_failure_is_told() {
    on_threads(|| {
        let below = |limit| {
            (0..1000_u32).into_par_iter().map(move |number| if number < limit { Ok(number) } else { Err(number) })
        };
        assert_eq!(below(1000).collect::<Result<Vec<_>, _>>(), Ok((0..1000).collect()));
        assert_eq!(below(300).collect::<Result<Vec<_>, _>>(), Err(300));
        assert_eq!(below(300).map(Result::ok).collect::<Option<Vec<_>>>(), None);
        assert_eq!(below(1000).map(Result::ok).collect::<Option<Vec<_>>>(), Some((0..1000).collect()));
    });
}

/// How many pieces a loop is divided into by four threads.
fn pieces(of: impl Fn(&AtomicUsize) + Sync) -> usize {
    let begun = AtomicUsize::new(0);
    pool(4).install(|| of(&begun));
    begun.into_inner()
}

#[test]
fn pieces_have_the_lengths_that_are_asked_for() {
    let begin = |begun: &AtomicUsize| begun.fetch_add(1, Ordering::Relaxed);
    assert_eq!(pieces(|begun| (0..1000_u32).into_par_iter().for_each_init(|| begin(begun), |_, _| ())), 32);
    assert_eq!(
        pieces(|begun| (0..1000_u32).into_par_iter().with_min_len(300).for_each_init(|| begin(begun), |_, _| ())),
        3
    );
    assert_eq!(
        pieces(|begun| (0..1000_u32).into_par_iter().with_max_len(1).for_each_init(|| begin(begun), |_, _| ())),
        1000
    );
}

#[test]
#[should_panic(expected = "as the test says")]
fn a_panic_reaches_the_caller() {
    pool(3).install(|| (0..100_u32).into_par_iter().for_each(|number| assert_ne!(number, 77, "as the test says")));
}
