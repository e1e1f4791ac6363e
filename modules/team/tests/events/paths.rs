//! Where events start, on this robot and on teammates: figures 3.5 and 3.6 of seed 000; and chains that end.

use rohrpost_team::RobotId;
use rohrpost_team::events::{EventHead, EventType, Flow, GroupId, LossCause, Plan, Priority, ROOT, Tree, Turn};

type Ran = Vec<&'static str>;

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

fn all(tree: &mut Tree<Ran, ()>) -> Ran {
    let mut ran = Ran::new();
    while tree.dispatch(0, &mut ran) {}
    ran
}

/// Two robots with the tree of figure 3.6, in which leaf 3 consumes what leaf 2 sends, but is not below `g1`.
fn figure_3_6() -> (Tree<Ran, ()>, EventType, GroupId) {
    let mut plan = Plan::new();
    let [e1, e2, e3, e4] = ["e1", "e2", "e3", "e4"].map(|name| plan.event(name, Priority::Normal, 4));
    let g1 = plan.group("g1", &[ROOT]);
    let g2 = plan.group("g2", &[g1]);
    let mut leaf = |name: &'static str, parents: &[_], consumes: &[_], emits: &'static [u8], sends: &'static [u8]| {
        let types = [e1, e2, e3, e4];
        let set = |numbers: &[u8]| numbers.iter().map(|it| types[usize::from(*it)]).collect::<Vec<_>>();
        let (emitted, sent) = (set(emits), set(sends));
        let flow = Flow { consumes, emits: &emitted.clone(), sends: &sent.clone(), cycles: &[] };
        plan.leaf(name, parents, flow, move |ran: &mut Ran, (), turn: &mut Turn<'_, ()>| {
            ran.push(name);
            emitted.iter().for_each(|it| assert!(turn.emit(*it, ())));
            sent.iter().for_each(|it| assert!(turn.send(*it, ())));
        });
    };
    leaf("1", &[g1], &[e1], &[2], &[]);
    leaf("2", &[g1], &[e1], &[], &[3]);
    leaf("3", &[ROOT], &[e4, e2], &[], &[]);
    leaf("4", &[g2], &[e3], &[], &[]);
    leaf("5", &[ROOT], &[e3], &[], &[]);
    leaf("6", &[g2], &[e4], &[], &[]);
    (plan.build().unwrap(), e1, g1)
}

#[test]
fn events_start_where_their_leaf_has_run_here_and_on_teammates() {
    let ((mut one, e1, _), (mut two, ..)) = (figure_3_6(), figure_3_6());
    assert!(one.hard(e1, ()));
    assert_eq!(all(&mut one), ["1", "2", "4"]);
    let (head, ()) = one.take_sent(id(1)).unwrap();
    assert_eq!(two.hear(&head, ()), Ok(true));
    assert_eq!(all(&mut two), ["6"]);
    assert!(one.take_sent(id(1)).is_none() && two.take_sent(id(2)).is_none());
}

#[test]
fn nothing_visits_a_branch_that_is_off_or_starts_below_one() {
    let (mut tree, e1, g1) = figure_3_6();
    assert!(tree.hard(e1, ()));
    let mut ran = Ran::new();
    assert!(tree.dispatch(0, &mut ran));
    tree.switch(g1, false);
    assert!(tree.hard(e1, ()));
    assert_eq!((all(&mut tree), ran), (Ran::new(), vec!["1", "2"]));
    assert_eq!(tree.lost(e1, LossCause::BranchOff), 0, "a hard event starts at the root, which is on");
    let (head, ()) = tree.take_sent(id(1)).unwrap();
    assert_eq!(tree.hear(&head, ()), Ok(true));
    assert_eq!(all(&mut tree), Ran::new());
    tree.switch(g1, true);
    assert!(tree.hear(&head, ()).unwrap() && all(&mut tree) == ["6"]);
}

#[test]
fn a_chain_of_a_declared_exception_ends_over_teammates_too() {
    let ping = || {
        let mut plan = Plan::new();
        let ping = plan.event("ping", Priority::Normal, 4);
        let flow = Flow { consumes: &[ping], sends: &[ping], cycles: &[(ping, 5)], ..Flow::default() };
        plan.leaf("player", &[ROOT], flow, move |ran: &mut Ran, (), turn| {
            ran.push("player");
            turn.send(ping, ());
        });
        (plan.build().unwrap(), ping)
    };
    let ((mut one, event), (mut two, _)) = (ping(), ping());
    assert!(one.hard(event, ()));
    let mut runs = 0;
    loop {
        let before = runs;
        for (me, tree, other) in [(id(1), 0, 1), (id(2), 1, 0)] {
            let trees = [&mut one, &mut two];
            runs += all(trees[tree]).len();
            while let Some((head, ())) = trees[tree].take_sent(me) {
                let bytes = head.encode();
                let (head, _) = EventHead::decode(&bytes).unwrap();
                assert_eq!(trees[other].hear(&head, ()), Ok(true));
            }
        }
        if runs == before {
            break;
        }
    }
    assert_eq!(runs, 6, "the hard event, and depths 1 to 5");
    assert_eq!(one.lost(event, LossCause::TooDeep) + two.lost(event, LossCause::TooDeep), 1);
}
