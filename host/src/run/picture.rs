//! trajectory.svg: the drive from above.

use std::fmt::Write;

use super::motion::Movers;

/// Width of the drawing area \[px\] of the longer side.
const SIZE_PX: f64 = 900.0;
/// Room around it \[px\], with the legend above and the scale below.
const MARGIN_PX: f64 = 40.0;
/// Legend's height \[px\].
const LEGEND_PX: f64 = 36.0;
/// Surroundings of the drive that are drawn at least \[m\], and as a share of the drive's extent. Movers beyond are cut
/// off; a vehicle at rest is a dot, not a close-up of its noise.
const SURROUNDINGS: (f64, f64) = (10.0, 0.06);

const ESTIMATE: &str = "#1f6feb";
const TRUTH: &str = "#8c959f";
const MOVER: &str = "#d1242f";

/// What is drawn, map frame \[m\].
pub(super) struct Picture<'a> {
    pub title: &'a str,
    pub estimate: &'a [[f64; 2]],
    pub ground_truth: Option<&'a [[f64; 2]]>,
    pub movers: &'a Movers,
}

impl Picture<'_> {
    /// The picture as an SVG document.
    pub(super) fn to_svg(&self) -> String {
        let ground_truth = self.ground_truth.unwrap_or_default();
        let view = View::around(self.estimate.iter().chain(ground_truth).copied());
        let (width, height) = (view.width_px + 2.0 * MARGIN_PX, view.height_px + 2.0 * MARGIN_PX + LEGEND_PX);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"14\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        );
        let frame = view.frame();
        let _ =
            writeln!(svg, "<clipPath id=\"view\"><rect {frame}/></clipPath>\n<g clip-path=\"url(#view)\">");
        for path in self.movers.paths() {
            line(&mut svg, &view, path, MOVER, 1.5);
        }
        let _ = writeln!(svg, "</g>\n<rect {frame} fill=\"none\" stroke=\"#d0d7de\"/>");
        if let Some(truth) = self.ground_truth {
            line(&mut svg, &view, truth, TRUTH, 4.0);
        }
        line(&mut svg, &view, self.estimate, ESTIMATE, 2.0);
        self.ends(&mut svg, &view);
        self.legend(&mut svg);
        scale_bar(&mut svg, &view, height);
        svg.push_str("</svg>\n");
        svg
    }

    fn ends(&self, svg: &mut String, view: &View) {
        let (Some(&start), Some(&end)) = (self.estimate.first(), self.estimate.last()) else { return };
        let ([sx, sy], [ex, ey]) = (view.pixel(start), view.pixel(end));
        let _ = writeln!(
            svg,
            "<circle cx=\"{sx:.1}\" cy=\"{sy:.1}\" r=\"6\" fill=\"white\" stroke=\"{ESTIMATE}\" stroke-width=\"2.5\"/>\n\
             <rect x=\"{:.1}\" y=\"{:.1}\" width=\"11\" height=\"11\" fill=\"{ESTIMATE}\"/>",
            ex - 5.5,
            ey - 5.5
        );
    }

    fn legend(&self, svg: &mut String) {
        let _ = writeln!(
            svg,
            "<text x=\"{MARGIN_PX}\" y=\"28\" font-size=\"18\" font-weight=\"bold\">{}</text>",
            escape(self.title)
        );
        let mut entries = vec![("estimate", ESTIMATE)];
        entries.extend(self.ground_truth.map(|_| ("ground truth", TRUTH)));
        entries.extend(self.movers.paths().next().map(|_| ("recognised movers", MOVER)));
        let mut x = MARGIN_PX;
        for (name, colour) in entries {
            let _ = writeln!(
                svg,
                "<line x1=\"{x}\" y1=\"50\" x2=\"{}\" y2=\"50\" stroke=\"{colour}\" stroke-width=\"3\"/>\n\
                 <text x=\"{}\" y=\"55\">{name}</text>",
                x + 24.0,
                x + 30.0
            );
            x += 50.0 + 8.0 * name.len() as f64;
        }
        let _ = writeln!(
            svg,
            "<circle cx=\"{}\" cy=\"50\" r=\"5\" fill=\"white\" stroke=\"{ESTIMATE}\" stroke-width=\"2\"/>\n\
             <text x=\"{}\" y=\"55\">start</text>\n\
             <rect x=\"{}\" y=\"45\" width=\"10\" height=\"10\" fill=\"{ESTIMATE}\"/>\n\
             <text x=\"{}\" y=\"55\">end</text>",
            x + 5.0,
            x + 16.0,
            x + 64.0,
            x + 80.0
        );
    }
}

/// Map metres to pixels: x to the right, y up, the same scale on both.
struct View {
    left_m: f64,
    top_m: f64,
    px_per_m: f64,
    width_px: f64,
    height_px: f64,
}

impl View {
    fn around(points: impl Iterator<Item = [f64; 2]>) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        let centre: [f64; 2] = std::array::from_fn(|i| f64::midpoint(low[i], high[i]));
        let driven = (high[0] - low[0]).max(high[1] - low[1]);
        let surroundings = SURROUNDINGS.0.max(SURROUNDINGS.1 * driven);
        let longest = driven + 2.0 * surroundings;
        // The legend needs half of the width.
        let smallest = [0.5 * longest, 0.0];
        let extent: [f64; 2] =
            std::array::from_fn(|i| (high[i] - low[i] + 2.0 * surroundings).max(smallest[i]));
        let px_per_m = SIZE_PX / longest;
        Self {
            left_m: centre[0] - 0.5 * extent[0],
            top_m: centre[1] + 0.5 * extent[1],
            px_per_m,
            width_px: extent[0] * px_per_m,
            height_px: extent[1] * px_per_m,
        }
    }

    /// The drawing area as attributes of a rectangle.
    fn frame(&self) -> String {
        let (width, height) = (self.width_px, self.height_px);
        format!(
            "x=\"{MARGIN_PX}\" y=\"{}\" width=\"{width:.1}\" height=\"{height:.1}\"",
            MARGIN_PX + LEGEND_PX
        )
    }

    fn pixel(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            MARGIN_PX + (x - self.left_m) * self.px_per_m,
            MARGIN_PX + LEGEND_PX + (self.top_m - y) * self.px_per_m,
        ]
    }
}

fn line(svg: &mut String, view: &View, points: &[[f64; 2]], colour: &str, width_px: f64) {
    let _ = write!(
        svg,
        "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width_px}\" stroke-linejoin=\"round\" points=\""
    );
    for &point in points {
        let [x, y] = view.pixel(point);
        let _ = write!(svg, "{x:.1},{y:.1} ");
    }
    svg.push_str("\"/>\n");
}

/// A bar of a round length, about a fifth of the width.
fn scale_bar(svg: &mut String, view: &View, height_px: f64) {
    let length_m = round_length(0.2 * view.width_px / view.px_per_m);
    let (x, y) = (MARGIN_PX, height_px - 24.0);
    let end = x + length_m * view.px_per_m;
    let _ = writeln!(
        svg,
        "<path d=\"M{x} {} V{y} H{end:.1} V{}\" fill=\"none\" stroke=\"black\" stroke-width=\"2\"/>\n\
         <text x=\"{:.1}\" y=\"{}\">{length_m} m</text>",
        y - 6.0,
        y - 6.0,
        end + 8.0,
        y + 2.0
    );
}

/// The largest of 1, 2, 5, 10, 20, 50, ... m that is not above `at_most_m`.
fn round_length(at_most_m: f64) -> f64 {
    let decade = 10f64.powf(at_most_m.max(1.0).log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|step| step * decade).find(|&l| l <= at_most_m).unwrap_or(decade)
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_lengths() {
        for (at_most, length) in
            [(0.4, 1.0), (1.0, 1.0), (4.9, 2.0), (5.0, 5.0), (99.0, 50.0), (100.0, 100.0)]
        {
            assert_eq!(round_length(at_most), length);
        }
    }

    #[test]
    fn left_on_the_map_is_up_in_the_picture_and_every_point_is_inside() {
        let points = [[0.0, 0.0], [100.0, 0.0], [100.0, 40.0]];
        let view = View::around(points.into_iter());
        assert!(view.pixel(points[2])[1] < view.pixel(points[1])[1]);
        for [x, y] in points.map(|point| view.pixel(point)) {
            assert!((MARGIN_PX..=MARGIN_PX + view.width_px).contains(&x));
            assert!((MARGIN_PX + LEGEND_PX..=MARGIN_PX + LEGEND_PX + view.height_px).contains(&y));
        }
    }

    #[test]
    fn the_scale_is_the_same_along_and_across() {
        let view = View::around([[0.0, 0.0], [300.0, 10.0]].into_iter());
        let [[x0, y0], [x1, y1]] = [[0.0, 0.0], [7.0, 7.0]].map(|point| view.pixel(point));
        assert!(((x1 - x0) - (y0 - y1)).abs() < 1e-9);
    }
}
