"""Times a model in onnxruntime, one thread, one observation at a time.

usage: onnxruntime_bench.py MODEL CALLS DEVICES...

One contender for each number of devices, see rounds.py.
"""

import sys

import numpy
import onnxruntime
import rounds


def contender(session, present, calls):
    rng = numpy.random.default_rng(5)
    inputs = {}
    for port in session.get_inputs():
        shape = [1, *port.shape[1:]]
        inputs[port.name] = rng.random(shape, dtype=numpy.float32)
    inputs["device_mask"] = (numpy.arange(12)[None] < present).astype(numpy.float32)
    return rounds.timed(calls, lambda: session.run(["logits"], inputs))


def main(model_path, calls, devices):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model_path, options, providers=["CPUExecutionProvider"])
    contenders = {str(present): contender(session, present, calls) for present in devices}
    rounds.serve(f"onnxruntime {onnxruntime.__version__}", contenders)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]), [int(number) for number in sys.argv[3:]])
