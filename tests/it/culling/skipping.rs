//! What a scene does not need is skipped: fact I.2, same sets or more, and what is counted.

use super::build::{Rng, list, tree};
use super::walks::{Method, triangles, views};
use crate::common::soup;
use cullmark::culling::normal_mask::Cells;
use cullmark::culling::{DrawList, Tally, Test, Walk, cull, make_tests, make_walk};
use cullmark::hierarchy::{Hierarchy, NONE};
use cullmark::math::{Camera, DVec3, View};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{Scene, generate, walkthrough};

/// Generated scenes, and a camera that goes through each.
fn worlds() -> Vec<(Scene, Vec<View>)> {
    let made = |scene: &str, path: &str| {
        let scene = generate::make(&Spec::parse(scene).unwrap()).unwrap().0.generate();
        let poses = walkthrough::generate::make(&Spec::parse(path).unwrap()).unwrap().0.walk(&scene).unwrap();
        let views = poses.iter().map(|p| View::new(&Camera::default(), p)).collect();
        (scene, views)
    };
    vec![
        made("blocks:triangles=4000", "random:frames=12,seed=3"),
        made("rooms", "random:frames=8,seed=4"),
        (soup(95, 2500, 40.0, 1.0), views(95, 40.0)),
    ]
}

/// Tests and walk that fill one list frame by frame, as a trial does.
struct Run<'a> {
    h: &'a Hierarchy,
    tests: Vec<Box<dyn Test>>,
    walk: Box<dyn Walk>,
    list: DrawList,
}

impl<'a> Run<'a> {
    fn new(scene: &Scene, h: &'a Hierarchy, culling: &str, walk: &str) -> Run<'a> {
        let mut tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
        tests.iter_mut().for_each(|t| _ = t.prepare(scene, h));
        let walk = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
        Run { h, tests, walk, list: DrawList::default() }
    }

    fn frame(&mut self, view: &View) -> Tally {
        let mut tally = Tally::default();
        cull(view, self.h, &mut self.tests, self.walk.as_mut(), &mut self.list, &mut tally);
        tally
    }
}

#[test]
fn a_small_scene_is_drawn_whole_and_nothing_is_judged() {
    let scene = soup(96, 500, 20.0, 1.0);
    let h = tree(&scene, 8, 1);
    for walk in ["depth_first", "flat"] {
        for culling in ["frustum", "frustum+normal_mask+back_face", "none"] {
            let whole = Tally { frames_whole: 1, ..Tally::default() };
            let plain = Method::new(&scene, &h, culling, walk).frame(&views(96, 20.0)[0]);
            let below = |n: u32| Method::new(&scene, &h, culling, &format!("{walk}:whole_below={n}"));
            let (out, tally) = below(500).frame(&views(96, 20.0)[0]);
            assert_eq!((out.ranges, out.compacted, tally), (vec![(0, 500)], false, whole), "{culling}");
            assert_eq!(below(499).frame(&views(96, 20.0)[0]), plain, "{culling}");
            assert_eq!(below(0).frame(&views(96, 20.0)[0]), plain, "{culling}");
        }
    }
    // An empty scene has nothing to draw.
    let nothing = Hierarchy::default();
    let mut empty = Run::new(&Scene::default(), &nothing, "frustum", "depth_first:whole_below=9");
    assert_eq!((empty.frame(&views(96, 20.0)[0]), empty.list.ranges.len()), (Tally::default(), 0));
}

/// What `small` means, written plainly.
fn plainly(h: &Hierarchy, test: &mut dyn Test, small: u32) -> Vec<bool> {
    let mut set = vec![false; h.entries.len()];
    let mut pending: Vec<u32> = (0..h.root_blocks).collect();
    while let Some(block) = pending.pop() {
        let links = &h.links[block as usize];
        let outside = test.judge(h, block, links.live, test.initial_carry(), &mut Tally::default()).outside;
        for lane in (0..8).filter(|l| links.live >> l & 1 == 1 && outside >> l & 1 == 0) {
            let whole = links.child[lane] == NONE || links.end[lane] - links.first[lane] <= small;
            let end = if whole { links.end[lane] } else { links.own_end[lane] };
            (links.first[lane]..end).for_each(|p| set[h.entries[p as usize] as usize] = true);
            if !whole {
                pending.push(links.child[lane]);
            }
        }
    }
    set
}

#[test]
fn small_subtrees_are_submitted_whole() {
    for (scene, views) in worlds() {
        let h = tree(&scene, 8, 1);
        let mut before: Option<(Vec<Vec<bool>>, u64)> = None;
        for small in [0, 16, 64, 300, 100_000] {
            let mut method = Method::new(&scene, &h, "frustum", &format!("depth_first:small={small}"));
            let mut test = make_tests(&parse_sum("frustum").unwrap()).unwrap().0.remove(0);
            test.prepare(&scene, &h);
            let (mut sets, mut sum) = (Vec::new(), Tally::default());
            for view in &views {
                let (out, tally) = method.frame(view);
                sum = [sum, tally].into_iter().sum();
                test.begin(view, &h);
                sets.push(triangles(&h, &out));
                assert_eq!(sets.last().unwrap(), &plainly(&h, test.as_mut(), small), "{} {small}", scene.name);
            }
            assert!(small != 0 || sum.subtrees_not_entered == 0);
            assert!(small < 64 || sum.subtrees_not_entered > 0, "{} {small}", scene.name);
            if let Some((fewer, nodes)) = before {
                let holds = fewer.iter().flatten().zip(sets.iter().flatten()).all(|(a, b)| !a || *b);
                assert!(holds && sum.nodes_visited <= nodes, "{} {small}", scene.name);
            }
            before = Some((sets, sum.nodes_visited));
        }
    }
}

#[test]
fn while_the_camera_stands_still_the_list_is_kept() {
    for (scene, views) in worlds() {
        let spec = Spec::parse("portal_octree:depth=3").unwrap();
        let cells = cullmark::structure::make(&spec).unwrap().0.build(&scene).unwrap();
        for (h, walk) in [(tree(&scene, 8, 2), "depth_first"), (list(&scene, 6), "flat"), (cells, "portals")] {
            for culling in ["frustum:last_plane=true", "frustum+normal_mask+back_face", "look_at", "none"] {
                let mut plain = Run::new(&scene, &h, culling, walk);
                let mut still = Run::new(&scene, &h, culling, &format!("{walk}:still=true"));
                let reused = Tally { frames_reused: 1, ..Tally::default() };
                // Stands, goes on, and comes back to where it was before.
                for (i, at) in [0, 0, 0, 1, 1, 0, 2, 3, 3].into_iter().enumerate() {
                    let (slow, quick) = (plain.frame(&views[at]), still.frame(&views[at]));
                    assert_eq!(still.list, plain.list, "{culling} {walk} frame {i}");
                    let again = [1, 2, 4, 8].contains(&i);
                    assert_eq!(quick == reused, again, "{culling} {walk} frame {i}: {quick:?}");
                    assert_eq!(quick.frames_reused, u64::from(again));
                    // What a moving camera costs is the same.
                    assert!(again || culling.contains("last_plane") || quick == slow, "{culling} {walk} frame {i}");
                }
                still.walk.reset();
                assert_eq!(still.frame(&views[3]).frames_reused, 0, "reset forgets");
                assert_eq!(still.frame(&views[3]).frames_reused, 1);
                // Another list, or one that was written to, is filled anew.
                let own = std::mem::take(&mut still.list);
                assert_eq!(still.frame(&views[3]).frames_reused, 0);
                assert_eq!(still.list, own);
                let end = h.entries.len() as u32;
                still.list.push(end, end + 1);
                assert_eq!(still.frame(&views[3]).frames_reused, 0, "someone wrote to it");
                still.list.retain(|_| false);
                assert_eq!(still.frame(&views[3]).frames_reused, 0, "someone took from it");
                still.list.retain_words(|_, words| words.fill(0));
                assert_eq!(still.frame(&views[3]).frames_reused, 0, "someone took whole words from it");
                assert_eq!(still.list, own);
                // Another camera at the same pose.
                let wider = Camera { aspect: 2.5, ..views[3].camera };
                let pose = cullmark::math::Pose { eye: views[3].eye, forward: views[3].forward, up: views[3].up };
                assert_eq!(still.frame(&View::new(&wider, &pose)).frames_reused, 0);
                assert!(!still.walk.remembers(), "sets depend on no earlier frame");
            }
        }
    }
}

/// Submitted sets only grow as fewer masks are asked, and full masks skip nothing anyway.
#[test]
fn full_masks_are_not_asked_and_nothing_is_lost() {
    let mut gained = 0;
    for (scene, views) in worlds() {
        let h = tree(&scene, 8, 1);
        for test in
            ["normal_mask:cells=2", "normal_mask:cells=3,rays=node", "octant_mask:sectors=16", "octant_mask:sectors=4"]
        {
            let sep = if test.contains(':') { ',' } else { ':' };
            for walk in ["depth_first", "flat"] {
                let mut plain = Method::new(&scene, &h, test, walk);
                let mut others: Vec<Method> = [1.0, 0.6, 0.2, 1e-9]
                    .map(|s| Method::new(&scene, &h, &format!("{test}{sep}saturation={s:?}"), walk))
                    .into();
                for view in views.iter().step_by(2) {
                    let (out, asked) = plain.frame(view);
                    let mut last = triangles(&h, &out);
                    let mut ignored = 0;
                    for (i, method) in others.iter_mut().enumerate() {
                        let (out, tally) = method.frame(view);
                        let set = triangles(&h, &out);
                        assert!(last.iter().zip(&set).all(|(a, b)| !a || *b), "{test} {walk} {i}: only more");
                        assert!(i > 0 || set == last, "{test} {walk}: a full mask is never averted");
                        assert_eq!(tally.mask_tests + tally.masks_ignored, tally.lane_tests);
                        gained += set.iter().zip(&last).filter(|(a, b)| **a && !**b).count();
                        assert!(i != 3 || (tally.mask_tests == 0 && set.iter().all(|s| *s)), "nobody is asked");
                        ignored += tally.masks_ignored;
                        last = set;
                    }
                    assert!(ignored > 0 || asked == Tally::default());
                    assert_eq!(asked.masks_ignored, 0);
                }
            }
        }
    }
    assert!(gained > 1000, "{gained}");
}

/// In a list a cluster is left out iff its mask is averted and below the share.
#[test]
fn the_share_is_that_of_the_bits() {
    let mut scene = soup(97, 900, 20.0, 1.0);
    (0..scene.len()).step_by(50).for_each(|t| scene.two_sided[t] = true);
    let h = list(&scene, 2);
    let mut rng = Rng::new(97);
    let cells = Cells { per_edge: 2 };
    let bits = |cluster: usize| {
        let mut of: Vec<usize> =
            h.entries[cluster * 2..cluster * 2 + 2].iter().map(|t| cells.of_triangle(&scene, *t)).collect();
        of.sort_unstable();
        of.dedup();
        // The reserved bit, of two-sided triangles, counts as all.
        if of.contains(&cells.count()) { cells.count() } else { of.len() }
    };
    let narrow = super::build::camera(5.0, 1.0);
    let kept = |culling: &str, view: &View| {
        let mut method = Method::new(&scene, &h, culling, "flat");
        let (out, tally) = method.frame(view);
        (triangles(&h, &out), tally)
    };
    let (mut only_one, mut spared) = (0, 0);
    for _ in 0..20 {
        let away: DVec3 = rng.direction();
        let view = super::build::view_along(away * -60.0, away, &narrow);
        let (plain, _) = kept("normal_mask:cells=2", &view);
        // Two bits of 24 are a twelfth.
        let (some, tally) = kept("normal_mask:cells=2,saturation=0.08", &view);
        for cluster in 0..450 {
            let of = |set: &[bool]| set[h.entries[cluster * 2] as usize];
            assert_eq!(of(&some), of(&plain) || bits(cluster) >= 2);
            spared += u32::from(of(&some) && !of(&plain));
            only_one += u32::from(!of(&some));
        }
        if tally.mask_tests > 0 {
            let full = (0..450).filter(|c| bits(*c) >= 2).count() as u64;
            assert_eq!((tally.masks_ignored, tally.mask_tests), (full, 450 - full));
        }
    }
    assert!(only_one > 20 && spared > 5, "{only_one} {spared}");
}
