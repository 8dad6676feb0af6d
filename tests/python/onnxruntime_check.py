"""Judges a model file with ONNX's own checker and runs it in onnxruntime.

usage: onnxruntime_check.py MODEL FOLDER

FOLDER holds the inputs of a batch, one file each, `uav.f32` and so on: little-endian f32, no header. The
outputs are written beside them in the same form. Exits with 1 and a line on stderr when the model is wrong.
"""

import pathlib
import sys

import numpy
import onnx
import onnxruntime


def main(model_path, folder):
    model = onnx.load(model_path)
    onnx.checker.check_model(model, full_check=True)
    onnx.shape_inference.infer_shapes(model, check_type=True, strict_mode=True, data_prop=True)

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 2
    session = onnxruntime.InferenceSession(model_path, options, providers=["CPUExecutionProvider"])
    inputs = {}
    for port in session.get_inputs():
        if port.type != "tensor(float)" or port.shape[0] != "N":
            sys.exit(f"input {port.name}: {port.type} {port.shape}")
        numbers = numpy.fromfile(folder / f"{port.name}.f32", dtype="<f4")
        inputs[port.name] = numbers.reshape([-1, *port.shape[1:]])

    names = [port.name for port in session.get_outputs()]
    batch = session.run(names, inputs)
    first = session.run(names, {name: numbers[:1] for name, numbers in inputs.items()})
    for name, many, one in zip(names, batch, first):
        if not numpy.isfinite(many).all():
            sys.exit(f"output {name} is not finite")
        difference = abs(many[:1] - one).max()
        if not difference <= 1e-5:
            sys.exit(f"output {name} depends on the other samples of the batch: {difference}")
        many.astype("<f4").tofile(folder / f"{name}.f32")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
