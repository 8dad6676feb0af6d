"""Times one update of MOSAC in PyTorch, eager and compiled, on one thread.

Contenders, see rounds.py: `eager`, and `compiled` where TorchInductor works on this machine. The update is that of
host-trainer/scripts/pytorch_update_bench.py.
"""

import pathlib
import sys

import rounds
import torch

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "host-trainer" / "scripts"))
import pytorch_update_bench as bench  # noqa: E402

UPDATES = 2
WARM_UP = 5


def contender(compiled):
    update = bench.learner(compiled)
    for _ in range(WARM_UP):
        update()
    return rounds.timed(UPDATES, update)


def main():
    torch.set_num_threads(1)
    torch.manual_seed(1)
    contenders = {"eager": contender(False)}
    why = ""
    try:
        contenders["compiled"] = contender(True)
    except Exception as cause:  # Whatever the compiler raises: the eager mode is timed all the same.
        why = f"; torch.compile failed: {type(cause).__name__}"
    rounds.serve(f"PyTorch {torch.__version__}{why}", contenders)


if __name__ == "__main__":
    main()
