//! The nodes of shapes.

use super::lights::{CORNER, U, V};
use super::{CASTS_SHADOW, MATERIAL, NAME, ObjectNode, ObjectReader};
use crate::text::reader::Fields;
use crate::text::schema::{Field, FieldSchema, NodeSchema, flag};
use canaletto::shape::{
    Cone, Cuboid, Cylinder, Disk, Parallelogram, Partial, Plane, Round, Shape, Sphere, Torus, Triangle,
};
use glam::Vec3;

const OBJECT: &[FieldSchema] = &[NAME.schema, MATERIAL.schema, CASTS_SHADOW.schema];

const CENTER: Field<Vec3> = Field::new("center", "its centre").needed().places();
const RADIUS: Field<f32> = Field::new("radius", "its radius, more than 0").needed();
const NORMAL: Field<Vec3> = Field::new("normal", "the direction of its outer side").needed();

/// Whether cylinders and cones are capped by default.
pub(super) const DEFAULT_CAPS: bool = true;
pub(super) const CAPS: Field<bool> = Field::new("caps", "whether the ends are closed").or(|| flag(DEFAULT_CAPS));
pub(super) const ONE_SIDED: Field<bool> =
    Field::new("one-sided", "whether rays from behind pass through").or(|| flag(false));

const fn shape(schema: NodeSchema, read: fn(&Fields) -> Option<Shape>) -> ObjectNode {
    ObjectNode { schema: schema.argument(NAME.schema).transforms(), read: ObjectReader::Shape(read) }
}

pub(super) static SPHERE: ObjectNode = shape(
    NodeSchema::new("sphere", "A sphere.", &[&[CENTER.schema, RADIUS.schema], OBJECT])
        .example("sphere material=\"blue\" { center 0 20 0; radius 25 }"),
    |f| Some(Shape::Sphere(Sphere { center: f.get(&CENTER)?, radius: f.get(&RADIUS)? })),
);

const MIN: Field<Vec3> = Field::new("min", "the corner of smallest coordinates").needed().places();
const MAX: Field<Vec3> = Field::new("max", "the corner of largest coordinates").needed().places();

pub(super) static BOX: ObjectNode = shape(
    NodeSchema::new("box", "A box along the axes; turn it with a transform.", &[&[MIN.schema, MAX.schema], OBJECT])
        .example("box { min -80 -50 -50; max 50 -45 50; rotate-y 30 }"),
    |f| Some(Shape::Box(Cuboid { min: f.get(&MIN)?, max: f.get(&MAX)? })),
);

const A: Field<Vec3> = Field::new("a", "a corner").needed().places();
const B: Field<Vec3> = Field::new("b", "a corner").needed().places();
const C: Field<Vec3> = Field::new("c", "a corner").needed().places();

pub(super) static TRIANGLE: ObjectNode = shape(
    NodeSchema::new(
        "triangle",
        "A triangle, its corners counter-clockwise seen from outside.",
        &[&[A.schema, B.schema, C.schema, ONE_SIDED.schema], OBJECT],
    )
    .example("triangle { a 3 2 1; b 8 2 1; c 4 8 -4 }"),
    |f| {
        let one_sided = f.get(&ONE_SIDED).unwrap_or(false);
        Some(Shape::Triangle(Triangle { a: f.get(&A)?, b: f.get(&B)?, c: f.get(&C)?, one_sided }))
    },
);

const PLANE_POINT: Field<Vec3> = Field::new("point", "a point of it").needed().places();

pub(super) static PLANE: ObjectNode = shape(
    NodeSchema::new("plane", "A plane without end.", &[&[PLANE_POINT.schema, NORMAL.schema], OBJECT])
        .example("plane { point 0 -50 0; normal 0 1 0 }"),
    |f| Some(Shape::Plane(Plane { point: f.get(&PLANE_POINT)?, normal: f.get(&NORMAL)? })),
);

const ANGLE: Field<f32> =
    Field::new("angle", "only a part of it, of this angle around its axis in degrees; without caps")
        .or(|| WHOLE.to_string());
const START_ANGLE: Field<f32> =
    Field::new("start-angle", "where the part begins, in degrees from where u = 0 towards larger u")
        .or(|| START.to_string());
/// The fields of parts.
const PART: &[FieldSchema] = &[ANGLE.schema, START_ANGLE.schema];
/// A whole turn in degrees.
const WHOLE: f32 = 360.0;
/// The default start of a part.
const START: f32 = 0.0;

/// The shape, or the part of it that the node asks for.
fn part(f: &Fields, whole: Round) -> Option<Shape> {
    if f.has(&ANGLE) || f.has(&START_ANGLE) {
        let (start, angle) = (f.get(&START_ANGLE).unwrap_or(START), f.get(&ANGLE).unwrap_or(WHOLE));
        return Some(Shape::Partial(Partial { whole, start, angle }));
    }
    match whole {
        Round::Cylinder(cylinder) => Some(Shape::Cylinder(cylinder)),
        Round::Cone(cone) => Some(Shape::Cone(cone)),
        Round::Disk(disk) => Some(Shape::Disk(disk)),
        _ => None,
    }
}

/// Whether the ends are closed; those of parts are open.
fn caps(f: &Fields) -> bool {
    f.get(&CAPS).unwrap_or(DEFAULT_CAPS && !f.has(&ANGLE) && !f.has(&START_ANGLE))
}

pub(super) static DISK: ObjectNode = shape(
    NodeSchema::new("disk", "A flat disk.", &[&[CENTER.schema, NORMAL.schema, RADIUS.schema], PART, OBJECT])
        .example("disk { center 0 0 0; normal 0 1 0; radius 3 }"),
    |f| {
        let disk = Disk { center: f.get(&CENTER)?, normal: f.get(&NORMAL)?, radius: f.get(&RADIUS)? };
        part(f, Round::Disk(disk))
    },
);

pub(super) static RECTANGLE: ObjectNode = shape(
    NodeSchema::new("rectangle", "A rectangle, or any parallelogram.", &[&[CORNER.schema, U.schema, V.schema], OBJECT])
        .example("rectangle { corner -1 0 1; u 2 0 0; v 0 0 -2 }"),
    |f| Some(Shape::Rectangle(Parallelogram { corner: f.get(&CORNER)?, u: f.get(&U)?, v: f.get(&V)? })),
);

const CYLINDER_BASE: Field<Vec3> = Field::new("base", "the centre of one end").needed().places();
const CYLINDER_TOP: Field<Vec3> = Field::new("top", "the centre of the other end").needed().places();

pub(super) static CYLINDER: ObjectNode = shape(
    NodeSchema::new(
        "cylinder",
        "A cylinder between two points.",
        &[&[CYLINDER_BASE.schema, CYLINDER_TOP.schema, RADIUS.schema, CAPS.schema], PART, OBJECT],
    )
    .example("cylinder { base 0 0 0; top 0 10 0; radius 2; caps #false }"),
    |f| {
        let cylinder = Cylinder {
            base: f.get(&CYLINDER_BASE)?,
            top: f.get(&CYLINDER_TOP)?,
            radius: f.get(&RADIUS)?,
            caps: caps(f),
        };
        part(f, Round::Cylinder(cylinder))
    },
);

/// The default top radius of a cone.
const DEFAULT_TOP_RADIUS: f32 = 0.0;
const CONE_BASE: Field<Vec3> = Field::new("base", "the centre of its base").needed().places();
const CONE_TOP: Field<Vec3> = Field::new("top", "its apex, or the centre of its upper end").needed().places();
const CONE_RADIUS: Field<f32> = Field::new("radius", "its radius at the base").needed();
const TOP_RADIUS: Field<f32> = Field::new("top-radius", "its radius at the top").or(|| DEFAULT_TOP_RADIUS.to_string());

pub(super) static CONE: ObjectNode = shape(
    NodeSchema::new(
        "cone",
        "A cone, or a truncated one.",
        &[&[CONE_BASE.schema, CONE_TOP.schema, CONE_RADIUS.schema, TOP_RADIUS.schema, CAPS.schema], PART, OBJECT],
    )
    .example("cone { base 0 0 0; top 0 5 0; radius 2; top-radius 0.5 }"),
    |f| {
        let cone = Cone {
            base: f.get(&CONE_BASE)?,
            top: f.get(&CONE_TOP)?,
            radius: f.get(&CONE_RADIUS)?,
            top_radius: f.get(&TOP_RADIUS).unwrap_or(DEFAULT_TOP_RADIUS),
            caps: caps(f),
        };
        part(f, Round::Cone(cone))
    },
);

const AXIS: Field<Vec3> = Field::new("axis", "the direction that it is round about").needed();
const CIRCLE_RADIUS: Field<f32> = Field::new("radius", "the circle's radius").needed();
const TUBE: Field<f32> = Field::new("tube", "the tube's radius").needed();

pub(super) static TORUS: ObjectNode = shape(
    NodeSchema::new(
        "torus",
        "A tube around a circle.",
        &[&[CENTER.schema, AXIS.schema, CIRCLE_RADIUS.schema, TUBE.schema], OBJECT],
    )
    .example("torus { center 0 0 0; axis 0 1 0; radius 5; tube 1 }"),
    |f| {
        Some(Shape::Torus(Torus {
            center: f.get(&CENTER)?,
            axis: f.get(&AXIS)?,
            radius: f.get(&CIRCLE_RADIUS)?,
            tube: f.get(&TUBE)?,
        }))
    },
);
