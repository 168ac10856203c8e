use super::*;
use crate::boundary::Shape;

fn square(lower: f32, upper: f32) -> Vec<Vector<2>> {
    [
        [lower, lower],
        [upper, lower],
        [upper, upper],
        [lower, upper],
    ]
    .map(Vector::<2>::from)
    .to_vec()
}

/// Points of a grid over the unit square or cube.
fn points<const D: usize>(count: usize) -> impl Iterator<Item = Vector<D>> {
    (0..count.pow(D as u32)).map(move |number| {
        Vector::from_fn(|axis, _| {
            let step = number / count.pow(axis as u32) % count;
            (step as f32 + 0.37) / count as f32
        })
    })
}

/// A ball of this many rings of triangles, twice as many along its equator.
fn ball(center: [f32; 3], radius: f32, rings: usize) -> Surface<3> {
    let around = 2 * rings;
    let mut vertices = Vec::new();
    for ring in 0..=rings {
        let (sine, cosine) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
        for step in 0..around {
            let (y, x) = (std::f32::consts::TAU * step as f32 / around as f32).sin_cos();
            let out = Vector::<3>::new(sine * x, sine * y, cosine);
            vertices.push(Vector::<3>::from(center) + out * radius);
        }
    }
    // All vertices of a pole are one.
    let number = |ring: usize, step: usize| {
        let step = if ring == 0 || ring == rings {
            0
        } else {
            step % around
        };
        (ring * around + step) as u32
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for step in 0..around {
            let [a, b, c, d] = [
                number(ring, step),
                number(ring + 1, step),
                number(ring + 1, step + 1),
                number(ring, step + 1),
            ];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Surface::mesh(vertices, triangles).unwrap()
}

#[test]
fn a_polygon_equal_to_a_box_has_its_distances_and_normals() {
    let corners = square(0.25, 0.6);
    let polygon = Surface::outline(&corners).unwrap();
    let turned: Vec<_> = corners.iter().rev().copied().collect();
    let prepared = polygon.prepared(1.0 / 64.0, [7.0; 2], None);
    let cuboid = Shape::Box {
        lower: Vector::<2>::repeat(0.25),
        upper: Vector::<2>::repeat(0.6),
    };
    for surface in [&polygon, &Surface::outline(&turned).unwrap(), &prepared] {
        let is_prepared = surface.lattice.is_some();
        let (allowed, mut compared) = (if is_prepared { 0.01 / 64.0 } else { 1e-6 }, 0);
        for x in points::<2>(97) {
            let ((distance, normal), (exact, toward)) = (surface.distance(&x), cuboid.distance(&x));
            if is_prepared && exact.abs() > 1.0 / 64.0 {
                assert!(distance * exact > 0.0 && distance.abs() < exact.abs() + 5.0 * allowed);
                continue;
            }
            assert!(
                (distance - exact).abs() < allowed,
                "{x:?}: {distance} {exact}"
            );
            // On a diagonal two faces are as near.
            if normal.dot(&toward) < 0.998 {
                let depth = (x.x - 0.425).abs() - (x.y - 0.425).abs();
                assert!(
                    distance < 0.0 && depth.abs() < 1.0 / 64.0,
                    "{x:?}: {normal:?}"
                );
            } else {
                compared += 1;
            }
        }
        assert!(
            compared > if is_prepared { 400 } else { 5000 },
            "{compared}"
        );
    }
}

#[test]
fn outlines_within_outlines_are_holes_whichever_way_they_run() {
    for inner in [
        square(0.4, 0.6),
        square(0.4, 0.6).into_iter().rev().collect(),
    ] {
        let mut corners = square(0.2, 0.8);
        corners.push(corners[0]);
        corners.extend(&inner);
        corners.push(inner[0]);
        let ring = Surface::outline(&corners).unwrap();
        assert_eq!(ring.soup.facets.len(), 8);
        for (x, distance) in [
            ([0.5, 0.5], 0.1),
            ([0.5, 0.35], -0.05),
            ([0.3, 0.3], -0.1),
            ([0.1, 0.5], 0.1),
        ] {
            let found = ring.distance(&Vector::<2>::from(x)).0;
            assert!((found - distance).abs() < 1e-6, "{x:?}: {found}");
        }
    }
    // Two squares that touch in a corner.
    let mut corners = square(0.2, 0.4);
    corners.rotate_left(2);
    corners.push(corners[0]);
    corners.extend(square(0.4, 0.7).into_iter().rev().cycle().skip(3).take(4));
    let pair = Surface::outline(&corners).unwrap();
    for (x, sign) in [
        ([0.39, 0.39], -1.0),
        ([0.41, 0.41], -1.0),
        ([0.39, 0.41], 1.0),
    ] {
        assert!(pair.distance(&Vector::<2>::from(x)).0 * sign > 0.0, "{x:?}");
    }
}

#[test]
fn a_polygon_that_crosses_itself_is_solid_by_the_even_odd_rule() {
    // A star of five points, drawn without lifting the pen: its middle is empty.
    let corner = |k: usize| {
        let (sine, cosine) = (std::f32::consts::TAU * 0.4 * k as f32).sin_cos();
        Vector::<2>::new(0.5 + 0.3 * sine, 0.5 + 0.3 * cosine)
    };
    let star = Surface::outline(&(0..5).map(corner).collect::<Vec<_>>()).unwrap();
    assert_eq!(star.soup.facets.len(), 15);
    let inside = points::<2>(97).filter(|x| star.distance(x).0 < 0.0).count();
    // Five points of the star: the radius of the pentagon is that of the star less twice its waist.
    let (inner, turn) = (0.3 * 0.381_966_f32, std::f32::consts::TAU / 10.0);
    let area = 5.0 * inner * turn.sin() * (0.3 - inner * turn.cos());
    let found = inside as f32 / 97.0_f32.powi(2);
    assert!((found - area).abs() < 0.03 * area, "{found} {area}");
    assert!(star.distance(&Vector::<2>::repeat(0.5)).0 > 0.09);
}

#[test]
fn a_fine_mesh_of_a_ball_is_the_ball_inside_and_out() {
    let (center, radius, dx) = ([0.45, 0.5, 0.55], 0.3, 1.0 / 32.0);
    let exact = ball(center, radius, 64);
    let prepared = exact.prepared(dx, [7.0; 2], None);
    let truth = Shape::Ball {
        center: Vector::<3>::from(center),
        radius,
    };
    let mut near = 0;
    for x in points::<3>(23) {
        let (distance, toward) = truth.distance(&x);
        let (found, normal) = exact.distance(&x);
        assert!(
            (found - distance).abs() < 0.002 * radius,
            "{x:?}: {found} {distance}"
        );
        let (approximate, slope) = prepared.distance(&x);
        assert!(
            approximate * distance > 0.0 || distance.abs() < 0.03 * dx,
            "{x:?}"
        );
        if distance.abs() < dx {
            near += 1;
            assert!(
                (approximate - found).abs() < 0.03 * dx,
                "{x:?}: {approximate} {found}"
            );
            assert!(
                normal.dot(&toward) > 0.998 && slope.dot(&toward) > 0.995,
                "{x:?}"
            );
        }
    }
    assert!(near > 300, "{near}");
}

/// Whether a coordinate lies on a wall of the unit box.
fn ends(_: usize, x: f32, outward: f32) -> bool {
    if outward < 0.0 { x <= 0.0 } else { x >= 1.0 }
}

#[test]
fn a_solid_that_ends_on_walls_goes_on_beyond_them() {
    let hill = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.1], [0.5, 0.4], [0.0, 0.1]].map(Vector::<2>::from);
    let open = Surface::outline(&hill).unwrap().through(ends, 2.0);
    // Two of the hill, four beside it and five below.
    assert_eq!(open.soup.facets.len(), 11);
    for (x, sign) in [
        ([0.01, 0.01], -1.0),
        ([0.5, 0.001], -1.0),
        ([-0.01, 0.05], -1.0),
        ([-0.3, 0.2], 1.0),
        ([0.99, 0.2], 1.0),
        ([0.0, 0.2], 1.0),
    ] {
        let (distance, normal) = open.distance(&Vector::<2>::from(x));
        assert!(distance * sign > 0.0, "{x:?}: {distance}");
        assert!(normal.y > 0.5, "{x:?}: {normal:?}");
    }
}

#[test]
fn a_surface_is_stored_by_its_facets_and_refused_where_it_encloses_nothing() {
    let one = ball([0.5; 3], 0.2, 6);
    let bytes = postcard::to_stdvec(&one).unwrap();
    let other: Surface<3> = postcard::from_bytes(&bytes).unwrap();
    assert!(one == other && format!("{one:?}") == format!("{other:?}"));
    let x = Vector::<3>::new(0.45, 0.61, 0.52);
    assert_eq!(one.distance(&x), other.distance(&x));
    let line = [[0.1, 0.1], [0.5, 0.1], [0.1, 0.1]].map(Vector::<2>::from);
    let nothing = Surface::outline(&line).unwrap_err().to_string();
    assert!(nothing.contains("enclose an area"), "{nothing}");
    let flat = vec![Vector::<3>::zeros(); 4];
    let all = vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];
    let nothing = Surface::mesh(flat, all).unwrap_err().to_string();
    assert!(nothing.contains("enclose a volume"), "{nothing}");
    assert!(Surface::mesh(vec![Vector::<3>::zeros()], vec![[0, 1, 2]]).is_err());
}

#[test]
fn a_mesh_in_a_corner_of_the_world_goes_on_beyond_three_walls() {
    let code =
        |code: u32| Vector::<3>::from_fn(|axis, _| if code >> axis & 1 == 1 { 0.4 } else { 0.0 });
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = faces
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    let cube = Surface::mesh((0..8).map(code).collect(), triangles.collect()).unwrap();
    let beyond = cube.through(ends, 2.0);
    let cuboid = Shape::Box {
        lower: Vector::<3>::repeat(-2.0),
        upper: Vector::<3>::repeat(0.4),
    };
    for x in points::<3>(9) {
        let x = x - Vector::<3>::repeat(0.3);
        let ((distance, _), (exact, _)) = (beyond.distance(&x), cuboid.distance(&x));
        assert!((distance - exact).abs() < 1e-6, "{x:?}: {distance} {exact}");
    }
}

#[test]
fn meshes_that_cross_themselves_are_found() {
    let join = |one: &Surface<3>, other: &Surface<3>| {
        let count = one.soup.vertices.len() as u32;
        let vertices = [&one.soup.vertices[..], &other.soup.vertices].concat();
        let moved = other
            .soup
            .facets
            .iter()
            .map(|facet| facet.map(|index| index + count));
        Surface::mesh(
            vertices,
            one.soup.facets.iter().copied().chain(moved).collect(),
        )
        .unwrap()
    };
    let one = ball([0.3, 0.5, 0.5], 0.2, 12);
    assert!(one.crossing().is_none());
    assert!(
        join(&one, &ball([0.3, 0.5, 0.5], 0.1, 12))
            .crossing()
            .is_none()
    );
    let place = join(&one, &ball([0.5, 0.5, 0.5], 0.2, 12))
        .crossing()
        .unwrap();
    assert!((place.x - 0.4).abs() < 0.02, "{place:?}");
}
