//! The published architectures, narrow and random, against ONNX Runtime.

use sdslam::segmentation::network::Network;

use crate::support::{CLASSES, HEIGHT, WIDTH, bytes, description, floats, image, networks, onnx};

const NETWORKS: [&str; 4] = ["darknet21", "darknet53", "squeezesegv2", "salsanext"];

fn argmax(output: &[f32], pixel: usize) -> usize {
    let at = |class: &usize| output[class * HEIGHT * WIDTH + pixel];
    (0..CLASSES).max_by(|a, b| at(a).total_cmp(&at(b)).then(b.cmp(a))).expect("classes")
}

#[test]
fn outputs_are_those_of_onnx_runtime() {
    for name in NETWORKS {
        let network = Network::load(&bytes(name), &onnx(name), &description()).expect("it loads");
        let found = network.run(&image()).expect("it runs");
        let expected = floats(&networks().join(format!("{name}.f32")));
        assert_eq!(found.len(), expected.len());
        let largest = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let pixels = HEIGHT * WIDTH;
        let agree = (0..pixels).filter(|&p| argmax(&found, p) == argmax(&expected, p)).count();
        println!("{name}: largest difference {largest:.1e}, same class in {agree} of {pixels} pixels");
        assert!(largest < 1e-5, "{name}: {largest}");
        assert!(agree >= pixels - 1, "{name}: {agree}");
    }
}

#[test]
fn another_image_gives_another_output() {
    // Or the comparison above would prove nothing.
    let network = Network::load(&bytes("darknet21"), &onnx("darknet21"), &description()).expect("it loads");
    let (mut image, before) = (image(), network.run(&image()).expect("it runs"));
    image[700] += 1.0;
    let after = network.run(&image).expect("it runs");
    let largest = after.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(largest > 1e-3, "{largest}");
}
