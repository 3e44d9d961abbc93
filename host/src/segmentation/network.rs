//! The network: an ONNX file, checked against its description, run by tract.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use tract_onnx::Onnx;
use tract_onnx::pb::{GraphProto, ModelProto, TensorShapeProto, tensor_shape_proto::dimension, type_proto};
use tract_onnx::prelude::*;

use super::{ModelDescription, SegmentationError};

/// A network that is ready to run, on any number of threads at the same time.
#[derive(Debug)]
pub struct Network {
    plan: Arc<TypedRunnableModel>,
    input_shape: [usize; 4],
}

impl Network {
    /// Prepares the bytes of an ONNX file for images as described; `path` is for messages.
    pub fn load(
        bytes: &[u8],
        path: &Path,
        description: &ModelDescription,
    ) -> Result<Self, SegmentationError> {
        let file = Checked { path, description };
        let onnx = tract_onnx::onnx();
        let proto = file.parse(&onnx, bytes)?;
        let plan = file.prepare(&onnx, &proto)?;
        Ok(Self { plan, input_shape: description.input_shape() })
    }

    /// The output tensor, channel by channel, of an input tensor of the described shape.
    pub fn run(&self, image: &[f32]) -> Result<Vec<f32>, SegmentationError> {
        let run = || -> TractResult<Vec<f32>> {
            let image = Tensor::from_shape(&self.input_shape, image)?;
            let output = self.plan.run(tvec!(image.into()))?;
            let output = output[0].cast_to::<f32>()?;
            Ok(output.try_as_plain_ram()?.as_slice()?.to_vec())
        };
        guarded(run).map_err(|source| SegmentationError::Inference(source.into()))
    }
}

/// A file while it is checked.
struct Checked<'a> {
    path: &'a Path,
    description: &'a ModelDescription,
}

impl Checked<'_> {
    /// Everything that can be said in the file's own terms.
    fn parse(&self, onnx: &Onnx, mut bytes: &[u8]) -> Result<ModelProto, SegmentationError> {
        let not_onnx = |reason| SegmentationError::NotOnnx { path: self.path.into(), reason };
        let proto = onnx
            .proto_model_for_read(&mut bytes)
            .map_err(|error| not_onnx(error.root_cause().to_string()))?;
        let Some(graph) = &proto.graph else { return Err(not_onnx("it holds no graph".into())) };
        if proto.opset_import.is_empty() {
            return Err(not_onnx("it names no operator set".into()));
        }
        let unknown = unknown_operators(onnx, graph);
        if !unknown.is_empty() {
            return Err(SegmentationError::Operators { path: self.path.into(), operators: unknown });
        }
        if let Some(missing) = tensor_without_source(graph) {
            return Err(not_onnx(format!("nothing makes its tensor `{missing}`")));
        }
        let images: Vec<_> = inputs(graph).collect();
        let ([image], [_]) = (&images[..], &graph.output[..]) else {
            let (inputs, outputs) = (images.len(), graph.output.len());
            return Err(SegmentationError::Bindings { path: self.path.into(), inputs, outputs });
        };
        self.check_declared_input(image)?;
        Ok(proto)
    }

    /// Sizes that the file leaves open are the description's.
    fn check_declared_input(&self, input: &tract_onnx::pb::ValueInfoProto) -> Result<(), SegmentationError> {
        let Some(type_proto::Value::TensorType(tensor)) =
            input.r#type.as_ref().and_then(|t| t.value.as_ref())
        else {
            return Ok(());
        };
        let Some(shape) = &tensor.shape else { return Ok(()) };
        let found = declared_sizes(shape);
        let expected = self.description.input_shape();
        let fits = |(found, expected): (&Option<usize>, usize)| found.is_none_or(|found| found == expected);
        if found.len() == expected.len() && found.iter().zip(expected).all(fits) {
            return Ok(());
        }
        let size = |size: &Option<usize>| size.map_or("?".into(), |size| size.to_string());
        Err(self.shape_error(
            "takes an image of",
            found.iter().map(size).collect::<Vec<_>>().join("x"),
            &expected,
        ))
    }

    fn prepare(&self, onnx: &Onnx, proto: &ModelProto) -> Result<Arc<TypedRunnableModel>, SegmentationError> {
        let shape = self.description.input_shape();
        let prepare = || -> TractResult<(Vec<usize>, TypedModel)> {
            let folder = self.path.parent().and_then(Path::to_str);
            let model = onnx.parse(proto, folder)?.model;
            let model = model.with_input_fact(0, f32::fact(shape).into())?.into_optimized()?;
            let output = model.output_fact(0)?.shape.as_concrete().map(<[usize]>::to_vec);
            Ok((output.unwrap_or_default(), model))
        };
        let refused = |source: TractError| SegmentationError::Refused {
            path: self.path.into(),
            expected: by_x(&shape),
            source: source.into(),
        };
        let (output, model) = guarded(prepare).map_err(refused)?;
        let expected = self.description.output_shape();
        if output != expected {
            return Err(self.shape_error("answers with", by_x(&output), &expected));
        }
        guarded(|| model.into_runnable()).map_err(refused)
    }

    fn shape_error(&self, what: &'static str, found: String, expected: &[usize]) -> SegmentationError {
        SegmentationError::Shape { path: self.path.into(), what, found, expected: by_x(expected) }
    }
}

/// tract panics on some attributes that make no sense (a stride of 0): an error like any other here.
fn guarded<T>(work: impl FnOnce() -> TractResult<T>) -> TractResult<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<String>().map(String::as_str);
        let said = said.or_else(|| panic.downcast_ref::<&str>().copied());
        Err(TractError::msg(said.unwrap_or("an attribute makes no sense").to_owned()))
    })
}

fn by_x(shape: &[usize]) -> String {
    shape.iter().map(ToString::to_string).collect::<Vec<_>>().join("x")
}

/// Sizes, those that are left open as none.
fn declared_sizes(shape: &TensorShapeProto) -> Vec<Option<usize>> {
    let size = |dim: &tract_onnx::pb::tensor_shape_proto::Dimension| match dim.value {
        Some(dimension::Value::DimValue(size)) => usize::try_from(size).ok().filter(|&size| size > 0),
        _ => None,
    };
    shape.dim.iter().map(size).collect()
}

/// Inputs that are not weights.
fn inputs(graph: &GraphProto) -> impl Iterator<Item = &tract_onnx::pb::ValueInfoProto> {
    let is_weight = |name: &str| graph.initializer.iter().any(|weight| weight.name == name);
    graph.input.iter().filter(move |input| !is_weight(&input.name))
}

fn unknown_operators(onnx: &Onnx, graph: &GraphProto) -> Vec<String> {
    let known = |operator: &str| onnx.op_register.0.contains_key(operator);
    let unknown = graph.node.iter().map(|node| &node.op_type).filter(|operator| !known(operator));
    let unknown: std::collections::BTreeSet<_> = unknown.cloned().collect();
    unknown.into_iter().collect()
}

/// The first tensor that is used or given out and comes from nowhere: the rest of the file is missing.
fn tensor_without_source(graph: &GraphProto) -> Option<&str> {
    let given = graph.input.iter().map(|input| input.name.as_str());
    let weights = graph.initializer.iter().map(|weight| weight.name.as_str());
    let made = graph.node.iter().flat_map(|node| node.output.iter().map(String::as_str));
    let sources: std::collections::HashSet<_> = given.chain(weights).chain(made).collect();
    let used = graph.node.iter().flat_map(|node| node.input.iter().map(String::as_str));
    let wanted = used.chain(graph.output.iter().map(|output| output.name.as_str()));
    wanted.filter(|name| !name.is_empty()).find(|name| !sources.contains(name))
}
