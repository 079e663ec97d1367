//! Culling tests and walks: facts B2-B5, C1, C3, C4, D7, D8, A8 and H of the algorithm notes, and
//! the agreement of all kernels, accelerations and walks.

mod arithmetics;
mod back_face;
mod build;
mod chc;
mod chc_pp;
mod cones;
mod facing;
mod fast_v;
mod fast_v_facts;
mod fast_v_twin;
mod fixed;
mod frustum;
mod hiz_two_pass;
mod kernels;
mod masks;
mod numbers;
mod occluding;
mod occlusion_tree;
mod octants;
mod portals;
mod portals_facts;
mod primitives;
mod pvs;
mod queries;
mod sat;
mod sectors;
mod skipping;
mod walks;
