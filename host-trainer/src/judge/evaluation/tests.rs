use super::*;

#[test]
fn a_table_is_what_the_paper_defines() {
    // Two realizations; the first six preferences bring (10, -2) and (30, -4), the others (50, -40) and (70, -60).
    let low = vec![[10.0, -2.0], [30.0, -4.0]];
    let high = vec![[50.0, -40.0], [70.0, -60.0]];
    let table = Missions((0..11).map(|i| if i < 6 { low.clone() } else { high.clone() }).collect()).table();
    assert_eq!((table.coverage(), table.least_energy(), table.least_energy_std()), (60.0, 3.0, 1.0));
    assert_eq!((table.rows[10].data_std, table.rows[10].energy), (10.0, 50.0));
    // Mean points (20, -3) and (60, -50) above (-1, -200).
    assert!((table.hypervolume - (61.0 * 150.0 + 21.0 * 47.0)).abs() < 1e-3, "{}", table.hypervolume);
    let of_each = [51.0 * 160.0 + 11.0 * 38.0, 71.0 * 140.0 + 31.0 * 56.0];
    assert!((table.mean_hypervolume - (of_each[0] + of_each[1]) / 2.0).abs() < 1e-3);
    // Sum of w over the two halves: 1.5 and 4.0; of 1 - w: 4.5 and 1.0.
    let utility = (1.5 * 20.0 - 4.5 * 3.0 + 4.0 * 60.0 - 1.0 * 50.0) / 11.0;
    assert!((table.utility - utility).abs() < 1e-4, "{} {utility}", table.utility);
}
