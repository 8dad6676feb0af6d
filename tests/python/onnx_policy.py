"""Writes the network of firmware/companion/dist/examples/pytorch_policy.py as ONNX, without PyTorch.

usage: onnx_policy.py FILE

PyTorch takes half a gigabyte, so the tests write the same graph, operator by operator, with the package `onnx`. The contract
is read from the example's own text: a name or a shape that changes there changes here. Prints the contract as JSON.
"""

import json
import pathlib
import re
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

EXAMPLE = pathlib.Path(__file__).parents[2] / "firmware/companion/dist/examples/pytorch_policy.py"
OUTPUTS = ("logits", "attention")
WIDTH = 64


def contract():
    """Name and shape without the batch of each input and output, from the table in the example."""
    text = EXAMPLE.read_text()
    rows = re.findall(r"^    (\w+) +\[N, ([\d, ]+)\]", text, re.MULTILINE)
    return {name: [int(length) for length in shape.split(",")] for name, shape in rows}


class Graph:
    """Nodes and weights, in order."""

    def __init__(self):
        self.random = np.random.default_rng(0)
        self.nodes, self.weights = [], []

    def constant(self, name, value):
        self.weights.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def add(self, operator, inputs, output, **attributes):
        self.nodes.append(helper.make_node(operator, inputs, [output], **attributes))
        return output

    def linear(self, name, source, width_in, width_out):
        """torch.nn.Linear: uniform in plus and minus one over the root of the width."""
        bound = width_in**-0.5
        draw = lambda *shape: self.random.uniform(-bound, bound, shape).astype(np.float32)
        weight = self.constant(f"{name}.weight", draw(width_in, width_out))
        product = self.add("MatMul", [source, weight], f"{name}.product")
        return self.add("Add", [product, self.constant(f"{name}.bias", draw(width_out))], name)


def network(shapes):
    graph = Graph()
    floats = lambda name, values: graph.constant(name, np.array(values, dtype=np.float32))
    integers = lambda name, values: graph.constant(name, np.array(values, dtype=np.int64))
    scaled = {}
    for name, scale in [
        ("uav", [100.0, 100.0, 400.0, 400.0]),
        ("devices", [400.0, 400.0, 8000.0, 30.0, 1.0, 400.0, 400.0]),
        ("local_map", 8000.0),
    ]:
        scaled[name] = graph.add("Div", [name, floats(f"{name}.scale", scale)], f"{name}.scaled")
    one = integers("axis1", [1])
    own = graph.linear("own", scaled["uav"], 4, WIDTH)
    rows = [
        own,
        graph.linear("wish", "preference", 2, WIDTH),
        graph.linear("map", scaled["local_map"], shapes["local_map"][0], WIDTH),
    ]
    rows = [graph.add("Unsqueeze", [row, one], f"{row}.row") for row in rows]
    seen = graph.linear("device", scaled["devices"], 7, WIDTH)
    tokens = graph.add("Concat", [*rows, seen], "tokens", axis=1)

    head = graph.add("Slice", ["device_mask", integers("from", [0]), integers("to", [3]), one], "head")
    always = graph.add("Add", [graph.add("Mul", [head, floats("zero", 0.0)], "none"), floats("one", 1.0)], "always")
    present = graph.add("Concat", [always, "device_mask"], "present", axis=1)
    absent = graph.add("Sub", [graph.add("Unsqueeze", [present, one], "present.row"), "one"], "absent")
    query, key, value = (graph.linear(name, tokens, WIDTH, WIDTH) for name in ("query", "key", "value"))
    turned = graph.add("Transpose", [key], "turned", perm=[0, 2, 1])
    scores = graph.add("Div", [graph.add("MatMul", [query, turned], "products"), floats("root", WIDTH**0.5)], "scores")
    masked = graph.add("Add", [scores, graph.add("Mul", [absent, floats("far", 1e9)], "penalty")], "masked")
    graph.add("Softmax", [masked], "attention", axis=2)
    mixed = graph.add("Relu", [graph.add("MatMul", ["attention", value], "mixture")], "mixed")
    highest = graph.add("ReduceMax", [mixed], "highest", axes=[1], keepdims=0)
    both = graph.add("Concat", [own, highest], "both", axis=1)
    graph.add("Identity", [graph.linear("answer", both, 2 * WIDTH, shapes["logits"][0])], "logits")
    return graph


def write(path):
    shapes = contract()
    graph = network(shapes)
    port = lambda name: helper.make_tensor_value_info(name, TensorProto.FLOAT, ["N", *shapes[name]])
    inputs = [port(name) for name in shapes if name not in OUTPUTS]
    model = helper.make_model(
        helper.make_graph(graph.nodes, "policy", inputs, [port(name) for name in OUTPUTS], graph.weights),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=8,
    )
    onnx.checker.check_model(model)
    onnx.save(model, path)
    print(json.dumps(shapes))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    write(sys.argv[1])
