//! Colours as readers see them, including those who lack one kind of cone.

/// Linear sRGB as seen by a reader with all cones, and by those without the cones for red and for green (G. M. Machado, M. M. Oliveira, L.
/// A. F. Fernandes, IEEE Trans. Vis. Comput. Graph. 15 (2009), severity 1).
const VISIONS: [[[f64; 3]; 3]; 3] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
];

/// CIELAB coordinates of an sRGB colour as it is seen.
fn seen(colour: [u8; 3], vision: &[[f64; 3]; 3]) -> [f64; 3] {
    let linear = colour.map(|v| {
        let v = f64::from(v) / 255.0;
        if v <= 0.04045 {
            v / 12.92
        } else {
            ((v + 0.055) / 1.055).powf(2.4)
        }
    });
    let times = |m: &[[f64; 3]; 3], v: [f64; 3]| m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
    let rgb = times(vision, linear).map(|v| v.clamp(0.0, 1.0));
    let to_xyz = [
        [0.4124, 0.3576, 0.1805],
        [0.2126, 0.7152, 0.0722],
        [0.0193, 0.1192, 0.9505],
    ];
    let xyz = times(&to_xyz, rgb);
    let f = |t: f64| {
        if t > 216.0 / 24389.0 {
            t.cbrt()
        } else {
            (24389.0 / 27.0 * t + 16.0) / 116.0
        }
    };
    let (x, y, z) = (f(xyz[0] / 0.9505), f(xyz[1]), f(xyz[2] / 1.089));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The distance of two colours in CIELAB, for the reader for whom it is smallest.
pub(crate) fn distance(a: [u8; 3], b: [u8; 3]) -> f64 {
    let distances = VISIONS.iter().map(|vision| {
        let (a, b) = (seen(a, vision), seen(b, vision));
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    });
    distances.fold(f64::INFINITY, f64::min)
}
