//! Makes a solution shorter: some robots are taken out and put back on the soonest ways between all others, one after
//! the other (large neighbourhood search: Li, Chen, Harabor, Stuckey and Koenig, "Anytime multi-agent path finding via
//! large neighborhood search", IJCAI 2021). What is no shorter is undone, so a solution never becomes longer.

use super::timetable::Timetable;

/// Robots that are taken out at a time at most.
const GROUP_MAX: usize = 4;

/// Tries so many groups of robots.
pub(super) fn refine(table: &mut Timetable<'_>, tries: u32) {
    let robots = table.ways().len();
    // Robots that are late begin a group in turn.
    let mut late: Vec<usize> = Vec::new();
    let mut fruitless = 0;
    for number in 0..tries {
        if late.is_empty() {
            if fruitless > GROUP_MAX {
                return;
            }
            fruitless += 1;
            late = (0..robots).filter(|robot| table.delay(*robot) > 0).collect();
            late.sort_by_key(|robot| table.delay(*robot));
        }
        let Some(first) = late.pop() else { return };
        if reroute(table, group_of(table, first, number)) {
            fruitless = 0;
        }
    }
}

/// A robot, and others: those in its way, and some more.
fn group_of(table: &Timetable<'_>, first: usize, number: u32) -> Vec<usize> {
    let robots = table.ways().len();
    let size = 1 + number as usize % GROUP_MAX;
    let mut group = vec![first];
    let in_the_way = table.in_the_way(first);
    let turned = in_the_way.len().max(1);
    let in_turn = in_the_way.iter().cycle().skip(number as usize % turned).take(in_the_way.len());
    let others = (0..robots).map(|step| (first + 1 + step * (1 + number as usize % 7)) % robots);
    for robot in in_turn.copied().chain(others) {
        if group.len() < size && !group.contains(&robot) {
            group.push(robot);
        }
    }
    group
}

/// Whether robots arrive sooner in all, put back in this order. If not, nothing changes.
fn reroute(table: &mut Timetable<'_>, group: Vec<usize>) -> bool {
    let mut left: u32 = group.iter().map(|robot| table.arrival(*robot)).sum();
    // Robots that come later take as long as if they were alone at least.
    let alone: Vec<u32> = group.iter().map(|robot| table.arrival(*robot) - table.delay(*robot)).collect();
    let mut rest: u32 = alone.iter().sum();
    let old: Vec<Vec<u32>> = group.iter().map(|robot| table.take_out(*robot)).collect();
    for (number, robot) in group.iter().enumerate() {
        rest -= alone[number];
        let way = left.checked_sub(rest).and_then(|before| table.soonest(*robot, old[number][0], before));
        let Some(way) = way else {
            group[..number].iter().for_each(|robot| drop(table.take_out(*robot)));
            group.into_iter().zip(old).for_each(|(robot, way)| table.put(robot, way));
            return false;
        };
        table.put(*robot, way);
        left -= table.arrival(*robot);
    }
    true
}
