//! The probabilistic roadmap.
//!
//! Kavraki, Švestka, Latombe, Overmars, *Probabilistic roadmaps for path planning in high-dimensional
//! configuration spaces*, IEEE Trans. Robotics and Automation 12(4), 1996: random free configurations, each
//! joined to its nearest neighbours by a straight local planner; a query joins start and goal to the roadmap
//! and searches it. What departs from it, and why:
//!
//! * Samples come from a low-discrepancy sequence shifted by the seed, not from a random generator: fewer
//!   are needed for the same coverage (LaValle, Branicky, Lindemann, *On the relationship between classical
//!   grid search and probabilistic roadmaps*, 2004).
//! * Half of the samples stand beside convex corners of obstacles (`corners`), where shortest paths bend.
//! * Edges are checked when the search wants them, not when they are made (Bohlin & Kavraki, *Path planning
//!   using lazy PRM*, 2000), and remembered; cycles are kept, since they shorten paths.
//! * No expansion of difficult regions: where samples do not connect, a grid wavefront links them
//!   (`links`), which is complete where the 1996 heuristic is not.
//! * The roadmap grows while there is time, the number of neighbours fixed: an anytime planner in the sense
//!   of PRM*'s k-nearest variant (Karaman & Frazzoli, *Sampling-based algorithms for optimal motion
//!   planning*, 2011), without its growth of k.

mod corners;
mod roadmap;
mod sampling;
mod search;

pub(crate) use corners::CornerSamples;
pub(crate) use roadmap::{NodeId, Roadmap, Validity};
pub(crate) use sampling::Sequence;
pub(crate) use search::Search;
