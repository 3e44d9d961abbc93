//! One object, one class: pixels that hang together in space agree on what they are. Not in RangeNet++, and off unless
//! `model.toml` asks for it.
//!
//! A small network sees the lower half of a van and takes the upper one for a wall. Ground left out, the van is one piece
//! of the range image, so its pixels can vote (the paper does the same with landmarks, section 3.2.1). Only things of
//! a vehicle's size and small things are unified: larger pieces are houses, trees and cars that touch each other.

use sdslam_core::{MotionClass, SemanticClass};
use serde::Deserialize;

use super::description::ImageGeometry;
use super::error::DescriptionFault;
use super::pixels::PixelClasses;
use super::projection::RangeImage;

/// Parameters of the objects.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectsConfig {
    /// Pixels beside each other belong together when their points are nearer than this \[m\]; 0 switches objects off.
    pub link_m: f32,
    /// Longest object that is made a vehicle where more than half of it is taken for one \[m\].
    pub vehicle_m: f32,
    /// Longest object that becomes what most of it is taken for \[m\].
    pub small_m: f32,
    /// Fewest pixels of an object.
    pub min_pixels: u32,
}

impl Default for ObjectsConfig {
    fn default() -> Self {
        Self { link_m: 0.0, vehicle_m: 12.0, small_m: 1.2, min_pixels: 10 }
    }
}

impl ObjectsConfig {
    pub(super) fn fault(&self) -> Option<DescriptionFault> {
        let lengths = [
            ("objects.link_m", self.link_m),
            ("objects.vehicle_m", self.vehicle_m),
            ("objects.small_m", self.small_m),
        ];
        let (key, _) = lengths.into_iter().find(|&(_, value)| !(value >= 0.0 && value.is_finite()))?;
        Some(DescriptionFault { key, expected: "a number of metres, 0 or more" })
    }
}

/// Pixels that a pixel may hang together with, rows down and columns to the right: rows of the image can be empty.
const NEIGHBOURS: [(usize, isize); 7] = [(0, 1), (0, 2), (1, 0), (2, 0), (3, 0), (1, 1), (1, -1)];

/// Gives the pixels of each object one class. `classes` tells what the output channels mean.
pub fn unify(
    config: &ObjectsConfig,
    points: &[[f32; 4]],
    image: &RangeImage,
    classes: &[SemanticClass],
    pixels: &mut PixelClasses,
) {
    if config.link_m == 0.0 {
        return;
    }
    let counts = |pixel: usize| {
        let motion = classes[pixels.channel[pixel] as usize].motion();
        !matches!(motion, MotionClass::Ground | MotionClass::Dropped)
    };
    let place: Vec<Option<[f32; 3]>> = (0..image.point.len())
        .map(|pixel| {
            let &[x, y, z, _] = points.get(image.point[pixel] as usize)?;
            counts(pixel).then_some([x, y, z])
        })
        .collect();
    let object = label(&image.geometry, &place, config.link_m);
    let objects = gather(&place, &object, &pixels.channel, classes.len());
    let verdicts: Vec<_> = objects.iter().map(|object| object.verdict(config, classes)).collect();
    for (pixel, &index) in object.iter().enumerate() {
        let Some(&Some((channel, share))) = verdicts.get(index as usize) else { continue };
        if pixels.channel[pixel] != channel {
            pixels.channel[pixel] = channel;
            pixels.probability[pixel] = share;
        }
    }
}

fn is_vehicle(class: SemanticClass) -> bool {
    matches!(class, SemanticClass::Car | SemanticClass::Truck | SemanticClass::OtherVehicle)
}

const NO_OBJECT: u32 = u32::MAX;

/// Number of the object of every pixel: connected components of the image, its left edge beside its right one.
fn label(geometry: &ImageGeometry, place: &[Option<[f32; 3]>], link_m: f32) -> Vec<u32> {
    let (width, link2) = (geometry.width, link_m * link_m);
    let mut parent: Vec<u32> = (0..place.len() as u32).collect();
    for (pixel, here) in place.iter().enumerate() {
        let Some(a) = here else { continue };
        for (down, right) in NEIGHBOURS {
            let column = (pixel % width).wrapping_add_signed(right).wrapping_add(width) % width;
            let other = (pixel / width + down) * width + column;
            let Some(&Some(b)) = place.get(other) else { continue };
            if (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f32>() < link2 {
                let (one, two) = (root(&mut parent, pixel as u32), root(&mut parent, other as u32));
                parent[one.max(two) as usize] = one.min(two);
            }
        }
    }
    let mut number = vec![NO_OBJECT; place.len()];
    let mut count = 0;
    for pixel in (0..place.len()).filter(|&pixel| place[pixel].is_some()) {
        let root = root(&mut parent, pixel as u32) as usize;
        // A root is the first pixel of its object.
        if root == pixel {
            number[pixel] = count;
            count += 1;
        }
        number[pixel] = number[root];
    }
    number
}

fn root(parent: &mut [u32], mut pixel: u32) -> u32 {
    while parent[pixel as usize] != pixel {
        let above = parent[pixel as usize];
        parent[pixel as usize] = parent[above as usize];
        pixel = above;
    }
    pixel
}

/// What hangs together.
struct Object {
    /// Pixels by output channel.
    votes: Vec<u32>,
    low: [f32; 2],
    high: [f32; 2],
}

fn gather(place: &[Option<[f32; 3]>], object: &[u32], channel: &[u8], channels: usize) -> Vec<Object> {
    let mut objects: Vec<Object> = Vec::new();
    for (pixel, &index) in object.iter().enumerate() {
        let Some(p) = place[pixel] else { continue };
        if index as usize == objects.len() {
            let (low, high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
            objects.push(Object { votes: vec![0; channels], low, high });
        }
        let found = &mut objects[index as usize];
        found.votes[channel[pixel] as usize] += 1;
        for k in 0..2 {
            found.low[k] = found.low[k].min(p[k]);
            found.high[k] = found.high[k].max(p[k]);
        }
    }
    objects
}

impl Object {
    /// The channel that its pixels get, with the share of them that agreed; `None` leaves them as they are.
    fn verdict(&self, config: &ObjectsConfig, classes: &[SemanticClass]) -> Option<(u8, f32)> {
        let size: u32 = self.votes.iter().sum();
        if size < config.min_pixels {
            return None;
        }
        let extent_m = (self.high[0] - self.low[0]).hypot(self.high[1] - self.low[1]);
        let votes = self.votes.iter().copied().enumerate();
        let vehicles = votes.clone().filter(|&(channel, _)| is_vehicle(classes[channel]));
        let vehicle_votes: u32 = vehicles.clone().map(|(_, votes)| votes).sum();
        let (channel, agreed) = if extent_m < config.small_m {
            most(votes)?
        } else if extent_m < config.vehicle_m && 2 * vehicle_votes > size {
            (most(vehicles)?.0, vehicle_votes)
        } else {
            return None;
        };
        Some((channel as u8, agreed as f32 / size as f32))
    }
}

/// Channel with most votes, the lowest of equals, and these votes.
fn most(votes: impl Iterator<Item = (usize, u32)>) -> Option<(usize, u32)> {
    votes.max_by_key(|&(channel, votes)| (votes, std::cmp::Reverse(channel)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use SemanticClass::{Building, Car, Person, Pole, Road, Truck};

    const CLASSES: [SemanticClass; 6] = [Building, Car, Person, Pole, Road, Truck];
    const ON: ObjectsConfig = ObjectsConfig { link_m: 0.3, vehicle_m: 12.0, small_m: 1.2, min_pixels: 10 };
    const GEOMETRY: ImageGeometry =
        ImageGeometry { height: 64, width: 512, fov_up_deg: 10.0, fov_down_deg: -30.0 };

    /// A wall across the way, from `left` to `right` of `ahead` (m), and the class of each of its points.
    fn wall(
        ahead: f32,
        [right, left]: [f32; 2],
        class: impl Fn(f32, f32) -> SemanticClass,
    ) -> Vec<([f32; 4], SemanticClass)> {
        let steps = ((left - right) / 0.05) as usize;
        (0..=steps)
            .flat_map(|i| (0..30).map(move |j| (right + 0.05 * i as f32, -1.5 + 0.05 * j as f32)))
            .map(|(y, z)| ([ahead, y, z, 0.5], class(y, z)))
            .collect()
    }

    /// Shares of the image's pixels that each class has after unification.
    fn unified(config: &ObjectsConfig, scan: &[([f32; 4], SemanticClass)]) -> Vec<f32> {
        let points: Vec<[f32; 4]> = scan.iter().map(|(point, _)| *point).collect();
        let image = RangeImage::project(GEOMETRY, &points);
        let channel_of = |class: SemanticClass| CLASSES.iter().position(|c| *c == class).unwrap() as u8;
        let channel =
            image.point.iter().map(|&k| scan.get(k as usize).map_or(0, |(_, class)| channel_of(*class)));
        let mut pixels =
            PixelClasses { channel: channel.collect(), probability: vec![0.9; image.point.len()] };
        unify(config, &points, &image, &CLASSES, &mut pixels);
        let seen: Vec<u8> = (0..image.point.len())
            .filter(|&k| image.point[k] != RangeImage::NONE)
            .map(|k| pixels.channel[k])
            .collect();
        (0..CLASSES.len() as u8)
            .map(|c| seen.iter().filter(|s| **s == c).count() as f32 / seen.len() as f32)
            .collect()
    }

    #[test]
    fn what_is_mostly_a_vehicle_is_one() {
        let class = |_, z| if z > -0.5 { Building } else { Car };
        assert_eq!(unified(&ON, &wall(8.0, [-2.0, 2.0], class))[1], 1.0);
        // Behind the sensor, across the edge of the image.
        let behind: Vec<_> =
            wall(8.0, [-2.0, 2.0], class).into_iter().map(|([x, y, z, r], c)| ([-x, y, z, r], c)).collect();
        assert_eq!(unified(&ON, &behind)[1], 1.0);
    }

    #[test]
    fn a_vehicle_is_of_one_kind_and_the_ground_stays() {
        let shares = unified(
            &ON,
            &wall(8.0, [-2.0, 2.0], |y, z| match y {
                _ if z < -1.2 => Road,
                y if y > 1.0 => Truck,
                _ => Car,
            }),
        );
        assert!(shares[1] > 0.7 && shares[4] > 0.1 && shares[1] + shares[4] == 1.0, "{shares:?}");
    }

    #[test]
    fn long_walls_and_minorities_are_left_alone() {
        let mostly_car = |_, z| if z > -0.5 { Building } else { Car };
        for scan in [
            wall(8.0, [-7.0, 7.0], mostly_car),
            wall(8.0, [-2.0, 2.0], |_, z| if z > -1.0 { Building } else { Car }),
        ] {
            assert_eq!(unified(&ON, &scan), unified(&ObjectsConfig::default(), &scan));
        }
    }

    #[test]
    fn a_small_thing_is_what_most_of_it_is() {
        let shares = unified(&ON, &wall(6.0, [-0.3, 0.3], |_, z| if z > -0.3 { Pole } else { Person }));
        assert_eq!(shares[2], 1.0, "{shares:?}");
    }
}
