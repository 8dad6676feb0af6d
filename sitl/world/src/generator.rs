//! Random cities.

use crate::seed::{below, city_rng, open_unit};
use core::ops::Range;
use gleaner_units::{Cell, Grid, HeightMap, Metres};
use rand::Rng;

const WIDTH: u16 = 40;
const HEIGHT: u16 = 30;
/// Widths of the streets, in this order and again.
const STREETS: [i16; 4] = [1, 2, 1, 3];
/// A block is 3 to 6 cells wide.
const BLOCK_MIN: i16 = 3;
const BLOCK_CHOICES: u32 = 4;
/// One lot in this many (12 %) stays empty.
const EMPTY_LOT: f32 = 0.12;
const LOWEST_M: f32 = 6.0;
const MEAN_ABOVE_LOWEST_M: f32 = 15.0;
const TALLEST_M: f32 = 50.0;

/// The heights of the random city with this number; `cell` is the side of its cells.
pub(crate) fn heights(seed: u64, cell: Metres) -> HeightMap {
    let grid = Grid::new(WIDTH, HEIGHT, cell).expect("the size is a valid constant");
    let mut rng = city_rng(seed);
    let mut map = HeightMap::flat(grid);
    let columns = blocks(&mut rng, WIDTH as i16);
    let rows = blocks(&mut rng, HEIGHT as i16);
    for y in &rows {
        for x in &columns {
            build(&mut rng, &mut map, x.clone(), y.clone());
        }
    }
    map
}

/// The blocks along one side: streets and blocks in turn. The first street is drawn at random, and a block that crosses the
/// edge is cut.
fn blocks(rng: &mut impl Rng, side: i16) -> Vec<Range<i16>> {
    let mut blocks = Vec::new();
    let mut turn = below(rng, STREETS.len() as u32) as usize;
    let mut at = 0;
    loop {
        at += STREETS[turn % STREETS.len()];
        turn += 1;
        if at >= side {
            return blocks;
        }
        let end = at + BLOCK_MIN + below(rng, BLOCK_CHOICES) as i16;
        blocks.push(at..end.min(side));
        at = end;
    }
}

/// Splits a lot across its longer side until it is small, then builds on it. Lots of more than three cells a side are
/// always split, lots of one cell never, the others every other time.
fn build(rng: &mut impl Rng, map: &mut HeightMap, x: Range<i16>, y: Range<i16>) {
    let (width, depth) = (x.end - x.start, y.end - y.start);
    let longer = width.max(depth);
    if longer > 3 || (longer > 1 && open_unit(rng) < 0.5) {
        let cut = 1 + below(rng, longer as u32 - 1) as i16;
        if width >= depth {
            build(rng, map, x.start..x.start + cut, y.clone());
            build(rng, map, x.start + cut..x.end, y);
        } else {
            build(rng, map, x.clone(), y.start..y.start + cut);
            build(rng, map, x, y.start + cut..y.end);
        }
    } else if open_unit(rng) >= EMPTY_LOT {
        let height_m = LOWEST_M - MEAN_ABOVE_LOWEST_M * libm::logf(open_unit(rng));
        let height_m = libm::roundf(height_m.min(TALLEST_M)) as u8;
        for cell in y.flat_map(|y| x.clone().map(move |x| Cell::new(x, y))) {
            map.set(cell, height_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: Metres = Metres(20.0);

    #[test]
    fn every_seed_gives_a_city_like_the_default_one() {
        let mut heights_m = Vec::new();
        for seed in 0..300 {
            let map = heights(seed, CELL);
            let built = map.as_slice().iter().filter(|&&height_m| height_m > 0).count() as f32 / 1200.0;
            assert!((0.28..0.60).contains(&built), "city {seed} is {built} built");
            assert!(
                map.as_slice().iter().all(|&height_m| height_m == 0 || (6..=50).contains(&height_m)),
                "city {seed}"
            );
            heights_m.extend(
                map.as_slice().iter().filter(|&&height_m| height_m > 0).map(|&height_m| f32::from(height_m)),
            );
        }
        let mean_m = heights_m.iter().sum::<f32>() / heights_m.len() as f32;
        // 6 + 15 (1 - exp(-44 / 15)) = 20.2.
        assert!((mean_m - 20.2).abs() < 0.5, "{mean_m}");
    }

    #[test]
    fn streets_run_through_the_whole_city() {
        for seed in 0..50 {
            let map = heights(seed, CELL);
            let open = |cell: Cell| map.height_m(cell) == Some(0);
            assert!((0..40).filter(|&x| (0..30).all(|y| open(Cell::new(x, y)))).count() >= 4, "city {seed}");
            assert!((0..30).filter(|&y| (0..40).all(|x| open(Cell::new(x, y)))).count() >= 3, "city {seed}");
        }
    }
}
