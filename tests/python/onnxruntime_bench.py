"""Times a model in onnxruntime, one thread, one observation at a time.

usage: onnxruntime_bench.py MODEL COUNT DEVICES...

Prints, for each number of devices, the minimum and the median of COUNT inferences in microseconds.
"""

import sys
import time

import numpy
import onnxruntime


def main(model_path, count, devices):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model_path, options, providers=["CPUExecutionProvider"])
    rng = numpy.random.default_rng(5)
    for present in devices:
        inputs = {}
        for port in session.get_inputs():
            shape = [1, *port.shape[1:]]
            inputs[port.name] = rng.random(shape, dtype=numpy.float32)
        inputs["device_mask"] = (numpy.arange(12)[None] < present).astype(numpy.float32)
        times = []
        for _ in range(count):
            start = time.perf_counter_ns()
            session.run(["logits"], inputs)
            times.append(time.perf_counter_ns() - start)
        times.sort()
        print(present, times[0] / 1000, times[len(times) // 2] / 1000)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]), [int(number) for number in sys.argv[3:]])
