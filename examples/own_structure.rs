//! A spatial structure of one's own: slabs along x. It is built over a generated
//! scene, culled by the frustum, and judged by the oracle.

use cullmark::culling::{make_tests, make_walk};
use cullmark::hierarchy::{BoundsBlock, Hierarchy, LANES, LinkBlock, NONE};
use cullmark::math::{Box32, Camera};
use cullmark::record::Accuracy;
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{Scene, generate, walkthrough};
use cullmark::{Result, oracle, runner::Setup, structure::Structure};

struct Slabs {
    width_m: f64,
}

impl Structure for Slabs {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        let slab = |t: &u32| (scene.triangle_aabb(*t).centre().x / self.width_m).floor() as i64;
        let mut entries: Vec<u32> = (0..scene.len() as u32).collect();
        entries.sort_by_key(slab);
        let mut h = Hierarchy { origin: scene.origin, ..Default::default() };
        let mut first = 0;
        for (i, members) in entries.chunk_by(|a, b| slab(a) == slab(b)).enumerate() {
            let (lane, end) = (i % LANES, first + members.len() as u32);
            if lane == 0 {
                h.bounds.push(BoundsBlock::EMPTY);
                h.links.push(LinkBlock::EMPTY);
                h.parent.push(NONE);
            }
            let bounds = members.iter().fold(Box32::EMPTY, |b, t| b.union(scene.triangle_box(*t)));
            h.bounds.last_mut().unwrap().set(lane, bounds);
            let links = h.links.last_mut().unwrap();
            (links.first[lane], links.own_end[lane], links.end[lane]) = (first, end, end);
            links.live |= 1 << lane;
            first = end;
        }
        h.root_blocks = h.links.len() as u32;
        h.entries = entries;
        h.number_material_runs(scene);
        h.assert_well_formed(scene);
        Ok(h)
    }
}

fn main() -> Result<()> {
    let scene = generate::make(&Spec::parse("rooms:world=1")?)?.0.generate();
    let poses = walkthrough::generate::make(&Spec::parse("walk:frames=60")?)?.0.walk(&scene)?;
    let (tests, _) = make_tests(&parse_sum("frustum")?)?;
    let (walk, _) = make_walk(&Spec::parse("flat")?)?;
    let mut setup = Setup::from_parts(scene, poses, &Camera::default(), &Slabs { width_m: 2.0 }, tests, walk)?;
    let accuracy = Accuracy { frames: 5, width_px: 320, height_px: 180, samples: 1, ..Accuracy::default() };
    let truth = oracle::truth(&setup.scene, &Camera::default(), &setup.judged_poses(&accuracy), &accuracy);
    let judgement = setup.judge(&truth);
    for f in &judgement.frames {
        println!("{}: {} submitted, {} visible, {} lost", f.frame, f.submitted, f.visible, f.false_culls);
    }
    assert_eq!(judgement.wrong, None, "slabs must be conservative");
    Ok(())
}
