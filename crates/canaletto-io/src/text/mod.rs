//! The scene text: KDL 2 to [`canaletto::scene::Scene`].

mod nearest;

pub(crate) use nearest::nearest;
