"""Writes a trained network as ONNX, with the model.toml that goes with it.

Batch norms are folded into the convolutions; the weights are stored in bytes and widened on loading.
"""

import argparse
import copy
from pathlib import Path

import numpy as np
import onnx
import torch
from torch.nn.utils.fusion import fuse_conv_bn_eval

from data import CLASSES, DEVIATIONS, FOV_DOWN_DEG, FOV_UP_DEG, MEANS, RAW_IDS
from net import Net


def folded(module):
    """The same module without batch norms."""
    module = copy.deepcopy(module).eval()
    for child in module.modules():
        if isinstance(child, torch.nn.Sequential) and len(child) > 1 and isinstance(child[1], torch.nn.BatchNorm2d):
            transpose = isinstance(child[0], torch.nn.ConvTranspose2d)
            child[0] = fuse_conv_bn_eval(child[0], child[1], transpose)
            child[1] = torch.nn.Identity()
    return module


def blend(weights, others, share):
    """Averages of weights often do better on other data than either network (Wortsman et al. 2022)."""
    for name, value in weights.items():
        if value.is_floating_point():
            value.lerp_(others[name], share)


def model_toml(height, width):
    numbers = lambda values: ", ".join(f"{v:.2f}" for v in values)
    return f"""[image]
height = {height}
width = {width}
fov_up_deg = {FOV_UP_DEG}
fov_down_deg = {FOV_DOWN_DEG}

[normalise]
# range, x, y, z, remission
means = [{numbers(MEANS)}]
deviations = [{numbers(DEVIATIONS)}]

[output]
kind = "logits"
# SemanticKITTI's raw id of each class, in the network's order.
classes = {[ids[0] for ids in RAW_IDS]}

[objects]
link_m = 0.4

[feet]
height_m = 0.15
"""


def shrink(path):
    """Stores the weights of an ONNX file in bytes, with a scale for each channel: a quarter of the size, the same float32 arithmetic."""
    model = onnx.load(path)
    graph = model.graph
    transposed = {node.input[1] for node in graph.node if node.op_type == "ConvTranspose"}
    for tensor in list(graph.initializer):
        values = onnx.numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.ndim != 4 or values.size < 256:
            continue
        others = (0, 2, 3) if tensor.name in transposed else (1, 2, 3)
        scale = (np.abs(values).max(others, keepdims=True) / 127).astype(np.float32)
        scale[scale == 0] = 1
        graph.initializer.remove(tensor)
        for name, stored in [("bytes", np.rint(values / scale).astype(np.int8)), ("scale", scale)]:
            graph.initializer.append(onnx.numpy_helper.from_array(stored, f"{tensor.name}.{name}"))
        widen = onnx.helper.make_node(
            "Cast", [f"{tensor.name}.bytes"], [f"{tensor.name}.float"], to=onnx.TensorProto.FLOAT
        )
        times = onnx.helper.make_node("Mul", [f"{tensor.name}.float", f"{tensor.name}.scale"], [tensor.name])
        graph.node.insert(0, times)
        graph.node.insert(0, widen)
    onnx.checker.check_model(model)
    onnx.save(model, path)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--out", type=Path, default=Path("default.onnx"))
    parser.add_argument(
        "--favour", nargs=2, action="append", default=[], metavar=("CLASS", "BIAS"),
        help="adds to the logit of a class, for example: building 0.6",
    )
    parser.add_argument(
        "--blend", nargs=2, action="append", default=[], metavar=("CHECKPOINT", "SHARE"),
        help="averages the weights with those of another network that one of the two was trained from",
    )
    args = parser.parse_args()
    saved = torch.load(args.checkpoint, map_location="cpu", weights_only=True)
    for path, share in args.blend:
        blend(saved["weights"], torch.load(path, map_location="cpu", weights_only=True)["weights"], float(share))
    net = Net(*saved["channels"])
    net.load_state_dict(saved["weights"])
    for name, bias in args.favour:
        net.head.bias.data[CLASSES.index(name)] += float(bias)
    image = torch.zeros(1, 5, saved["height"], saved["width"])
    torch.onnx.export(
        folded(net), (image,), args.out, opset_version=17, input_names=["image"], output_names=["logits"], dynamo=False
    )
    shrink(args.out)
    args.out.with_suffix(".toml").write_text(model_toml(saved["height"], saved["width"]))
    print(f"{args.out}: {args.out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
